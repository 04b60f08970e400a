// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/eval/frame_similarity.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace semrover {

namespace {

constexpr size_t kRadius = kSsimWindow / 2;
constexpr double kSigma = 1.5;
constexpr double kC1 = 0.01 * 255 * (0.01 * 255), kC2 = 0.03 * 255 * (0.03 * 255);

// a window's moments: mean of a, of b, of a^2, of b^2, of a b
using Moments = std::array<double, 5>;

std::array<double, kSsimWindow> gaussian()
{
    std::array<double, kSsimWindow> w;
    double sum = 0;
    for (size_t i = 0; i < w.size(); ++i) {
        const double x = double(i) - double(kRadius);
        sum += w[i] = std::exp(-x * x / (2 * kSigma * kSigma));
    }
    for (double& x : w)
        x /= sum;
    return w;
}

double luma(const ImageRgb8& image, size_t pixel)
{
    const uint8_t* p = &image.pixels[3 * pixel];
    return 0.299 * p[0] + 0.587 * p[1] + 0.114 * p[2];
}

// the moments of one row of pixels, smoothed along it
void smooth_row(const ImageRgb8& a, const ImageRgb8& b, size_t row, const std::array<double, kSsimWindow>& weights,
                std::span<Moments> out)
{
    std::vector<Moments> values(a.width);
    for (size_t x = 0; x < a.width; ++x) {
        const double p = luma(a, row * a.width + x), q = luma(b, row * a.width + x);
        values[x] = {p, q, p * p, q * q, p * q};
    }
    for (size_t x = 0; x < out.size(); ++x) {
        out[x] = {};
        for (size_t i = 0; i < kSsimWindow; ++i)
            for (size_t m = 0; m < out[x].size(); ++m)
                out[x][m] += weights[i] * values[x + i][m];
    }
}

double ssim_of(const Moments& m)
{
    const auto& [a, b, aa, bb, ab] = m;
    const double var_a = aa - a * a, var_b = bb - b * b, covariance = ab - a * b;
    return (2 * a * b + kC1) * (2 * covariance + kC2) / ((a * a + b * b + kC1) * (var_a + var_b + kC2));
}

double square_error(const ImageRgb8& a, const ImageRgb8& b, size_t pixel)
{
    double sum = 0;
    for (size_t i = 3 * pixel; i < 3 * pixel + 3; ++i) {
        const double d = double(a.pixels[i]) - double(b.pixels[i]);
        sum += d * d;
    }
    return sum;
}

// Of pixel (x, y), which is not on the rim; Sobel's weights.
double squared_gradient(const ImageRgb8& image, size_t x, size_t y)
{
    const auto at = [&](size_t column, size_t row) {
        return luma(image, (y + row - 1) * image.width + x + column - 1);
    };
    const double across = at(2, 0) + 2 * at(2, 1) + at(2, 2) - at(0, 0) - 2 * at(0, 1) - at(0, 2);
    const double down = at(0, 2) + 2 * at(1, 2) + at(2, 2) - at(0, 0) - 2 * at(1, 0) - at(2, 0);
    return across * across + down * down;
}

} // namespace

SimilaritySums& SimilaritySums::operator+=(const SimilaritySums& other)
{
    pixels += other.pixels;
    squares += other.squares;
    windows += other.windows;
    similarity += other.similarity;
    gradients += other.gradients;
    true_gradients += other.true_gradients;
    return *this;
}

double SimilaritySums::psnr() const
{
    if (squares == 0)
        return std::numeric_limits<double>::infinity();
    return 10 * std::log10(255.0 * 255.0 * double(3 * pixels) / squares);
}

double SimilaritySums::ssim() const
{
    return windows ? similarity / double(windows) : 0;
}

double SimilaritySums::sharpness() const
{
    return std::sqrt(gradients / true_gradients);
}

FrameSimilarity& FrameSimilarity::operator+=(const FrameSimilarity& other)
{
    all += other.all;
    visible += other.visible;
    hidden += other.hidden;
    for (size_t i = 0; i < labels.size(); ++i)
        labels[i] += other.labels[i];
    for (size_t range = 0; range < distances.size(); ++range)
        for (size_t i = 0; i < labels.size(); ++i)
            distances[range][i] += other.distances[range][i];
    return *this;
}

std::vector<double> ssim_map(const ImageRgb8& a, const ImageRgb8& b)
{
    SR_ASSERT(a.width == b.width && a.height == b.height, "SSIM of {}x{} and {}x{} pixels", a.width, a.height, b.width,
              b.height);
    if (a.width < kSsimWindow || a.height < kSsimWindow)
        return {};
    static const std::array<double, kSsimWindow> weights = gaussian();
    const size_t width = a.width - 2 * kRadius, height = a.height - 2 * kRadius;
    std::vector<std::vector<Moments>> rows(kSsimWindow, std::vector<Moments>(width)); // a ring of smoothed rows
    std::vector<double> map;
    map.reserve(width * height);
    for (size_t y = 0; y < a.height; ++y) {
        smooth_row(a, b, y, weights, rows[y % kSsimWindow]);
        if (y + 1 < kSsimWindow)
            continue;
        for (size_t x = 0; x < width; ++x) {
            Moments sum{};
            for (size_t i = 0; i < kSsimWindow; ++i)
                for (size_t m = 0; m < sum.size(); ++m)
                    sum[m] += weights[i] * rows[(y + 1 + i) % kSsimWindow][x][m];
            map.push_back(ssim_of(sum));
        }
    }
    return map;
}

FrameSimilarity frame_similarity(const ImageRgb8& frame, const ImageRgb8& truth, const KnownPixels& known)
{
    const size_t pixels = size_t(frame.width) * frame.height;
    const auto covers = [&](size_t values) { return values == 0 || values == pixels; };
    SR_ASSERT(covers(known.visible.size()) && covers(known.labels.size()) && covers(known.depth.size()),
              "{} pixels, {} visible, {} labels, {} depths", pixels, known.visible.size(), known.labels.size(),
              known.depth.size());
    const std::vector<double> map = ssim_map(frame, truth);
    FrameSimilarity result;
    for (size_t i = 0; i < pixels; ++i) {
        const size_t y = i / frame.width, x = i % frame.width;
        const size_t row = y - kRadius, column = x - kRadius; // of the map, or wrapped
        SimilaritySums own{.pixels = 1, .squares = square_error(frame, truth, i)};
        if (!map.empty() && row < frame.height - 2 * kRadius && column < frame.width - 2 * kRadius) {
            own.windows = 1;
            own.similarity = map[row * (frame.width - 2 * kRadius) + column];
        }
        if (x > 0 && y > 0 && x + 1 < frame.width && y + 1 < frame.height) {
            own.gradients = squared_gradient(frame, x, y);
            own.true_gradients = squared_gradient(truth, x, y);
        }
        result.all += own;
        if (!known.visible.empty())
            (known.visible[i] >= 128 ? result.visible : result.hidden) += own;
        const size_t label = known.labels.empty() ? kClassCount : std::min<size_t>(known.labels[i], kClassCount);
        if (!known.labels.empty())
            result.labels[label] += own;
        if (!known.depth.empty() && known.depth[i] > 0)
            result
                .distances[size_t(std::ranges::upper_bound(kDistances, known.depth[i]) - kDistances.begin())][label] +=
                own;
    }
    return result;
}

} // namespace semrover
