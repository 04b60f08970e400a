// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/streets/pattern_canvas.h"

#include <algorithm>
#include <cmath>

namespace semrover::paint {

namespace {

constexpr Rgb kRed{0.72, 0.1, 0.1}, kBlue{0.08, 0.27, 0.58}, kWhite{0.9, 0.9, 0.89}, kBlack{0.08, 0.08, 0.08};

void lamp(PatternCanvas& canvas, const Rgb& color)
{
    canvas.each([&](double u, double v, const Rgb&) {
        const double r = 2 * std::sqrt((u - 0.5) * (u - 0.5) + (v - 0.45) * (v - 0.45));
        return color * (1.1 - 0.5 * r + 0.1 * noise(u, v, 16, 2));
    });
}

// three corners up to down: the border, then the field
void triangle(PatternCanvas& canvas, bool down, double margin, const Rgb& color)
{
    canvas.each([&](double u, double v, const Rgb& was) {
        const double y = down ? 1 - v : v, from_base = 1 - margin - y, half = (y - 2 * margin) / 2;
        return from_base > 0 && std::abs(u - 0.5) < half ? color : was;
    });
}

// a person who walks over stripes
void crossing(PatternCanvas& canvas)
{
    canvas.rectangle(0, 0, 1, 1, kBlue);
    triangle(canvas, false, 0.1, kWhite);
    canvas.disc(0.5, 0.42, 0.045, 0.045, kBlack);
    canvas.line(0.5, 0.48, 0.48, 0.64, 0.06, kBlack);
    canvas.line(0.48, 0.64, 0.41, 0.8, 0.04, kBlack);
    canvas.line(0.48, 0.64, 0.57, 0.79, 0.04, kBlack);
    canvas.line(0.5, 0.52, 0.59, 0.61, 0.035, kBlack);
    canvas.line(0.5, 0.52, 0.41, 0.61, 0.035, kBlack);
    for (double u : {0.3, 0.42, 0.54, 0.66})
        canvas.rectangle(u, 0.82, u + 0.06, 0.87, kBlack);
}

void poster(PatternCanvas& canvas, uint32_t seed, const Rgb& sky, const Rgb& land)
{
    canvas.each([&](double u, double v, const Rgb&) {
        const double ridge = 0.45 + 0.3 * (cloud_noise(u, 0.3, 3, seed) - 0.5);
        return v < ridge ? blend(sky, {0.95, 0.92, 0.86}, v) : land * (0.7 + 0.6 * cloud_noise(u, v, 4, seed + 3));
    });
    canvas.disc(0.66, 0.28, 0.12, 0.12, {0.95, 0.85, 0.6});
    canvas.letters(0.1, 0.66, 0.9, 0.76, 8, seed, {0.96, 0.95, 0.92});
    canvas.letters(0.1, 0.82, 0.7, 0.87, 12, seed + 1, {0.9, 0.9, 0.86});
    canvas.rectangle(0, 0, 0.03, 1, gray(0.2));
    canvas.rectangle(0.97, 0, 1, 1, gray(0.2));
}

void shop_sign(PatternCanvas& canvas, uint32_t seed, int letters, double left, bool dark)
{
    const Rgb text = dark ? gray(0.12) : Rgb{3, 3, 2.8}; // brighter than any tint
    canvas.each([&](double u, double v, const Rgb&) { return gray(0.93 + 0.08 * (cloud_noise(u, v, 4, seed) - 0.5)); });
    canvas.rectangle(0, 0, 1, 0.05, gray(0.6));
    canvas.rectangle(0, 0.95, 1, 1, gray(0.5));
    canvas.letters(left, 0.24, left + 0.62, 0.78, letters, seed, text);
}

} // namespace

void sign(PatternCanvas& canvas, Pattern pattern)
{
    switch (pattern) {
    case Pattern::sign_stop:
        canvas.rectangle(0, 0, 1, 1, kRed);
        return canvas.sign_text("STOP", 0.1, 0.36, 0.93, 0.64, kWhite);
    case Pattern::sign_yield:
        canvas.rectangle(0, 0, 1, 1, kRed);
        return triangle(canvas, true, 0.14, kWhite);
    case Pattern::sign_speed:
        canvas.rectangle(0, 0, 1, 1, kRed);
        canvas.disc(0.5, 0.5, 0.38, 0.38, kWhite);
        return canvas.sign_text("30", 0.24, 0.34, 0.76, 0.66, kBlack);
    case Pattern::sign_no_entry:
        canvas.rectangle(0, 0, 1, 1, kRed);
        return canvas.rectangle(0.16, 0.41, 0.84, 0.59, kWhite);
    case Pattern::sign_parking:
        canvas.rectangle(0, 0, 1, 1, kBlue);
        return canvas.sign_text("P", 0.28, 0.2, 0.82, 0.8, kWhite);
    case Pattern::sign_crossing:
        return crossing(canvas);
    case Pattern::sign_priority:
        canvas.rectangle(0, 0, 1, 1, kWhite);
        return canvas.rectangle(0.18, 0.18, 0.82, 0.82, {0.88, 0.68, 0.12});
    case Pattern::street_name:
        canvas.rectangle(0, 0, 1, 1, {0.1, 0.22, 0.45});
        return canvas.letters(0.08, 0.28, 0.94, 0.74, 9, 77, kWhite);
    case Pattern::lamp_red:
        return lamp(canvas, {0.9, 0.12, 0.1});
    case Pattern::lamp_amber:
        return lamp(canvas, {0.35, 0.24, 0.06});
    case Pattern::lamp_green:
        return lamp(canvas, {0.06, 0.3, 0.2});
    case Pattern::shop_sign:
        return shop_sign(canvas, 31, 7, 0.19, false);
    case Pattern::shop_sign_2:
        return shop_sign(canvas, 47, 9, 0.1, false);
    case Pattern::shop_sign_3:
        return shop_sign(canvas, 59, 6, 0.3, true);
    case Pattern::poster:
        return poster(canvas, 5, {0.35, 0.55, 0.75}, {0.3, 0.42, 0.25});
    default:
        return poster(canvas, 12, {0.75, 0.5, 0.35}, {0.35, 0.3, 0.4});
    }
}

} // namespace semrover::paint
