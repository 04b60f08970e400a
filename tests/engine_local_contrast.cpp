// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/dtype.h"
#include "tools/eval/point_scores.h"

#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <random>

namespace semrover {
namespace engine_local_contrast_test {

using Vec = std::array<double, 3>;

constexpr uint8_t kBuilding = 2, kCar = 13, kLane = 19;

// from the definition: every cut of the order along the covariance, means of both sides
double naive_step(const std::vector<Vec>& at, const std::vector<double>& y)
{
    const size_t n = at.size();
    double mean = 0;
    Vec middle{}, u{};
    for (size_t i = 0; i < n; ++i) {
        mean += y[i] / double(n);
        for (size_t a = 0; a < 3; ++a)
            middle[a] += at[i][a] / double(n);
    }
    for (size_t i = 0; i < n; ++i)
        for (size_t a = 0; a < 3; ++a)
            u[a] += (y[i] - mean) * (at[i][a] - middle[a]);
    std::vector<double> along(n);
    for (size_t i = 0; i < n; ++i)
        along[i] = u[0] * at[i][0] + u[1] * at[i][1] + u[2] * at[i][2];
    double best = 0;
    for (const double cut : along) {
        double low = 0, high = 0, lows = 0, highs = 0;
        for (size_t i = 0; i < n; ++i) {
            (along[i] < cut ? low : high) += y[i];
            (along[i] < cut ? lows : highs) += 1;
        }
        if (lows >= 2 && highs >= 2)
            best = std::max(best, lows / double(n) * std::pow(low / lows - mean, 2) +
                                      highs / double(n) * std::pow(high / highs - mean, 2));
    }
    return best;
}

TEST(EngineLocalContrast, the_best_step_is_that_of_all_cuts)
{
    EXPECT_DOUBLE_EQ(
        best_step(std::vector<Vec>{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}}, std::vector<double>{0, 0, 1, 1}),
        0.25); // all of the variance
    EXPECT_DOUBLE_EQ(best_step(std::vector<Vec>{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}},
                               std::vector<double>{0, 1. / 3, 2. / 3, 1}),
                     1. / 9); // means 1/6 and 5/6: 0.8 of the variance 5/36
    EXPECT_EQ(best_step(std::vector<Vec>(8, Vec{1, 2, 3}), std::vector<double>{0, 1, 0, 1, 0, 1, 0, 1}), 0);
    EXPECT_EQ(best_step(std::vector<Vec>{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}, std::vector<double>{0, 0, 1}), 0);
    std::mt19937 random(1);
    for (size_t n = 4; n < 40; ++n) {
        std::vector<Vec> at(n);
        std::vector<double> y(n);
        for (size_t i = 0; i < n; ++i) {
            for (double& x : at[i])
                x = double(random() % 1000) / 1000;
            y[i] = double(random() % 256) / 255;
        }
        EXPECT_NEAR(best_step(at, y), naive_step(at, y), 1e-12) << n;
    }
}

struct Sample {
    Vec at;
    double brightness;
    uint8_t label;
};

std::vector<Sample> samples_of(const VoxelGrid& grid, std::span<const uint8_t> used)
{
    std::vector<Sample> samples;
    const auto n = size_t(grid.points_per_voxel);
    for (size_t i = 0; i < grid.points.size() / 3; ++i) {
        if (!used[i / n])
            continue;
        const uint8_t* c = &grid.colors[3 * i];
        Sample s{{}, (0.299 * c[0] + 0.587 * c[1] + 0.114 * c[2]) / 255, grid.labels[i / n]};
        for (size_t a = 0; a < 3; ++a)
            s.at[a] = (grid.cells[i / n][a] + 0.5) * double(grid.voxel_size) + half_to_float(grid.points[3 * i + a]);
        samples.push_back(s);
    }
    return samples;
}

VoxelGrid random_grid(uint32_t seed)
{
    std::mt19937 random(seed);
    VoxelGrid grid;
    grid.voxel_size = 0.6f;
    grid.points_per_voxel = 9;
    for (int i = 0; i < 5; ++i)
        for (int j = 0; j < 5; ++j)
            grid.cells.push_back({i, j, int32_t(random() % 2)});
    std::ranges::sort(grid.cells);
    for (size_t cell = 0; cell < grid.cells.size(); ++cell)
        grid.labels.push_back(uint8_t(random() % 2));
    grid.generated.assign(grid.cells.size(), 1);
    for (size_t i = 0; i < grid.cells.size() * 27; ++i) {
        grid.points.push_back(float_to_half(0.6f * (float(random() % 1000) / 1000 - 0.5f)));
        grid.colors.push_back(uint8_t(random()));
    }
    return grid;
}

