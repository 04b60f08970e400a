// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/streets/pattern_canvas.h"

#include <algorithm>
#include <cmath>

namespace semrover::paint {

namespace {

// courses of stones: columns x rows, every other course moved by half a stone
void courses(PatternCanvas& canvas, int columns, int rows, double joint, const Rgb& mortar, double variation)
{
    canvas.each([&](double u, double v, const Rgb&) {
        const int row = int(v * rows);
        const double x = u * columns + (row % 2 ? 0.5 : 0), fx = x - std::floor(x), fy = v * rows - row;
        const int column = int(std::floor(x)) % columns;
        const double tone = hash_unit(column, row, 5), warm = hash_unit(column, row, 6) - 0.5;
        double value = 0.92 + variation * (tone - 0.5) + 0.08 * (noise(u, v, 64, 4) - 0.5);
        value -= 0.12 * smooth_step(0.55, 0.8, cloud_noise(u, v, 2, 41));
        const double edge = std::min(std::min(fx, 1 - fx) / columns, std::min(fy, 1 - fy) / rows);
        const Rgb stone = {value * (1 + 0.06 * warm), value, value * (1 - 0.08 * warm)};
        return blend(mortar, stone, smooth_step(joint * 0.4, joint, edge));
    });
}

void plaster(PatternCanvas& canvas)
{
    canvas.each([](double u, double v, const Rgb&) {
        const double streak = cloud_noise(u * 1.0, v * 0.12, 12, 7); // rain runs down
        double value = 0.96 + 0.05 * (cloud_noise(u, v, 3, 2) - 0.5) - 0.07 * smooth_step(0.55, 0.8, streak);
        value += 0.03 * (hash_unit(int(u * 256), int(v * 256), 3) - 0.5);
        return Rgb{value, value * 0.995, value * 0.985};
    });
}

void concrete(PatternCanvas& canvas)
{
    canvas.each([](double u, double v, const Rgb&) {
        double value = 0.86 + 0.1 * (cloud_noise(u, v, 4, 2) - 0.5) + 0.05 * (noise(u, v, 64, 5) - 0.5);
        const double fu = u * 2 - std::floor(u * 2), fv = v * 4 - std::floor(v * 4); // panels of the formwork
        if (std::min(fu, 1 - fu) < 0.008 || std::min(fv, 1 - fv) < 0.016)
            value -= 0.13;
        const double hole_u = fu - 0.5, hole_v = (fv - 0.5) / 2;
        if (std::abs(std::abs(hole_u) - 0.3) < 0.012 && std::abs(hole_v) < 0.012)
            value -= 0.2;
        return Rgb{value, value, value * 0.985};
    });
}

void planks(PatternCanvas& canvas)
{
    canvas.each([](double u, double v, const Rgb&) {
        const double x = u * 12, fx = x - std::floor(x);
        const int board = int(x);
        const double fibre = noise(u + 0.01 * noise(u, v, 8, 2), v * 0.25, 128, 9);
        const double value = 0.8 + 0.16 * (hash_unit(board, 1, 8) - 0.5) + 0.16 * (fibre - 0.5);
        return Rgb{value, value * 0.98, value * 0.95} * (std::min(fx, 1 - fx) < 0.06 ? 0.45 : 1);
    });
}

void tiles(PatternCanvas& canvas, int columns, int rows, bool round)
{
    canvas.each([&](double u, double v, const Rgb&) {
        const int row = int(v * rows);
        const double x = u * columns + (!round && row % 2 ? 0.5 : 0), fx = x - std::floor(x), fy = v * rows - row;
        const double tone = hash_unit(int(std::floor(x)) % columns, row, 4);
        double value = 0.82 + 0.16 * (tone - 0.5) + 0.1 * (cloud_noise(u, v, 4, 6) - 0.5);
        value *= round ? 0.78 + 0.3 * std::sin(3.14159265 * fx) : fx < 0.06 ? 0.7 : 1;
        return gray(value * (fy > 0.85 ? 0.62 : 1));
    });
}

} // namespace

void wall(PatternCanvas& canvas, Pattern pattern)
{
    switch (pattern) {
    case Pattern::brick:
        return courses(canvas, 8, 24, 0.009, {1.02, 1.02, 0.98}, 0.3);
    case Pattern::ashlar:
        return courses(canvas, 4, 6, 0.008, {0.66, 0.64, 0.6}, 0.1);
    case Pattern::plaster:
        return plaster(canvas);
    case Pattern::concrete:
        return concrete(canvas);
    case Pattern::planks:
        return planks(canvas);
    case Pattern::roof_tiles:
        return tiles(canvas, 8, 6, true);
    case Pattern::slate:
        return tiles(canvas, 6, 8, false);
    case Pattern::metal:
        return canvas.each(
            [](double u, double v, const Rgb&) { return gray(0.93 + 0.08 * (cloud_noise(u, v, 4, 2) - 0.5)); });
    default:
        return canvas.each(
            [](double u, double v, const Rgb&) { return gray(0.97 + 0.05 * (cloud_noise(u, v, 4, 8) - 0.5)); });
    }
}

} // namespace semrover::paint
