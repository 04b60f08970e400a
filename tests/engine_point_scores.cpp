// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "engine/mesh/nearest.h"
#include "tests/support/kernel_case.h"
#include "tests/support/says.h"
#include "tools/eval/point_scores.h"

#include <algorithm>
#include <cmath>

namespace semrover {
namespace engine_point_scores_test {

constexpr uint8_t kRoad = 0, kBuilding = 2, kLane = 19;

struct TruePoint {
    std::array<double, 3> at; // metres
    std::array<double, 3> color;
    uint8_t label;

    double brightness() const { return 0.299 * color[0] + 0.587 * color[1] + 0.114 * color[2]; }
};

double apart(const TruePoint& a, const TruePoint& b)
{
    return std::hypot(a.at[0] - b.at[0], a.at[1] - b.at[1], a.at[2] - b.at[2]);
}

std::vector<TruePoint> points_in(const VoxelGrid& grid, int label = -1)
{
    std::vector<TruePoint> points;
    const auto n = size_t(grid.points_per_voxel);
    for (size_t cell = 0; cell < grid.cells.size(); ++cell) {
        if (!grid.generated[cell] || (label >= 0 && grid.labels[cell] != label))
            continue;
        for (size_t i = cell * n; i < (cell + 1) * n; ++i) {
            TruePoint p{{}, {}, grid.labels[cell]};
            for (size_t a = 0; a < 3; ++a) {
                p.at[a] = (grid.cells[cell][a] + 0.5) * double(grid.voxel_size) + half_to_float(grid.points[3 * i + a]);
                p.color[a] = grid.colors[3 * i + a] / 255.0;
            }
            points.push_back(p);
        }
    }
    return points;
}

// voxels of a slab at random, some of them apart, with points at random
VoxelGrid random_grid(uint32_t seed, int side, int points, int labels)
{
    std::mt19937 random(seed);
    VoxelGrid grid;
    grid.voxel_size = 0.6f;
    grid.points_per_voxel = points;
    for (int i = 0; i < side; ++i)
        for (int j = 0; j < side; ++j)
            if (random() % 4)
                grid.cells.push_back({i - 3, j, int32_t(random() % 2)});
    std::ranges::sort(grid.cells);
    for (size_t cell = 0; cell < grid.cells.size(); ++cell) {
        grid.labels.push_back(uint8_t(random() % uint32_t(labels)));
        grid.generated.push_back(1);
    }
    for (size_t i = 0; i < grid.cells.size() * size_t(points) * 3; ++i) {
        grid.points.push_back(float_to_half(0.6f * (float(random() % 1000) / 1000 - 0.5f)));
        grid.colors.push_back(uint8_t(random()));
    }
    return grid;
}

VoxelGrid with_other_points(VoxelGrid grid, uint32_t seed)
{
    std::mt19937 random(seed);
    for (size_t i = 0; i < grid.points.size(); ++i) {
        grid.points[i] = float_to_half(0.6f * (float(random() % 1000) / 1000 - 0.5f));
        grid.colors[i] = uint8_t(random());
    }
    return grid;
}

double mean_distance(const std::vector<TruePoint>& from, const std::vector<TruePoint>& to)
{
    double sum = 0;
    for (const TruePoint& p : from) {
        double best = 1e9;
        for (const TruePoint& q : to)
            best = std::min(best, apart(p, q));
        sum += best / double(from.size());
    }
    return sum;
}

double color_error(const std::vector<TruePoint>& a, const std::vector<TruePoint>& b)
{
    double error = 0;
    for (size_t c = 0; c < 3; ++c) {
        double difference = 0;
        for (size_t i = 0; i < a.size(); ++i)
            difference += (a[i].color[c] - b[i].color[c]) / double(a.size());
        error += std::abs(difference) / 3;
    }
    return error;
}

TEST(EnginePointScores, colors_and_distances_match_all_points_one_by_one)
{
    for (const auto& [side, n, labels] : {std::tuple{1, 1, 1}, {3, 4, 2}, {9, 20, 3}}) {
        SCOPED_TRACE(fmt::format("{} voxels a side, {} points", side, n));
        VoxelGrid truth = random_grid(3, side, n, labels);
        if (truth.cells.empty())
            continue;
        const VoxelGrid generated = with_other_points(truth, 4);
        const auto scores = score_points(test_device(), generated, truth);
        ASSERT_TRUE(scores) << scores.error().message;
        for (int label = -1; label < labels; ++label) {
            const auto a = points_in(generated, label), b = points_in(truth, label);
            const ClassScores& s = label < 0 ? scores->all : scores->classes[size_t(label)];
            ASSERT_EQ(s.points, a.size());
            if (a.empty())
                continue;
            EXPECT_NEAR(s.color_error(), color_error(a, b), 1e-12);
            EXPECT_NEAR(s.chamfer(), (mean_distance(a, b) + mean_distance(b, a)) / 2, 1e-6);
            EXPECT_NEAR(s.to_truth / double(s.points), mean_distance(a, b), 1e-6);
            double cells = 0; // each on its own
            for (size_t i = 0; i < a.size(); i += size_t(n))
                cells += color_error({a.begin() + long(i), a.begin() + long(i) + n},
                                     {b.begin() + long(i), b.begin() + long(i) + n});
            EXPECT_NEAR(s.cell_color_error(), cells / double(s.cells), 1e-12);
        }
    }
}

TEST(EnginePointScores, a_grid_against_itself_has_no_error_and_the_same_sharpness)
{
    const VoxelGrid grid = random_grid(5, 6, 20, 4);
    const auto scores = score_points(test_device(), grid, grid);
    ASSERT_TRUE(scores) << scores.error().message;
    EXPECT_EQ(scores->all.color_error(), 0);
    EXPECT_EQ(scores->all.cell_color_error(), 0);
    EXPECT_EQ(scores->all.chamfer(), 0);
    EXPECT_EQ(scores->left_out, 0u);
    for (const ClassScores& s : scores->classes) {
        EXPECT_EQ(s.generated_contrast.sharpness(), s.truth_contrast.sharpness());
        EXPECT_EQ(s.generated_contrast.contrast(), s.truth_contrast.contrast());
    }
}

TEST(EnginePointScores, two_cells_by_hand)
{
    VoxelGrid truth;
    truth.voxel_size = 1;
    truth.points_per_voxel = 2;
    truth.cells = {{0, 0, 0}, {9, 0, 0}};
    truth.labels = {kRoad, kLane};
    truth.generated = {1, 1};
    const auto half = [](float v) { return float_to_half(v); };
    truth.points = {half(-0.25f), 0, 0, half(0.25f), 0, 0, 0, 0, 0, 0, 0, half(0.5f)};
    truth.colors = {0, 0, 0, 51, 0, 0, 255, 255, 255, 255, 255, 255};
    VoxelGrid generated = truth;
    generated.points[0] = half(0.25f);       // onto the other: 0.5 m and 0 one way
    generated.colors[0] = 102;               // 0.4 of red in a point of two
    generated.colors[3 * 3 + 2] = 255 - 153; // 0.6 less blue in a point of two
    const auto s = score_points(test_device(), generated, truth);
    ASSERT_TRUE(s) << s.error().message;
    EXPECT_NEAR(s->classes[kRoad].color_error(), 0.2 / 3, 1e-12);
    EXPECT_NEAR(s->classes[kLane].color_error(), 0.3 / 3, 1e-12);
    EXPECT_NEAR(s->all.color_error(), (0.1 + 0.15) / 3, 1e-12);
    EXPECT_NEAR(s->all.cell_color_error(), (0.2 + 0.3) / 6, 1e-12);
    EXPECT_NEAR(s->classes[kRoad].to_truth, 0, 1e-9);
    EXPECT_NEAR(s->classes[kRoad].to_generated, 0.5, 1e-9);
    EXPECT_NEAR(s->classes[kRoad].chamfer(), 0.125, 1e-9);
    EXPECT_EQ(s->classes[kLane].chamfer(), 0);
    EXPECT_NEAR(s->all.chamfer(), 0.5 / 8, 1e-9);
}

TEST(EnginePointScores, cells_that_are_not_generated_are_left_out_and_sums_pool)
{
    VoxelGrid truth = random_grid(7, 5, 8, 3), generated = with_other_points(truth, 8);
    const auto whole = score_points(test_device(), generated, truth);
    generated.generated[2] = 0;
    truth.generated[4] = 0;
    const auto part = score_points(test_device(), generated, truth);
    ASSERT_TRUE(whole && part);
    EXPECT_EQ(part->left_out, 2u);
    EXPECT_EQ(part->all.cells + 2, whole->all.cells);
    EXPECT_LT(part->all.generated_contrast.pairs, whole->all.generated_contrast.pairs);

    // the same grid again, far away, in one grid or in two
    VoxelGrid both_truth = truth, both_generated = generated;
    for (VoxelGrid* grid : {&both_truth, &both_generated}) {
        const VoxelGrid once = *grid;
        for (size_t i = 0; i < once.cells.size(); ++i) {
            append_cell(*grid, once, i);
            grid->cells.back()[0] += 50;
        }
    }
    const auto both = score_points(test_device(), both_generated, both_truth);
    ASSERT_TRUE(both) << both.error().message;
    PointScores pooled = *part;
    pooled += *part;
    EXPECT_EQ(both->left_out, pooled.left_out);
    EXPECT_EQ(both->all.generated_contrast.pairs, pooled.all.generated_contrast.pairs);
    EXPECT_NEAR(both->all.chamfer(), pooled.all.chamfer(), 1e-6);
    EXPECT_NEAR(both->all.color_error(), pooled.all.color_error(), 1e-12);
    for (size_t i = 0; i < 3; ++i)
        EXPECT_NEAR(both->classes[i].generated_contrast.sharpness(), pooled.classes[i].generated_contrast.sharpness(),
                    1e-12);
}

TEST(EnginePointScores, nearest_distances_match_brute_force_near_and_far)
{
    std::mt19937 random(2);
    std::vector<PointRow> points, queries;
    const auto uniform = [&](float size) { return size * (float(random() % 65536) / 65536 - 0.5f); };
    for (size_t i = 0; i < 700; ++i)
        points.push_back({uniform(4), uniform(4), uniform(1), 0});
    for (size_t i = 0; i < 501; ++i) // every third far from all points
        queries.push_back({uniform(4) + (i % 3 ? 0.f : 60.f), uniform(4), uniform(1), 0});
    const auto nearest = nearest_distances(test_device(), queries, points);
    ASSERT_TRUE(nearest) << nearest.error().message;
    for (size_t i = 0; i < queries.size(); ++i) {
        double best = 1e9;
        for (const PointRow& p : points)
            best = std::min(best, std::hypot(double(p[0]) - queries[i][0], double(p[1]) - queries[i][1],
                                             double(p[2]) - queries[i][2]));
        ASSERT_NEAR((*nearest)[i], best, 2e-5) << "query " << i; // fp32 may prefer another that is as near
    }
}

TEST(EnginePointScores, what_cannot_be_compared_says_why)
{
    const VoxelGrid good = random_grid(9, 4, 3, 2);
    const auto score = [](const VoxelGrid& generated, const VoxelGrid& truth, const ContrastOptions& o = {}) {
        return score_points(test_device(), generated, truth, o);
    };
    VoxelGrid bare = good;
    bare.points.clear();
    bare.colors.clear();
    bare.generated.clear();
    EXPECT_TRUE(says(score(bare, good), "the generated grid is a semantic grid without points"));
    EXPECT_TRUE(says(score(good, bare), "the truth is a semantic grid without points"));
    VoxelGrid other = good;
    other.voxel_size = 0.5f;
    EXPECT_TRUE(says(score(other, good), "expected one voxel size, found 0.5 m generated and 0.6 m in truth"));
    EXPECT_TRUE(says(score(random_grid(9, 4, 4, 2), good),
                     "expected as many points a voxel, found 4 generated and 3 in truth"));
    other = good;
    other.cells.back()[0] += 7;
    EXPECT_TRUE(says(score(other, good), "expected the same voxels on both sides"));
    EXPECT_TRUE(says(score(other, good), "the truth lacks (7,"));
    other = good;
    other.labels[1] = kBuilding;
    EXPECT_TRUE(says(score(other, good), "found 1 voxels that differ"));
    EXPECT_TRUE(says(score(other, good), "is building generated"));
    other = good;
    std::ranges::fill(other.generated, uint8_t(0));
    EXPECT_TRUE(says(score(other, good), "voxels is generated on both sides"));
    EXPECT_TRUE(says(score(good, good, {.radius = 1.9}), "expected a radius of at most 3 voxels, 1.8 m, found 1.9 m"));
    EXPECT_TRUE(says(score(good, good, {.radius = NAN}), "found nan m"));
}

// rows of ten voxels along x, each voxel with two points whose brightness is that of the row -+ its detail
VoxelGrid rows_of_cells(const std::vector<std::pair<int, int>>& rows)
{
    VoxelGrid grid;
    grid.voxel_size = 0.6f;
    grid.points_per_voxel = 2;
    for (size_t r = 0; r < rows.size(); ++r)
        for (int i = 0; i < 10; ++i) {
            grid.cells.push_back({10 * int32_t(r) + i, 0, 0});
            grid.labels.push_back(kBuilding);
            grid.generated.push_back(1);
            for (int side : {-1, 1})
                for (int c = 0; c < 3; ++c) {
                    grid.points.push_back(0);
                    grid.colors.push_back(uint8_t(rows[r].first + side * rows[r].second));
                }
        }
    return grid;
}

TEST(engine_point_scores, variety_is_told_within_cells_and_from_one_cube_of_6_m_to_the_next)
{
    const VoxelGrid truth = rows_of_cells({{51, 10}, {102, 30}});
    std::vector<uint8_t> used(20, 1);
    const VarietySums sums = color_variety(truth, used)[kBuilding];
    EXPECT_EQ(sums.blocks, 2u);
    EXPECT_NEAR(sums.detail(), 20 / 255.0, 1e-9) << "the mean of 10 and 30";
    EXPECT_NEAR(sums.spread(), 0.1, 1e-9) << "of 0.2 and 0.4";
    std::fill(used.begin() + 14, used.end(), uint8_t(0)); // four are too few for a cube to count
    EXPECT_EQ(color_variety(truth, used)[kBuilding].blocks, 1u);
    EXPECT_EQ(color_variety(truth, used)[kBuilding].spread(), 0);
    VarietySums pooled = sums;
    pooled += color_variety(rows_of_cells({{51, 10}}), std::vector<uint8_t>(10, 1))[kBuilding];
    EXPECT_EQ(pooled.blocks, 3u);
    EXPECT_NEAR(pooled.spread(), std::sqrt((0.04 + 0.16 + 0.04) / 3 - std::pow(0.8 / 3, 2)), 1e-9);
}

} // namespace engine_point_scores_test
} // namespace semrover
