// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/streets/pattern_canvas.h"

#include <algorithm>
#include <cmath>

namespace semrover::paint {

namespace {

// a room behind glass: darker towards the top, hints of furniture
void room(PatternCanvas& canvas, const Rgb& tone, uint32_t seed)
{
    canvas.each([&](double u, double v, const Rgb&) {
        return tone * (0.7 + 0.5 * v + 0.35 * (cloud_noise(u, v, 3, seed) - 0.5));
    });
}

void curtain(PatternCanvas& canvas)
{
    room(canvas, {0.15, 0.16, 0.18}, 3);
    canvas.each([](double u, double v, const Rgb& was) {
        const double side = std::min(u, 1 - u), hang = 0.3 - 0.08 * smooth_step(0.3, 1.0, v);
        if (side > hang)
            return was;
        return Rgb{0.74, 0.73, 0.7} * (0.78 + 0.22 * std::sin(side * 110 + 3 * noise(u, v, 4, 2)));
    });
}

void blind(PatternCanvas& canvas)
{
    room(canvas, {0.14, 0.15, 0.17}, 5);
    canvas.each([](double, double v, const Rgb& was) {
        const double slat = v * 26 - std::floor(v * 26);
        return v < 0.58 ? Rgb{0.68, 0.67, 0.63} * (slat < 0.25 ? 0.68 : 0.95) : was;
    });
}

void office(PatternCanvas& canvas)
{
    canvas.each([](double u, double v, const Rgb&) {
        const double ceiling = smooth_step(0.3, 0.0, v) * 0.1;
        const double lamps = v < 0.16 && std::abs(u * 3 - std::floor(u * 3) - 0.5) < 0.22 ? 0.14 : 0;
        const double value = 0.21 + ceiling + lamps + 0.1 * (cloud_noise(u, v, 4, 3) - 0.5) - 0.05 * v;
        return Rgb{value * 0.86, value * 0.97, value * 1.06};
    });
}

// a display: a back wall, shelves with goods, light from above
void shop(PatternCanvas& canvas, uint32_t seed, const Rgb& back, int shelves)
{
    canvas.each([&](double u, double v, const Rgb&) {
        return back * (1.1 - 0.45 * v + 0.25 * (cloud_noise(u, v, 4, seed) - 0.5));
    });
    for (int s = 0; s < shelves; ++s) {
        const double base = 0.34 + 0.58 * (s + 1) / shelves;
        canvas.rectangle(0.02, base, 0.98, base + 0.02, back * 0.55);
        for (int i = 0; i < 11; ++i) {
            const double left = 0.03 + 0.087 * i, wide = 0.03 + 0.045 * hash_unit(i, s, seed);
            const double high = (0.05 + 0.1 * hash_unit(i, s, seed + 1)) * (shelves > 2 ? 1 : 1.9);
            const double hue = hash_unit(i, s, seed + 2);
            const Rgb goods = hue < 0.3   ? Rgb{0.62, 0.3, 0.24}
                              : hue < 0.5 ? Rgb{0.72, 0.66, 0.5}
                              : hue < 0.7 ? Rgb{0.28, 0.38, 0.48}
                              : hue < 0.9 ? Rgb{0.75, 0.73, 0.7}
                                          : Rgb{0.3, 0.42, 0.28};
            canvas.rectangle(left, base - high, left + wide, base, goods * (0.7 + 0.35 * hash_unit(i, s, seed + 3)));
        }
    }
    for (int i = 0; i < 4; ++i)
        canvas.disc(0.14 + 0.24 * i, 0.07, 0.045, 0.02, {0.98, 0.94, 0.82});
}

void door(PatternCanvas& canvas)
{
    canvas.each([](double u, double v, const Rgb&) { return gray(0.9 + 0.08 * (noise(u, v * 0.2, 64, 3) - 0.5)); });
    for (double left : {0.12, 0.54})
        for (const auto& [top, low] : {std::pair{0.08, 0.4}, {0.47, 0.68}, {0.74, 0.93}}) {
            canvas.rectangle(left, top, left + 0.34, low, gray(0.58));
            canvas.rectangle(left + 0.025, top + 0.02, left + 0.34, low, gray(1.0));
            canvas.rectangle(left + 0.025, top + 0.02, left + 0.315, low - 0.014, gray(0.82));
        }
    canvas.rectangle(0, 0, 0.03, 1, gray(0.55));
    canvas.rectangle(0.97, 0, 1, 1, gray(0.55));
    canvas.disc(0.88, 0.55, 0.035, 0.02, {0.75, 0.68, 0.45});
}

void glass_door(PatternCanvas& canvas)
{
    canvas.rectangle(0, 0, 1, 1, gray(0.85));
    for (double left : {0.07, 0.53}) {
        canvas.each([&](double u, double v, const Rgb& was) {
            return u > left && u < left + 0.4 && v > 0.05 && v < 0.9
                       ? Rgb{0.2, 0.22, 0.24} * (0.7 + 0.6 * v + 0.3 * cloud_noise(u, v, 3, 6))
                       : was;
        });
        canvas.rectangle(left < 0.3 ? 0.43 : 0.55, 0.4, left < 0.3 ? 0.45 : 0.57, 0.62, gray(0.8));
    }
}

void slats(PatternCanvas& canvas, int count, double dark)
{
    canvas.each([&](double u, double v, const Rgb&) {
        const double f = v * count - std::floor(v * count);
        return gray((0.94 - 0.16 * f + 0.05 * (noise(u, v, 16, 2) - 0.5)) * (f > 0.86 ? dark : 1));
    });
}

} // namespace

void opening(PatternCanvas& canvas, Pattern pattern)
{
    switch (pattern) {
    case Pattern::pane_dark:
        return room(canvas, {0.17, 0.19, 0.21}, 1);
    case Pattern::pane_curtain:
        return curtain(canvas);
    case Pattern::pane_blind:
        return blind(canvas);
    case Pattern::pane_lit:
        return room(canvas, {0.5, 0.44, 0.35}, 9);
    case Pattern::office_glass:
        return office(canvas);
    case Pattern::shop_window:
        return shop(canvas, 4, {0.5, 0.46, 0.4}, 3);
    case Pattern::shop_window_2:
        return shop(canvas, 17, {0.36, 0.37, 0.38}, 2);
    case Pattern::door:
        return door(canvas);
    case Pattern::glass_door:
        return glass_door(canvas);
    case Pattern::garage_door:
        return slats(canvas, 7, 0.55);
    case Pattern::shutter:
        return slats(canvas, 12, 0.5);
    default: // awning: stripes
        return canvas.each([](double u, double v, const Rgb&) {
            return (u * 2 - std::floor(u * 2) < 0.5 ? gray(1.0) : Rgb{2.0, 2.0, 2.0}) *
                   (0.92 + 0.08 * (noise(u, v, 8, 3) - 0.5));
        });
    }
}

} // namespace semrover::paint
