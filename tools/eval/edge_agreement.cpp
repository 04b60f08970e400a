// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/eval/edge_agreement.h"

#include <cmath>
#include <cstdlib>
#include <vector>

namespace semrover {

namespace {

constexpr size_t kInReach = 2 * kEdgeReach + 1;

// steps: from kEdgeReach before the border to kEdgeReach after it, one picture's pixel apart
EdgeDistances distances_of(const std::array<double, kInReach>& steps)
{
    EdgeDistances d{.borders = 1, .step = steps[kEdgeReach]};
    double most = kLeastStep;
    int nearest = kEdgeReach + 1;
    for (size_t i = 0; i < kInReach; ++i) {
        d.step_beside += steps[i] / double(kInReach);
        const int away = std::abs(int(i) - kEdgeReach);
        if (steps[i] > most || (steps[i] == most && away < nearest)) {
            most = steps[i];
            nearest = away;
        }
    }
    for (int away = nearest; away <= kEdgeReach; ++away)
        d.at_most[size_t(away)] = 1;
    return d;
}

// lines of `length` pixels, `along` apart in memory
void add_line(const double* luma, const uint8_t* labels, size_t length, size_t along, EdgeAgreement& sums)
{
    for (size_t x = kEdgeReach; x + kEdgeReach + 1 < length; ++x) {
        const uint8_t a = labels[x * along], b = labels[(x + 1) * along];
        if (a == b || a >= kClassCount || b >= kClassCount)
            continue;
        std::array<double, kInReach> steps{};
        for (size_t i = 0; i < kInReach; ++i) {
            const size_t at = (x - kEdgeReach + i) * along;
            steps[i] = std::abs(luma[at + along] - luma[at]);
        }
        const EdgeDistances d = distances_of(steps);
        sums.all += d;
        sums.labels[a] += d;
        sums.labels[b] += d;
    }
}

} // namespace

EdgeDistances& EdgeDistances::operator+=(const EdgeDistances& other)
{
    borders += other.borders;
    for (size_t i = 0; i < at_most.size(); ++i)
        at_most[i] += other.at_most[i];
    step += other.step;
    step_beside += other.step_beside;
    return *this;
}

EdgeAgreement& EdgeAgreement::operator+=(const EdgeAgreement& other)
{
    all += other.all;
    for (size_t i = 0; i < labels.size(); ++i)
        labels[i] += other.labels[i];
    return *this;
}

EdgeAgreement edge_agreement(const ImageRgb8& frame, std::span<const uint8_t> labels)
{
    const size_t width = frame.width, height = frame.height;
    std::vector<double> luma(width * height);
    for (size_t i = 0; i < luma.size(); ++i)
        luma[i] = 0.299 * frame.pixels[3 * i] + 0.587 * frame.pixels[3 * i + 1] + 0.114 * frame.pixels[3 * i + 2];
    EdgeAgreement sums;
    for (size_t y = 0; y < height; ++y)
        add_line(&luma[y * width], &labels[y * width], width, 1, sums);
    for (size_t x = 0; x < width; ++x)
        add_line(&luma[x], &labels[x], height, width, sums);
    return sums;
}

} // namespace semrover