TEST(EngineLocalContrast, sums_match_all_points_one_by_one)
{
    const VoxelGrid grid = random_grid(1);
    std::vector<uint8_t> used(grid.cells.size(), 1);
    used[7] = 0;
    const std::vector<Sample> samples = samples_of(grid, used);
    for (const double radius : {0.2, 0.3, 0.601, 1.7}) {
        SCOPED_TRACE(radius);
        const auto sums = local_contrast(grid, used, {.radius = radius, .strong_step = 0.4});
        for (uint8_t label = 0; label < 2; ++label) {
            ContrastSums expect;
            for (const Sample& a : samples) {
                std::vector<Vec> at;
                std::vector<double> y;
                for (const Sample& b : samples) {
                    const double d = std::hypot(a.at[0] - b.at[0], a.at[1] - b.at[1], a.at[2] - b.at[2]);
                    if (a.label != label || b.label != label || d > radius)
                        continue;
                    at.push_back(b.at);
                    y.push_back(b.brightness);
                    expect.pairs += &a != &b;
                    expect.squares += std::pow(a.brightness - b.brightness, 2);
                    expect.strong += std::abs(a.brightness - b.brightness) > 0.4;
                }
                if (at.size() >= 6) {
                    ++expect.neighborhoods;
                    expect.steps += naive_step(at, y);
                }
            }
            EXPECT_EQ(sums[label].pairs, expect.pairs);
            EXPECT_EQ(sums[label].strong, expect.strong);
            EXPECT_EQ(sums[label].neighborhoods, expect.neighborhoods);
            EXPECT_NEAR(sums[label].squares, expect.squares, 1e-9);
            EXPECT_NEAR(sums[label].steps, expect.steps, 1e-9);
        }
    }
}

// ---- what ranks above what, on the buildings, markings and cars of the shipped street

VoxelGrid street_of(std::initializer_list<uint8_t> labels)
{
    auto grid = read_grid(SEMROVER_SOURCE_DIR "/assets/scenes/street.truth.sgrid");
    EXPECT_TRUE(grid);
    VoxelGrid part;
    part.voxel_size = grid->voxel_size;
    part.points_per_voxel = grid->points_per_voxel;
    for (size_t i = 0; i < grid->cells.size(); ++i)
        if (std::ranges::find(labels, grid->labels[i]) != labels.end())
            append_cell(part, *grid, i);
    return part;
}

std::array<ContrastSums, kClassCount> contrast_of(const VoxelGrid& grid)
{
    return local_contrast(grid, std::vector<uint8_t>(grid.cells.size(), 1));
}

VoxelGrid shuffled_in_cells(VoxelGrid grid)
{
    std::mt19937 random(3);
    const auto n = size_t(grid.points_per_voxel);
    for (size_t cell = 0; cell < grid.cells.size(); ++cell)
        for (size_t i = n; i > 1; --i) {
            const size_t j = random() % i;
            std::swap_ranges(&grid.colors[3 * (cell * n + i - 1)], &grid.colors[3 * (cell * n + i - 1)] + 3,
                             &grid.colors[3 * (cell * n + j)]);
        }
    return grid;
}

// colours become the Gaussian mean of those of the class around, up to a voxel away
VoxelGrid blurred(const VoxelGrid& grid, double sigma)
{
    VoxelGrid out = grid;
    const std::vector<uint8_t> all(grid.cells.size(), 1);
    const std::vector<Sample> samples = samples_of(grid, all);
    const auto n = size_t(grid.points_per_voxel);
    for (size_t cell = 0; cell < grid.cells.size(); ++cell) {
        std::vector<size_t> near; // points
        const Cell& c = grid.cells[cell];
        for (int i = 0; i < 27; ++i)
            if (const auto other = find_cell(grid, {c[0] + i / 9 - 1, c[1] + i / 3 % 3 - 1, c[2] + i % 3 - 1});
                other && grid.labels[*other] == grid.labels[cell])
                for (size_t k = 0; k < n; ++k)
                    near.push_back(*other * n + k);
        for (size_t i = cell * n; i < (cell + 1) * n; ++i) {
            double sum[3] = {}, weights = 0;
            for (const size_t j : near) {
                double d2 = 0;
                for (size_t a = 0; a < 3; ++a)
                    d2 += std::pow(samples[i].at[a] - samples[j].at[a], 2);
                const double w = std::exp(-d2 / (2 * sigma * sigma));
                weights += w;
                for (size_t a = 0; a < 3; ++a)
                    sum[a] += w * grid.colors[3 * j + a];
            }
            for (size_t a = 0; a < 3; ++a)
                out.colors[3 * i + a] = uint8_t(std::lround(sum[a] / weights));
        }
    }
    return out;
}

VoxelGrid flat_cells(VoxelGrid grid)
{
    const auto n = size_t(grid.points_per_voxel);
    for (size_t cell = 0; cell < grid.cells.size(); ++cell)
        for (size_t a = 0; a < 3; ++a) {
            size_t sum = 0;
            for (size_t i = cell * n; i < (cell + 1) * n; ++i)
                sum += grid.colors[3 * i + a];
            for (size_t i = cell * n; i < (cell + 1) * n; ++i)
                grid.colors[3 * i + a] = uint8_t(sum / n);
        }
    return grid;
}

