// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/streets/pattern_canvas.h"

#include <algorithm>
#include <cmath>
#include <string_view>

namespace semrover {

double smooth_step(double low, double high, double x)
{
    const double t = std::clamp((x - low) / (high - low), 0.0, 1.0);
    return t * t * (3 - 2 * t);
}

double hash_unit(int32_t i, int32_t j, uint32_t seed)
{
    uint32_t h = uint32_t(i) * 0x9e3779b1u ^ uint32_t(j) * 0x85ebca77u ^ seed * 0xc2b2ae3du;
    h = (h ^ (h >> 15)) * 0x2c1b3c6du;
    h = (h ^ (h >> 12)) * 0x297a2d39u;
    return (h ^ (h >> 15)) * (1.0 / 4294967296.0);
}

double noise(double u, double v, int cells, uint32_t seed)
{
    const double x = u * cells, y = v * cells;
    const int i = int(std::floor(x)), j = int(std::floor(y));
    const double fx = smooth_step(0, 1, x - i), fy = smooth_step(0, 1, y - j);
    const auto at = [&](int a, int b) {
        return hash_unit(((i + a) % cells + cells) % cells, ((j + b) % cells + cells) % cells, seed);
    };
    const double top = at(0, 0) + (at(1, 0) - at(0, 0)) * fx, low = at(0, 1) + (at(1, 1) - at(0, 1)) * fx;
    return top + (low - top) * fy;
}

double cloud_noise(double u, double v, int cells, uint32_t seed)
{
    double sum = 0, weight = 0.5;
    for (uint32_t octave = 0; octave < 4; ++octave, weight /= 2)
        sum += weight * noise(u, v, cells << octave, seed + octave);
    return sum / 0.9375;
}

std::array<double, 2> cell_noise(double u, double v, int cells, uint32_t seed)
{
    const double x = u * cells, y = v * cells;
    const int i = int(std::floor(x)), j = int(std::floor(y));
    double nearest = 9, second = 9;
    for (int a = -1; a <= 1; ++a)
        for (int b = -1; b <= 1; ++b) {
            const int ci = ((i + a) % cells + cells) % cells, cj = ((j + b) % cells + cells) % cells;
            const double dx = i + a + hash_unit(ci, cj, seed) - x, dy = j + b + hash_unit(ci, cj, seed + 7) - y;
            const double d = std::sqrt(dx * dx + dy * dy);
            second = std::min(second, std::max(nearest, d));
            nearest = std::min(nearest, d);
        }
    return {nearest, second};
}

void PatternCanvas::rectangle(double u0, double v0, double u1, double v1, const Rgb& color, double strength)
{
    each([&](double u, double v, const Rgb& was) {
        return u >= u0 && u < u1 && v >= v0 && v < v1 ? blend(was, color, strength) : was;
    });
}

void PatternCanvas::disc(double cu, double cv, double ru, double rv, const Rgb& color)
{
    const double soft = 1.5 / (side_ * std::min(ru, rv));
    each([&](double u, double v, const Rgb& was) {
        const double du = (u - cu) / ru, dv = (v - cv) / rv;
        return blend(color, was, smooth_step(1 - soft, 1 + soft, std::sqrt(du * du + dv * dv)));
    });
}

void PatternCanvas::line(double u0, double v0, double u1, double v1, double width, const Rgb& color)
{
    const double du = u1 - u0, dv = v1 - v0, length2 = std::max(du * du + dv * dv, 1e-12), soft = 0.75 / side_;
    each([&](double u, double v, const Rgb& was) {
        const double t = std::clamp(((u - u0) * du + (v - v0) * dv) / length2, 0.0, 1.0);
        const double x = u - u0 - t * du, y = v - v0 - t * dv;
        return blend(color, was, smooth_step(width / 2 - soft, width / 2 + soft, std::sqrt(x * x + y * y)));
    });
}

void PatternCanvas::letters(double u0, double v0, double u1, double v1, int count, uint32_t seed, const Rgb& color)
{
    const double step = (u1 - u0) / count, wide = step * 0.7, stroke = std::min(wide, v1 - v0) * 0.2;
    for (int i = 0; i < count; ++i) {
        if (hash_unit(i, 3, seed) < 0.12)
            continue; // between words
        const double left = u0 + step * i, right = left + wide, middle = (v0 + v1) / 2;
        line(left, v0, left, v1, stroke, color);
        const int shape = int(hash_unit(i, 5, seed) * 6);
        if (shape != 1)
            line(left, shape == 2 ? v1 : v0, right, shape == 3 ? v1 : shape == 2 ? v1 : v0, stroke, color);
        if (shape == 0 || shape == 4)
            line(left, middle, right, middle, stroke, color);
        if (shape == 1 || shape == 5)
            line(right, v0, right, v1, stroke, color);
        if (shape == 4 || shape == 5)
            line(left, v1, right, v1, stroke, color);
        if (shape == 1)
            line(left, v0, right, v1, stroke, color);
    }
}

void PatternCanvas::sign_text(std::string_view text, double u0, double v0, double u1, double v1, const Rgb& color)
{
    // segments of a letter on a grid of 2 x 4 half voxels: pairs of points "xy", x 0..2, y 0..4
    const auto strokes = [](char c) -> std::string_view {
        switch (c) {
        case 'S':
            return "2000 0002 0222 2224 2404";
        case 'T':
            return "0020 1014";
        case 'O':
        case '0':
            return "0020 2024 2404 0400";
        case 'P':
            return "0400 0020 2022 2202";
        case '3':
            return "0020 2024 2404 0222";
        case '5':
            return "2000 0002 0222 2224 2404";
        default:
            return "";
        }
    };
    const double step = (u1 - u0) / double(text.size()), wide = step * 0.68, stroke = wide * 0.26;
    for (size_t i = 0; i < text.size(); ++i) {
        const std::string_view s = strokes(text[i]);
        const double left = u0 + step * (double(i) + 0.16);
        for (size_t k = 0; k + 4 <= s.size(); k += 5)
            line(left + wide * (s[k] - '0') / 2, v0 + (v1 - v0) * (s[k + 1] - '0') / 4,
                 left + wide * (s[k + 2] - '0') / 2, v0 + (v1 - v0) * (s[k + 3] - '0') / 4, stroke, color);
    }
}

ImageRgb8 PatternCanvas::image() const
{
    ImageRgb8 out{side_, side_, {}};
    out.pixels.reserve(pixels_.size() * 3);
    for (const Rgb& p : pixels_)
        for (double c : p)
            out.pixels.push_back(uint8_t(std::lround(std::clamp(c, 0.0, 1.0) * 255)));
    return out;
}

} // namespace semrover
