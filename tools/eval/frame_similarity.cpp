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

} // namespace

SimilaritySums& SimilaritySums::operator+=(const SimilaritySums& other)
{
    pixels += other.pixels;
    squares += other.squares;
    windows += other.windows;
    similarity += other.similarity;
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

FrameSimilarity& FrameSimilarity::operator+=(const FrameSimilarity& other)
{
    all += other.all;
    visible += other.visible;
    hidden += other.hidden;
    for (size_t i = 0; i < labels.size(); ++i)
        labels[i] += other.labels[i];
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

FrameSimilarity frame_similarity(const ImageRgb8& frame, const ImageRgb8& truth, std::span<const uint8_t> visible,
                                 std::span<const uint8_t> labels)
{
    const size_t pixels = size_t(frame.width) * frame.height;
    SR_ASSERT((visible.empty() || visible.size() == pixels) && (labels.empty() || labels.size() == pixels),
              "{} pixels, {} visible, {} labels", pixels, visible.size(), labels.size());
    const std::vector<double> map = ssim_map(frame, truth);
    FrameSimilarity y;
    for (size_t i = 0; i < pixels; ++i) {
        const size_t row = i / frame.width - kRadius, column = i % frame.width - kRadius; // of the map, or wrapped
        SimilaritySums own{.pixels = 1, .squares = square_error(frame, truth, i)};
        if (!map.empty() && row < frame.height - 2 * kRadius && column < frame.width - 2 * kRadius) {
            own.windows = 1;
            own.similarity = map[row * (frame.width - 2 * kRadius) + column];
        }
        y.all += own;
        if (!visible.empty())
            (visible[i] >= 128 ? y.visible : y.hidden) += own;
        if (!labels.empty())
            y.labels[std::min<size_t>(labels[i], kClassCount)] += own;
    }
    return y;
}

} // namespace semrover