VoxelGrid with_noise(VoxelGrid grid, double sigma)
{
    std::mt19937 random(5);
    std::normal_distribution<double> normal(0, sigma);
    for (size_t i = 0; i < grid.colors.size(); i += 3) {
        const double change = normal(random);
        for (size_t a = 0; a < 3; ++a)
            grid.colors[i + a] = uint8_t(std::clamp(grid.colors[i + a] + change, 0.0, 255.0));
    }
    return grid;
}

TEST(EngineLocalContrast, sharpness_ranks_truth_over_blur_over_more_blur)
{
    const VoxelGrid truth = street_of({kBuilding, kCar, kLane});
    const auto sharp = contrast_of(truth);
    const auto slightly = contrast_of(blurred(truth, 0.06)), strongly = contrast_of(blurred(truth, 0.15));
    const auto hardly = contrast_of(blurred(truth, 0.03));
    for (const uint8_t label : {kBuilding, kCar, kLane}) {
        SCOPED_TRACE(kPalette[label].name);
        EXPECT_GT(sharp[label].sharpness(), hardly[label].sharpness());
        EXPECT_GT(hardly[label].sharpness(), slightly[label].sharpness());
        EXPECT_GT(sharp[label].sharpness(), 1.1 * slightly[label].sharpness());
        EXPECT_GT(slightly[label].sharpness(), 1.5 * strongly[label].sharpness());
        EXPECT_GT(sharp[label].edges(), strongly[label].edges());
        EXPECT_GT(sharp[label].contrast(), 2 * strongly[label].contrast());
    }
}

TEST(EngineLocalContrast, sharpness_ranks_truth_over_colors_that_are_out_of_order_noisy_or_flat)
{
    const VoxelGrid truth = street_of({kBuilding, kCar, kLane});
    const auto sharp = contrast_of(truth), shuffled = contrast_of(shuffled_in_cells(truth));
    const auto flat = contrast_of(flat_cells(truth)), noisy = contrast_of(with_noise(blurred(truth, 0.2), 40));
    for (const uint8_t label : {kBuilding, kCar, kLane}) {
        SCOPED_TRACE(kPalette[label].name);
        EXPECT_GT(sharp[label].sharpness(), 1.5 * shuffled[label].sharpness());
        EXPECT_GT(sharp[label].sharpness(), 1.5 * flat[label].sharpness());
        EXPECT_GT(sharp[label].sharpness(), 1.5 * noisy[label].sharpness());
        // contrast alone does not tell order from disorder: that is what the step is for
        EXPECT_GT(shuffled[label].contrast(), sharp[label].contrast());
    }
    // 12 shuffles of the 42 voxels of markings gave squares of 0 to 0.12 of the truth's, 0.02 in the mean
    EXPECT_LT(shuffled[kLane].sharpness(), 0.5 * sharp[kLane].sharpness());
}

TEST(EngineLocalContrast, noise_alone_is_not_sharp)
{
    VoxelGrid grid = street_of({kBuilding});
    std::ranges::fill(grid.colors, uint8_t(128));
    EXPECT_EQ(contrast_of(grid)[kBuilding].sharpness(), 0);
    const auto noisy = contrast_of(with_noise(grid, 60))[kBuilding];
    EXPECT_GT(noisy.contrast(), 0.2);
    EXPECT_LT(noisy.sharpness(), 0.1 * noisy.contrast()); // what is left of 36860 draws
}

TEST(EngineLocalContrast, order_of_points_and_place_of_the_grid_change_nothing)
{
    const VoxelGrid grid = street_of({kLane, kCar});
    VoxelGrid other = grid;
    const auto n = size_t(grid.points_per_voxel);
    for (size_t i = 0; i < grid.points.size() / 3; ++i) { // backwards within each voxel
        const size_t from = i / n * n + (n - 1 - i % n);
        for (size_t a = 0; a < 3; ++a) {
            other.points[3 * i + a] = grid.points[3 * from + a];
            other.colors[3 * i + a] = grid.colors[3 * from + a];
        }
    }
    for (Cell& cell : other.cells)
        cell = {cell[0] + 1000, cell[1] - 77, cell[2] + 3};
    const auto a = contrast_of(grid), b = contrast_of(other);
    for (const uint8_t label : {kCar, kLane}) {
        EXPECT_EQ(a[label].sharpness(), b[label].sharpness());
        EXPECT_EQ(a[label].contrast(), b[label].contrast());
        EXPECT_EQ(a[label].edges(), b[label].edges());
        EXPECT_GT(a[label].neighborhoods, 0u);
    }
}

} // namespace engine_local_contrast_test
} // namespace semrover
