// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/streets/pattern_canvas.h"

#include <algorithm>
#include <cmath>

namespace semrover::paint {

namespace {

// many leaves over each other: voxels of a noise, each with a tone of its own, dark where they part
void leaves(PatternCanvas& canvas, int cells, double depth)
{
    canvas.each([&](double u, double v, const Rgb&) {
        const auto [near, next] = cell_noise(u, v, cells, 3);
        const auto [near_2, next_2] = cell_noise(u + 0.31, v + 0.17, cells / 2, 9);
        const double edge = smooth_step(0.02, 0.3, next - near) * (0.6 + 0.4 * smooth_step(0.0, 0.3, next_2 - near_2));
        const double tone = noise(u, v, cells, 5), clump = cloud_noise(u, v, 4, 7);
        const double value = (1 - depth) + depth * edge;
        const Rgb young{1.0, 1.0, 0.72}, old{0.74, 0.86, 0.66};
        return blend(old, young, tone) * (value * (0.62 + 0.66 * clump));
    });
}

void bark(PatternCanvas& canvas)
{
    canvas.each([](double u, double v, const Rgb&) {
        const double ridge = noise(u + 0.05 * noise(u, v, 4, 2), v * 0.3, 24, 6);
        return gray(0.62 + 0.42 * (ridge - 0.35) + 0.2 * (cloud_noise(u, v, 6, 4) - 0.5));
    });
}

} // namespace

void plant(PatternCanvas& canvas, Pattern pattern)
{
    switch (pattern) {
    case Pattern::leaves:
        return leaves(canvas, 14, 0.55);
    case Pattern::hedge:
        return leaves(canvas, 26, 0.72);
    default:
        return bark(canvas);
    }
}

} // namespace semrover::paint
