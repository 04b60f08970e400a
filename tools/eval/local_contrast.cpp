// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/eval/point_scores.h"

#include "runtime/base/dtype.h"
#include "runtime/base/keyed_random.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

struct BrightPoint {
    std::array<double, 3> at; // metres from the centre of the voxel that is looked at
    double brightness;
    uint64_t key; // of its place within its voxel

    auto operator<=>(const BrightPoint&) const = default;
};

double brightness_of(const uint8_t* rgb)
{
    return (0.299 * rgb[0] + 0.587 * rgb[1] + 0.114 * rgb[2]) / 255;
}

void append_points(const VoxelGrid& grid, size_t cell, const std::array<double, 3>& offset,
                   std::vector<BrightPoint>& points)
{
    const auto n = size_t(grid.points_per_voxel);
    for (size_t i = cell * n; i < (cell + 1) * n; ++i) {
        BrightPoint p{{}, brightness_of(&grid.colors[3 * i]), 0};
        for (size_t a = 0; a < 3; ++a) {
            p.at[a] = offset[a] + double(half_to_float(grid.points[3 * i + a]));
            p.key = p.key << 16 | grid.points[3 * i + a];
        }
        points.push_back(p);
    }
}

// all of the class that may lie within `reach` voxels of a voxel's points
void collect(const VoxelGrid& grid, std::span<const uint8_t> used, size_t cell, int reach,
             std::vector<BrightPoint>& points)
{
    points.clear();
    const Cell& c = grid.cells[cell];
    for (int i = -reach; i <= reach; ++i)
        for (int j = -reach; j <= reach; ++j)
            for (int k = -reach; k <= reach; ++k) {
                const std::optional<size_t> other = find_cell(grid, {c[0] + i, c[1] + j, c[2] + k});
                if (!other || !used[*other] || grid.labels[*other] != grid.labels[cell])
                    continue;
                const double size = grid.voxel_size;
                append_points(grid, *other, {i * size, j * size, k * size}, points);
            }
    std::ranges::sort(points);
}

void shuffle(std::vector<double>& values, uint64_t key)
{
    for (size_t i = values.size(); i > 1; --i)
        std::swap(values[i - 1], values[(key = mix64(key + kMixStep)) % i]);
}

struct Neighborhood {
    std::vector<std::array<double, 3>> positions;
    std::vector<double> brightness;
};

void add_neighborhood(Neighborhood& near, uint64_t key, ContrastSums& sums)
{
    if (near.positions.size() < kFewestPoints)
        return;
    ++sums.neighborhoods;
    sums.steps += best_step(near.positions, near.brightness);
    shuffle(near.brightness, key);
    sums.shuffled_steps += best_step(near.positions, near.brightness);
}

void add_point(const BrightPoint& own, std::span<const BrightPoint> around, const ContrastOptions& o,
               Neighborhood& near, ContrastSums& sums)
{
    near.positions.clear();
    near.brightness.clear();
    for (const BrightPoint& p : around) {
        const double d[3] = {p.at[0] - own.at[0], p.at[1] - own.at[1], p.at[2] - own.at[2]};
        if (d[0] * d[0] + d[1] * d[1] + d[2] * d[2] > o.radius * o.radius)
            continue;
        near.positions.push_back(p.at);
        near.brightness.push_back(p.brightness);
        const double difference = std::abs(p.brightness - own.brightness);
        sums.squares += difference * difference;
        sums.strong += difference > o.strong_step;
    }
    sums.pairs += near.positions.size() - 1; // but for the point itself, which adds nothing to the other sums
    add_neighborhood(near, own.key, sums);
}

} // namespace

ContrastSums& ContrastSums::operator+=(const ContrastSums& other)
{
    pairs += other.pairs;
    strong += other.strong;
    squares += other.squares;
    neighborhoods += other.neighborhoods;
    steps += other.steps;
    shuffled_steps += other.shuffled_steps;
    return *this;
}

double ContrastSums::contrast() const
{
    return pairs ? std::sqrt(squares / double(pairs)) : 0;
}

double ContrastSums::edges() const
{
    return pairs ? double(strong) / double(pairs) : 0;
}

double ContrastSums::sharpness() const
{
    return neighborhoods ? std::sqrt(std::max(0.0, steps - shuffled_steps) / double(neighborhoods)) : 0;
}

double best_step(std::span<const std::array<double, 3>> positions, std::span<const double> brightness)
{
    const size_t n = positions.size();
    SR_ASSERT(brightness.size() == n, "{} positions, {} brightnesses", n, brightness.size());
    if (n < 4)
        return 0;
    double mean = 0; // above the first, so that nothing is left of equal ones
    for (const double y : brightness)
        mean += (y - brightness[0]) / double(n);
    std::array<double, 3> direction{};
    for (size_t i = 0; i < n; ++i) // from the first point: the differences sum to 0, so any origin gives the same
        for (size_t a = 0; a < 3; ++a)
            direction[a] += (brightness[i] - brightness[0] - mean) * (positions[i][a] - positions[0][a]);
    thread_local std::vector<std::pair<double, double>> along; // how far, brightness above the mean
    along.clear();
    for (size_t i = 0; i < n; ++i) {
        double far = 0;
        for (size_t a = 0; a < 3; ++a)
            far += direction[a] * (positions[i][a] - positions[0][a]);
        along.emplace_back(far, brightness[i] - brightness[0] - mean);
    }
    std::ranges::sort(along);
    double best = 0, sum = 0; // of the near side
    for (size_t near = 1; near + 1 < n; ++near) {
        sum += along[near - 1].second;
        if (near >= 2 && along[near - 1].first < along[near].first)
            best = std::max(best, sum * sum / (double(near) * double(n - near)));
    }
    return best;
}

std::array<ContrastSums, kClassCount> local_contrast(const VoxelGrid& grid, std::span<const uint8_t> used,
                                                     const ContrastOptions& options)
{
    constexpr double kOutside = 2e-3; // metres that two points may lie outside of their voxels, together
    const double reach = std::ceil((options.radius + kOutside) / double(grid.voxel_size));
    SR_ASSERT(used.size() == grid.cells.size() && grid.has_points(), "{} of {} voxels", used.size(), grid.cells.size());
    SR_ASSERT(options.radius > 0 && options.radius <= kMostReach * double(grid.voxel_size), "a radius of {} m",
              options.radius);
    std::array<ContrastSums, kClassCount> sums;
    std::vector<BrightPoint> around, own;
    Neighborhood near;
    for (size_t cell = 0; cell < grid.cells.size(); ++cell) {
        if (!used[cell])
            continue;
        collect(grid, used, cell, int(reach), around);
        own.clear();
        append_points(grid, cell, {}, own);
        std::ranges::sort(own);
        for (const BrightPoint& p : own)
            add_point(p, around, options, near, sums[grid.labels[cell]]);
    }
    return sums;
}

} // namespace semrover
