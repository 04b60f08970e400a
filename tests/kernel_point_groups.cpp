// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "kernels/recognition.h"
#include "tests/support/kernel_case.h"

#include <cmath>

namespace semrover {
namespace kernel_point_groups_test {

struct PointCase {
    uint32_t sets, points, samples, neighbors;
    float spread, radius; // points lie on multiples of 1/64 within [0, spread): exact distances, many ties
};
// one point; every point chosen, many at one place; fewer in the ball than wanted; more; several sets; large; more
// rounds of its loops than lavapipe grants an invocation (65535)
const PointCase kCases[] = {{1, 1, 1, 3, 1, 0.5f},       {1, 40, 40, 8, 0.06f, 0.02f}, {2, 50, 7, 16, 4, 0.3f},
                            {3, 129, 20, 8, 0.5f, 0.3f}, {5, 200, 64, 32, 1, 0.25f},   {1, 63, 10, 4, 1, 100},
                            {2, 4099, 300, 32, 2, 0.2f}, {1, 65, 2, 70, 0.2f, 0.1f},   {2, 3001, 1100, 4, 4, 0.2f}};

std::vector<float> lattice_points(KernelCase& k, const PointCase& c)
{
    std::vector<float> p(size_t(c.sets) * c.points * 4);
    const std::vector<uint32_t> steps = k.indices(uint32_t(p.size()), std::max(uint32_t(c.spread * 64), 1u));
    for (size_t i = 0; i < p.size(); ++i)
        p[i] =
            i % 4 == 3 ? -1e9f : float(steps[i]) / 64 - std::floor(c.spread * 16) / 64; // the fourth number is nobody's
    return p;
}

double distance2(const float* a, const float* b)
{
    double sum = 0;
    for (int i = 0; i < 3; ++i)
        sum += (double(a[i]) - b[i]) * (double(a[i]) - b[i]);
    return sum;
}

std::vector<uint32_t> farthest(const float* p, uint32_t points, uint32_t samples)
{
    std::vector<double> nearest(points, 1e300);
    std::vector<uint32_t> chosen{0};
    while (chosen.size() < samples) {
        uint32_t best = 0;
        for (uint32_t i = 0; i < points; ++i)
            nearest[i] = std::min(nearest[i], distance2(p + 4 * i, p + 4 * chosen.back()));
        for (uint32_t i = 0; i < points; ++i)
            best = nearest[i] > nearest[best] ? i : best;
        chosen.push_back(best);
    }
    return chosen;
}

TEST(kernel_point_groups, farthest_points_match_brute_force_with_ties_to_the_lower_index)
{
    for (const PointCase& c : kCases) {
        SCOPED_TRACE(fmt::format("{} of {} points in {} m, {} sets", c.samples, c.points, c.spread, c.sets));
        KernelCase k(test_device());
        const std::vector<float> p = lattice_points(k, c);
        const PointSamples y = farthest_point(k.graph, k.input(p, 4), c.sets, c.samples);
        const Tensor index = k.output(y.index.rows, 1, DType::u32, 1),
                     points = k.output(y.points.rows, 4, DType::f32, 4);
        k.graph.keep(y.index, index);
        k.graph.keep(y.points, points);
        const Status status = k.compile_and_run();
        ASSERT_TRUE(status) << status.error().message;
        const auto got = k.read_array<uint32_t>(index);
        const auto at = k.read_array<float>(points);
        for (uint32_t set = 0; set < c.sets; ++set) {
            const float* own = &p[size_t(set) * c.points * 4];
            const auto expect = farthest(own, c.points, c.samples);
            for (uint32_t s = 0; s < c.samples; ++s) {
                ASSERT_EQ(got[set * c.samples + s], expect[s]) << "set " << set << " sample " << s;
                for (uint32_t a = 0; a < 3; ++a)
                    ASSERT_EQ(at[(set * c.samples + s) * 4 + a], own[expect[s] * 4 + a]);
            }
        }
    }
}

TEST(kernel_point_groups, balls_hold_the_first_points_within_the_radius_and_repeat_the_first)
{
    for (const PointCase& c : kCases) {
        SCOPED_TRACE(
            fmt::format("{} neighbours of {} points in {} m, {} sets", c.neighbors, c.points, c.radius, c.sets));
        KernelCase k(test_device());
        const std::vector<float> p = lattice_points(k, c);
        std::vector<float> centers(p.begin(), p.begin() + c.sets * c.samples * 4);
        centers[0] = 1000; // a center that is no point and has none
        const Tensor y = ball_query(k.graph, k.input(p, 4), k.input(centers, 4), {c.sets, c.radius, c.neighbors});
        const Tensor out = k.output(y.rows, 1, DType::u32, 1);
        k.graph.keep(y, out);
        const Status status = k.compile_and_run();
        ASSERT_TRUE(status) << status.error().message;
        const auto got = k.read_array<uint32_t>(out);
        for (uint32_t row = 0; row < c.sets * c.samples; ++row) {
            const uint32_t first = row / c.samples * c.points;
            std::vector<uint32_t> expect;
            for (uint32_t i = first; i < first + c.points && expect.size() < c.neighbors; ++i)
                if (distance2(&p[4 * i], &centers[4 * row]) <= double(c.radius) * c.radius)
                    expect.push_back(i);
            expect.resize(c.neighbors, expect.empty() ? first : expect[0]);
            for (uint32_t j = 0; j < c.neighbors; ++j)
                ASSERT_EQ(got[row * c.neighbors + j], expect[j]) << "center " << row << " neighbour " << j;
        }
    }
}

TEST(kernel_point_groups, members_are_offsets_from_the_center_and_then_features)
{
    for (const auto& [points, groups, members, features] :
         {std::tuple{1u, 1u, 1u, 1u}, {30u, 8u, 16u, 5u}, {100u, 7u, 3u, 6u}, {500u, 64u, 32u, 64u}}) {
        SCOPED_TRACE(fmt::format("{} groups of {}, {} features", groups, members, features));
        KernelCase k(test_device());
        const PointCase c{1, points, 1, 1, 4, 1};
        const std::vector<float> p = lattice_points(k, c), centers = lattice_points(k, {1, groups, 1, 1, 4, 1});
        const HostMatrix f = k.random(points + 3, features, DType::f32);
        const std::vector<uint32_t> index = k.indices(groups * members, points);
        const HostMatrix y =
            k.run(group_points(k.graph, k.input(p, 4), k.input(centers, 4), k.input(f), k.input(index)));
        ASSERT_EQ(y.cols, 3 + features);
        for (uint32_t r = 0; r < groups * members; ++r) {
            for (uint32_t a = 0; a < 3; ++a)
                ASSERT_EQ(y.at(r, a), p[4 * index[r] + a] - centers[4 * (r / members) + a]);
            for (uint32_t a = 0; a < features; ++a)
                ASSERT_EQ(y.at(r, 3 + a), f.at(index[r], a));
        }
        k.expect_zero_padding(y);
    }
}

TEST(kernel_point_groups, members_are_the_same_bits_in_bands_of_rows)
{
    std::vector<float> results[2];
    for (const bool banded : {false, true}) {
        auto device = Device::create({.limits = banded ? "range=32768" : ""});
        ASSERT_TRUE(device) << device.error().message;
        KernelCase k(**device);
        const std::vector<float> p = lattice_points(k, {1, 200, 1, 1, 4, 1}),
                                 centers = lattice_points(k, {1, 64, 1, 1, 4, 1});
        const HostMatrix f = k.random(200, 20, DType::f32);
        const std::vector<uint32_t> index = k.indices(64 * 32, 200);
        results[banded] =
            k.run(group_points(k.graph, k.input(p, 4), k.input(centers, 4), k.input(f), k.input(index))).values;
        EXPECT_EQ(k.plan().passes.size() > 1, banded);
    }
    EXPECT_EQ(results[0], results[1]);
}

} // namespace kernel_point_groups_test
} // namespace semrover
