// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/streets/pattern_canvas.h"

#include <algorithm>
#include <cmath>

namespace semrover::paint {

namespace {

// the flank of a car from bumper to bumper, front to the left, sill to belt: seams of doors, handles, a moulding
void car_side(PatternCanvas& canvas)
{
    canvas.each([](double u, double v, const Rgb&) {
        return gray(0.96 + 0.05 * (noise(u, v, 4, 2) - 0.5) - 0.1 * smooth_step(0.75, 1.0, v)); // road dirt
    });
    for (double u : {0.295, 0.515, 0.715})
        canvas.line(u, 0.0, u + (u > 0.7 ? -0.03 : 0.0), 0.86, 0.006, gray(0.25));
    canvas.line(0.295, 0.86, 0.69, 0.86, 0.006, gray(0.3));
    for (double u : {0.46, 0.655}) {
        canvas.rectangle(u, 0.14, u + 0.045, 0.18, gray(0.6));
        canvas.rectangle(u, 0.175, u + 0.045, 0.19, gray(0.35));
    }
    canvas.line(0.1, 0.3, 0.95, 0.27, 0.005, gray(0.78));
    canvas.rectangle(0, 0.92, 1, 1, gray(0.22));
}

void rim(PatternCanvas& canvas)
{
    canvas.rectangle(0, 0, 1, 1, gray(0.09));
    canvas.disc(0.5, 0.5, 0.49, 0.49, gray(0.62));
    canvas.disc(0.5, 0.5, 0.43, 0.43, gray(0.13));
    for (int i = 0; i < 5; ++i) {
        const double t = 6.2831853 * i / 5 + 0.3;
        canvas.line(0.5, 0.5, 0.5 + 0.43 * std::cos(t), 0.5 + 0.43 * std::sin(t), 0.11, gray(0.68));
    }
    canvas.disc(0.5, 0.5, 0.1, 0.1, gray(0.5));
}

// a row of big windows with posts, doors to the ground, a skirt; the front to the left
void coach_side(PatternCanvas& canvas, int windows, int doors, double top, double low)
{
    canvas.each(
        [](double u, double v, const Rgb&) { return gray(0.97 - 0.12 * smooth_step(0.8, 1, v) * noise(u, v, 8, 1)); });
    canvas.rectangle(0, 0.9, 1, 1, gray(0.3));
    canvas.rectangle(0, low + 0.05, 1, low + 0.075, gray(0.62));
    canvas.rectangle(0.0, top - 0.02, 1, low + 0.02, gray(0.13));
    const auto glass = [](double u, double v, uint32_t seed) {
        return Rgb{0.2, 0.23, 0.26} * (0.75 + 0.4 * v + 0.35 * cloud_noise(u, v, 4, seed));
    };
    for (int i = 0; i < windows; ++i) {
        const double left = (i + 0.06) / windows, right = (i + 0.94) / windows;
        canvas.each([&](double u, double v, const Rgb& was) {
            return u > left && u < right && v > top && v < low ? glass(u, v, 3) : was;
        });
    }
    for (int d = 0; d < doors; ++d) {
        const double left = (d * (windows / doors) + 0.04) / windows, right = left + 0.88 / windows;
        canvas.rectangle(left, top - 0.02, right, 0.93, gray(0.16));
        canvas.each([&](double u, double v, const Rgb& was) {
            const double half = (u - left) / (right - left);
            const bool pane = (half > 0.06 && half < 0.47) || (half > 0.53 && half < 0.94);
            return u > left && u < right && pane && v > top && v < 0.88 ? glass(u, v, 8) : was;
        });
    }
}

void grille(PatternCanvas& canvas)
{
    canvas.each([](double, double v, const Rgb&) { return gray(v * 7 - std::floor(v * 7) < 0.4 ? 0.3 : 0.1); });
}

void plate(PatternCanvas& canvas)
{
    canvas.rectangle(0, 0, 1, 1, gray(0.86));
    canvas.letters(0.12, 0.25, 0.95, 0.78, 6, 5, gray(0.1));
}

} // namespace

void vehicle(PatternCanvas& canvas, Pattern pattern)
{
    const auto flat = [&](const Rgb& color, double change, uint32_t seed) {
        canvas.each(
            [&](double u, double v, const Rgb&) { return color * (1 + change * (cloud_noise(u, v, 4, seed) - 0.5)); });
    };
    switch (pattern) {
    case Pattern::car_paint:
        return flat(gray(0.97), 0.03, 2);
    case Pattern::car_side:
        return car_side(canvas);
    case Pattern::car_glass:
        return flat({0.1, 0.115, 0.125}, 0.5, 3);
    case Pattern::rubber:
        return flat(gray(0.13), 0.4, 4);
    case Pattern::rim:
        return rim(canvas);
    case Pattern::headlight:
        flat({0.72, 0.75, 0.78}, 0.3, 1);
        canvas.disc(0.35, 0.5, 0.2, 0.3, gray(0.95));
        return canvas.disc(0.75, 0.5, 0.14, 0.25, gray(0.9));
    case Pattern::taillight:
        flat({0.5, 0.06, 0.05}, 0.4, 1);
        return canvas.rectangle(0, 0.62, 1, 0.82, {0.75, 0.62, 0.55});
    case Pattern::grille:
        return grille(canvas);
    case Pattern::plate:
        return plate(canvas);
    case Pattern::bus_side:
        return coach_side(canvas, 7, 2, 0.14, 0.56);
    case Pattern::train_side:
        return coach_side(canvas, 8, 2, 0.16, 0.58);
    case Pattern::cargo:
        return canvas.each([](double u, double v, const Rgb&) {
            const double f = u * 5 - std::floor(u * 5);
            return gray(0.93 + 0.05 * (cloud_noise(u, v * 0.3, 8, 3) - 0.5) - (f < 0.03 ? 0.16 : 0));
        });
    case Pattern::fabric:
        return canvas.each(
            [](double u, double v, const Rgb&) { return gray(0.88 + 0.3 * (cloud_noise(u, v * 0.4, 5, 6) - 0.5)); });
    default:
        return flat(gray(0.95), 0.08, 5);
    }
}

} // namespace semrover::paint
