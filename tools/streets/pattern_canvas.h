// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/image.h"
#include "tools/streets/pattern.h"

#include <array>
#include <vector>

namespace semrover {

using Rgb = std::array<double, 3>; // sRGB, 0..1

inline Rgb gray(double v)
{
    return {v, v, v};
}
inline Rgb operator*(const Rgb& a, double s)
{
    return {a[0] * s, a[1] * s, a[2] * s};
}
inline Rgb blend(const Rgb& a, const Rgb& b, double t)
{
    return {a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t, a[2] + (b[2] - a[2]) * t};
}
double smooth_step(double low, double high, double x); // 0 below low, 1 above high

// Noise over the unit square that repeats without a seam, 0..1.
double noise(double u, double v, int cells, uint32_t seed);                     // about 0.5 in the mean
double cloud_noise(double u, double v, int cells, uint32_t seed);               // four octaves of it
double hash_unit(int32_t i, int32_t j, uint32_t seed);                          // of a lattice point, 0..1
std::array<double, 2> cell_noise(double u, double v, int cells, uint32_t seed); // distance to the nearest two seeds

// A picture while it is painted: u to the right, v down, both 0..1.
class PatternCanvas {
  public:
    explicit PatternCanvas(uint32_t side, const Rgb& ground = {1, 1, 1})
        : side_(side), pixels_(size_t(side) * side, ground)
    {
    }

    // paint(u, v, what is there) -> colour, at every pixel's centre
    template <typename Paint>
    void each(Paint paint)
    {
        for (uint32_t y = 0; y < side_; ++y)
            for (uint32_t x = 0; x < side_; ++x) {
                Rgb& p = pixels_[size_t(y) * side_ + x];
                p = paint((x + 0.5) / side_, (y + 0.5) / side_, p);
            }
    }
    void rectangle(double u0, double v0, double u1, double v1, const Rgb& color, double strength = 1);
    void disc(double u, double v, double radius_u, double radius_v, const Rgb& color);
    void line(double u0, double v0, double u1, double v1, double width, const Rgb& color);
    // made-up writing of some letters within a rectangle: strokes, no real words
    void letters(double u0, double v0, double u1, double v1, int count, uint32_t seed, const Rgb& color);
    // digits and capital letters that signs need, as strokes within a rectangle
    void sign_text(std::string_view text, double u0, double v0, double u1, double v1, const Rgb& color);
    ImageRgb8 image() const;

  private:
    uint32_t side_;
    std::vector<Rgb> pixels_;
};

} // namespace semrover

namespace semrover::paint {

// each paints its patterns onto a canvas of the pattern's size
void ground(PatternCanvas& canvas, Pattern pattern);
void wall(PatternCanvas& canvas, Pattern pattern);
void opening(PatternCanvas& canvas, Pattern pattern); // windows, doors, shops
void plant(PatternCanvas& canvas, Pattern pattern);
void vehicle(PatternCanvas& canvas, Pattern pattern);
void sign(PatternCanvas& canvas, Pattern pattern);

} // namespace semrover::paint
