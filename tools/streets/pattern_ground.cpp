// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/streets/pattern_canvas.h"

#include <algorithm>
#include <cmath>

namespace semrover::paint {

namespace {

// how much of a crack runs here: where two levels of smooth noise are equal
double crack(double u, double v, int cells, uint32_t seed, double width)
{
    const double n = cloud_noise(u, v, cells, seed) - 0.5;
    return 1 - smooth_step(0, width, std::abs(n));
}

void asphalt(PatternCanvas& canvas)
{
    canvas.each([](double u, double v, const Rgb&) {
        const double stone = hash_unit(int(u * 512), int(v * 512), 11) - 0.5;
        double value = 0.44 + 0.05 * (cloud_noise(u, v, 4, 1) - 0.5) + 0.035 * (cloud_noise(u, v, 40, 2) - 0.5);
        value += 0.07 * stone * (0.6 + hash_unit(int(u * 256), int(v * 256), 12));
        if (u > 0.12 && u < 0.31 && v > 0.55 && v < 0.83) // a patch, newer and darker, with a seam of tar
            value -= 0.02 + (u < 0.126 || u > 0.304 || v < 0.556 || v > 0.824 ? 0.04 : 0);
        const double open = smooth_step(0.52, 0.62, noise(u, v, 3, 5)); // cracks only here and there
        value -= 0.07 * crack(u, v, 3, 21, 0.005) * open;
        return Rgb{value * 1.0, value * 0.995, value * 0.985};
    });
}

void slabs(PatternCanvas& canvas, int columns, int rows, bool shifted, double joint, double variation)
{
    canvas.each([&](double u, double v, const Rgb&) {
        const int row = int(v * rows);
        const double x = u * columns + (shifted && row % 2 ? 0.5 : 0), fx = x - std::floor(x), fy = v * rows - row;
        const int column = int(std::floor(x)) % columns;
        double value = 0.9 + variation * (hash_unit(column, row, 3) - 0.5) + 0.06 * (cloud_noise(u, v, 8, 9) - 0.5);
        value += 0.05 * (hash_unit(int(u * 256), int(v * 256), 14) - 0.5);
        value -= 0.12 * smooth_step(0.6, 0.75, cloud_noise(u, v, 3, 31)); // stains
        const double edge = std::min({fx, 1 - fx, (fy * columns) / rows, (1 - fy) * columns / rows});
        const double seam = 1 - smooth_step(joint * 0.5, joint * 1.2, edge);
        return blend(gray(value), Rgb{0.52, 0.5, 0.46}, seam * 0.85);
    });
}

void grass(PatternCanvas& canvas)
{
    canvas.each([](double u, double v, const Rgb&) {
        const double blades = noise(u + 0.02 * noise(u, v, 16, 3), v, 96, 4), broad = cloud_noise(u, v, 4, 8);
        const Rgb dry{0.52, 0.5, 0.3}, lush{0.3, 0.42, 0.17};
        return blend(lush, dry, 0.55 * smooth_step(0.45, 0.75, broad)) *
               (0.66 + 0.42 * blades + 0.22 * (hash_unit(int(u * 256), int(v * 256), 6) - 0.5));
    });
}

} // namespace

void ground(PatternCanvas& canvas, Pattern pattern)
{
    switch (pattern) {
    case Pattern::asphalt:
        return asphalt(canvas);
    case Pattern::slabs:
        return slabs(canvas, 4, 8, true, 0.035, 0.11);
    case Pattern::setts:
        return slabs(canvas, 10, 12, true, 0.1, 0.22);
    case Pattern::grass:
        return grass(canvas);
    case Pattern::kerb:
        return canvas.each([](double u, double v, const Rgb&) {
            const double joint = u < 0.012 || std::abs(u - 0.5) < 0.006 ? 0.18 : 0;
            return gray(0.64 + 0.08 * (cloud_noise(u, v, 8, 2) - 0.5) - joint);
        });
    case Pattern::road_paint:
        return canvas.each([](double u, double v, const Rgb&) {
            const double worn = smooth_step(0.56, 0.7, cloud_noise(u, v, 6, 6));
            return blend(gray(0.86 + 0.05 * (noise(u, v, 32, 1) - 0.5)), gray(0.55), 0.4 * worn);
        });
    case Pattern::earth:
        return canvas.each([](double u, double v, const Rgb&) {
            return Rgb{0.42, 0.35, 0.27} * (0.75 + 0.5 * cloud_noise(u, v, 12, 3));
        });
    default:
        return canvas.each([](double u, double v, const Rgb&) {
            return gray(0.72 + 0.3 * (hash_unit(int(u * 128), int(v * 128), 2) - 0.5) +
                        0.12 * (cloud_noise(u, v, 4, 3) - 0.5));
        });
    }
}

} // namespace semrover::paint
