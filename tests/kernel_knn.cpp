// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "kernels/splat.h"
#include "tests/support/kernel_case.h"

#include <algorithm>
#include <numeric>

namespace semrover {
namespace kernel_knn_test {

struct KnnCase {
    uint32_t points, neighbors, width;
    float spread, cell_size,
        radius;      // points lie within [0, spread)^3, on multiples of 1/64: exact distances, many ties
    uint32_t labels; // different ones; 0: none
};

// one point; fewer points than neighbours; ties everywhere; sparse (all points searched); capped; labelled; large
const KnnCase kCases[] = {
    {1, 16, 3, 1, 0.3f, 0, 0},    {7, 16, 3, 1, 0.3f, 0, 0},       {500, 8, 4, 0.2f, 0.05f, 0, 0},
    {300, 16, 3, 60, 0.3f, 0, 0}, {2000, 10, 3, 3, 0.3f, 0.4f, 0}, {2000, 16, 4, 3, 0.3f, 0.45f, 5},
    {700, 5, 3, 2, 0.5f, 0, 40},  {3000, 32, 3, 4, 0.6f, 0, 0},    {5003, 1, 3, 9, 0.3f, 0, 0},
};

std::vector<uint32_t> nearest(const std::vector<float>& p, const std::vector<uint32_t>& labels, const KnnCase& c,
                              uint32_t i, bool same_label)
{
    std::vector<std::pair<float, uint32_t>> all;
    for (uint32_t j = 0; j < c.points; ++j) {
        float d2 = 0;
        for (uint32_t a = 0; a < 3; ++a)
            d2 += (p[j * c.width + a] - p[i * c.width + a]) * (p[j * c.width + a] - p[i * c.width + a]);
        if ((c.radius == 0 || d2 <= c.radius * c.radius) && (!same_label || labels[i] == labels[j]))
            all.emplace_back(d2, j);
    }
    std::sort(all.begin(), all.end());
    std::vector<uint32_t> out(c.neighbors, ~0u);
    for (uint32_t q = 0; q < std::min<size_t>(c.neighbors, all.size()); ++q)
        out[q] = all[q].second;
    return out;
}

void check(const KnnCase& c)
{
    SCOPED_TRACE(fmt::format("{} points in {} m, {} neighbours, {} labels", c.points, c.spread, c.neighbors, c.labels));
    KernelCase k(test_device());
    const std::vector<uint32_t> steps = k.indices(c.points * c.width, uint32_t(c.spread * 64));
    std::vector<float> p(steps.size());
    for (size_t i = 0; i < p.size(); ++i)
        p[i] = float(steps[i]) / 64 - c.spread / 2;
    const std::vector<uint32_t> labels = k.indices(c.points, std::max(c.labels, 1u));
    KnnOptions options{.neighbors = c.neighbors, .cell_size = c.cell_size, .radius = c.radius};
    if (c.labels)
        options.labels = k.input(labels);
    const Tensor y = knn(k.graph, k.input(p, c.width), options);
    const Tensor out = k.output(y.rows, y.cols, y.dtype, y.ld);
    k.graph.keep(y, out);
    const Status status = k.compile_and_run();
    ASSERT_TRUE(status) << status.error().message;
    const auto got = k.read_array<uint32_t>(out);
    for (uint32_t i = 0; i < c.points; ++i) {
        std::vector<uint32_t> expect = nearest(p, labels, c, i, c.labels > 0);
        if (c.labels && std::count(expect.begin(), expect.end(), ~0u) > int64_t(c.neighbors) - 4)
            expect = nearest(p, labels, c, i, false);
        for (uint32_t q = 0; q < c.neighbors; ++q)
            ASSERT_EQ(got[i * c.neighbors + q], expect[q]) << "point " << i << " neighbour " << q;
    }
}

TEST(kernel_knn, matches_brute_force_with_ties_by_index)
{
    for (const KnnCase& c : kCases)
        check(c);
}

TEST(kernel_knn, the_nearest_of_other_points_match_brute_force)
{
    for (const auto& [points, queries, spread] : {std::tuple{1u, 3u, 1.f}, {900u, 701u, 2.f}, {300u, 65u, 30.f}}) {
        KernelCase k(test_device());
        std::mt19937 random(8);
        std::vector<float> p, q;
        for (uint32_t i = 0; i < 3 * points; ++i)
            p.push_back(float(random() % 4096) / 4096 * spread);
        for (uint32_t i = 0; i < 4 * queries; ++i)
            q.push_back(float(random() % 4096) / 4096 * 1.5f * spread - spread / 4);
        KnnOptions options{.neighbors = 1, .cell_size = 0.3f};
        options.queries = k.input(q, 4);
        const Tensor y = knn(k.graph, k.input(p, 3), options);
        ASSERT_EQ(y.rows, queries);
        const Tensor out = k.output(y.rows, y.cols, y.dtype, y.ld);
        k.graph.keep(y, out);
        ASSERT_TRUE(k.compile_and_run());
        const auto got = k.read_array<uint32_t>(out);
        const auto distance = [&](uint32_t i, uint32_t j) {
            return std::hypot(double(p[3 * j]) - q[4 * i], double(p[3 * j + 1]) - q[4 * i + 1],
                              double(p[3 * j + 2]) - q[4 * i + 2]);
        };
        for (uint32_t i = 0; i < queries; ++i) {
            double best = 1e9;
            for (uint32_t j = 0; j < points; ++j)
                best = std::min(best, distance(i, j));
            ASSERT_LT(got[i], points);
            ASSERT_NEAR(distance(i, got[i]), best, 1e-5) << "query " << i;
        }
    }
}

// more of them than the 65535 rounds that lavapipe grants the loops of an invocation
TEST(kernel_knn, what_is_far_from_everything_finds_its_nearest_among_all_points)
{
    constexpr uint32_t kPoints = 150000, kQueries = 11, kNeighbors = 3;
    KernelCase k(test_device());
    std::mt19937 random(9);
    std::vector<float> p, q;
    for (uint32_t i = 0; i < 3 * kPoints; ++i)
        p.push_back(float(random() % 65536) / 65536 * 6);
    for (uint32_t i = 0; i < 4 * kQueries; ++i)
        q.push_back(30 + float(random() % 4096) / 64);
    KnnOptions options{.neighbors = kNeighbors, .cell_size = 0.3f};
    options.queries = k.input(q, 4);
    const Tensor y = knn(k.graph, k.input(p, 3), options);
    const Tensor out = k.output(y.rows, y.cols, y.dtype, y.ld);
    k.graph.keep(y, out);
    ASSERT_TRUE(k.compile_and_run());
    const auto got = k.read_array<uint32_t>(out);
    for (uint32_t i = 0; i < kQueries; ++i) {
        const auto distance = [&](uint32_t j) {
            return std::hypot(double(p[3 * j]) - q[4 * i], double(p[3 * j + 1]) - q[4 * i + 1],
                              double(p[3 * j + 2]) - q[4 * i + 2]);
        };
        std::vector<double> all(kPoints);
        for (uint32_t j = 0; j < kPoints; ++j)
            all[j] = distance(j);
        std::partial_sort(all.begin(), all.begin() + kNeighbors, all.end());
        for (uint32_t n = 0; n < kNeighbors; ++n) {
            ASSERT_LT(got[i * kNeighbors + n], kPoints);
            EXPECT_NEAR(distance(got[i * kNeighbors + n]), all[n], 2e-5) << "query " << i << ", neighbour " << n;
        }
    }
}

TEST(kernel_knn, points_that_are_not_finite_have_no_neighbours_and_are_none)
{
    KernelCase k(test_device());
    std::vector<float> p;
    for (uint32_t i = 0; i < 40; ++i)
        p.insert(p.end(), {float(i) * 0.1f, i == 7 ? NAN : 0.f, i == 9 ? INFINITY : 0.f});
    const Tensor y = knn(k.graph, k.input(p, 3), {.neighbors = 3});
    const Tensor out = k.output(y.rows, y.cols, y.dtype, y.ld);
    k.graph.keep(y, out);
    ASSERT_TRUE(k.compile_and_run());
    const auto got = k.read_array<uint32_t>(out);
    EXPECT_EQ(std::vector<uint32_t>(got.begin() + 21, got.begin() + 24), std::vector<uint32_t>(3, ~0u));
    EXPECT_EQ(std::vector<uint32_t>(got.begin() + 27, got.begin() + 30), std::vector<uint32_t>(3, ~0u));
    EXPECT_EQ(std::vector<uint32_t>(got.begin() + 24, got.begin() + 27), (std::vector<uint32_t>{8, 6, 10}));
}

} // namespace kernel_knn_test
} // namespace semrover
