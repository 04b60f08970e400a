// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "kernels/splat.h"
#include "tests/support/kernel_case.h"

#include <array>
#include <cmath>
#include <numbers>

namespace semrover {
namespace kernel_pca_normal_test {

using Matrix = std::array<std::array<double, 3>, 3>;

// eigenvalues, ascending, by Jacobi in double
std::array<double, 3> eigenvalues(Matrix a)
{
    for (int sweep = 0; sweep < 30; ++sweep)
        for (auto [p, q] : {std::pair{0, 1}, {0, 2}, {1, 2}}) {
            if (a[p][q] == 0)
                continue;
            const double angle = 0.5 * std::atan2(2 * a[p][q], a[p][p] - a[q][q]), c = std::cos(angle),
                         s = std::sin(angle);
            Matrix r = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}, t{}, out{};
            r[p][p] = r[q][q] = c;
            r[p][q] = -s;
            r[q][p] = s;
            for (int i = 0; i < 3; ++i)
                for (int j = 0; j < 3; ++j)
                    for (int k = 0; k < 3; ++k)
                        t[i][j] += a[i][k] * r[k][j];
            for (int i = 0; i < 3; ++i)
                for (int j = 0; j < 3; ++j)
                    for (int k = 0; k < 3; ++k)
                        out[i][j] += r[k][i] * t[k][j];
            a = out;
        }
    std::array<double, 3> e = {a[0][0], a[1][1], a[2][2]};
    std::sort(e.begin(), e.end());
    return e;
}

Matrix covariance(const std::vector<float>& p, const uint32_t* neighbors, uint32_t k)
{
    std::array<double, 3> mean{};
    uint32_t n = 0;
    for (uint32_t q = 0; q < k; ++q)
        if (neighbors[q] != ~0u) {
            for (int a = 0; a < 3; ++a)
                mean[a] += p[neighbors[q] * 3 + a];
            ++n;
        }
    Matrix c{};
    for (uint32_t q = 0; q < k; ++q)
        if (neighbors[q] != ~0u)
            for (int a = 0; a < 3; ++a)
                for (int b = 0; b < 3; ++b)
                    c[a][b] += (p[neighbors[q] * 3 + a] - mean[a] / n) * (p[neighbors[q] * 3 + b] - mean[b] / n) / n;
    return c;
}

struct Output {
    std::vector<float> normals, eigenvalues;
};

Output run(const std::vector<float>& p, const std::vector<uint32_t>& neighbors, uint32_t k,
           const PcaNormalOptions& options, const std::vector<uint32_t>& labels = {})
{
    KernelCase c(test_device());
    PcaNormalOptions with_labels = options;
    if (!labels.empty())
        with_labels.labels = c.input(labels);
    const PcaNormals y = pca_normal(c.graph, c.input(p, 3), c.input(neighbors, k), with_labels);
    const uint32_t rows = uint32_t(p.size() / 3);
    const Tensor n = c.output(rows, 4, DType::f32, 4), e = c.output(rows, 4, DType::f32, 4);
    c.graph.keep(y.normals, n);
    c.graph.keep(y.eigenvalues, e);
    const Status status = c.compile_and_run();
    EXPECT_TRUE(status) << status.error().message;
    return {c.read_array<float>(n), c.read_array<float>(e)};
}

// points of a cloud of standard deviations `size` around `center`, turned by 45 degrees about x and then about z
std::vector<float> cloud(uint32_t n, std::array<double, 3> size, double center, uint32_t seed)
{
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    const double h = std::sqrt(0.5);
    std::vector<float> p;
    for (uint32_t i = 0; i < n; ++i) {
        const double x = size[0] * normal(random), y = size[1] * normal(random), z = size[2] * normal(random);
        const double y1 = h * (y - z), z1 = h * (y + z);
        p.insert(p.end(), {float(center + h * (x - y1)), float(center + h * (x + y1)), float(center + z1)});
    }
    return p;
}

TEST(kernel_pca_normal, solves_the_eigenproblem_of_round_flat_long_and_far_clouds)
{
    for (const auto& [size, center] : std::vector<std::pair<std::array<double, 3>, double>>{{{1, 1, 1}, 0},
                                                                                            {{0.3, 0.3, 0.01}, 0},
                                                                                            {{0.3, 0.2, 0}, 2},
                                                                                            {{1, 1e-3, 1e-3}, 0},
                                                                                            {{0.2, 0.1, 0.01}, 1000},
                                                                                            {{1e-4, 1e-4, 1e-5}, 0}}) {
        SCOPED_TRACE(fmt::format("{} {} {} at {}", size[0], size[1], size[2], center));
        const uint32_t n = 203, k = 13;
        const std::vector<float> p = cloud(n, size, center, 1);
        KernelCase c(test_device());
        const std::vector<uint32_t> neighbors = c.indices(n * k, n);
        const Output y = run(p, neighbors, k, {});
        for (uint32_t i = 0; i < n; ++i) {
            const Matrix m = covariance(p, &neighbors[i * k], k);
            const std::array<double, 3> e = eigenvalues(m);
            double residual = 0, length = 0;
            for (int a = 0; a < 3; ++a) {
                ASSERT_NEAR(y.eigenvalues[i * 4 + a], e[a], 3e-6 * e[2]) << i; // measured: 6e-7
                double row = 0;
                for (int b = 0; b < 3; ++b)
                    row += m[a][b] * y.normals[i * 4 + b];
                residual += std::pow(row - e[0] * y.normals[i * 4 + a], 2);
                length += std::pow(y.normals[i * 4 + a], 2);
            }
            ASSERT_NEAR(length, 1, 1e-5);
            ASSERT_LT(std::sqrt(residual), 3e-6 * e[2]) << i;
        }
    }
}

TEST(kernel_pca_normal, missing_neighbours_do_not_count)
{
    const std::vector<float> p = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 5, 5, 5};
    std::vector<uint32_t> neighbors;
    for (uint32_t i = 0; i < 5; ++i)
        neighbors.insert(neighbors.end(), {0, ~0u, 1, 2, ~0u, 3});
    const Output y = run(p, neighbors, 6, {});
    EXPECT_NEAR(y.normals[2], 1, 1e-6);
    EXPECT_EQ(y.eigenvalues[3], 4);
    EXPECT_NEAR(y.eigenvalues[1], 0.25, 1e-6);
}

TEST(kernel_pca_normal, a_thin_pole_points_outwards_and_too_few_neighbours_point_up)
{
    const uint32_t n = 200, k = n;
    std::vector<float> p;
    std::mt19937 random(3);
    std::uniform_real_distribution<double> unit;
    for (uint32_t i = 0; i < n; ++i) { // radius 5 cm, 2 m high
        const double angle = 2 * std::numbers::pi * unit(random);
        p.insert(p.end(), {float(3 + 0.05 * std::cos(angle)), float(0.05 * std::sin(angle)), float(2 * unit(random))});
    }
    std::vector<uint32_t> neighbors;
    for (uint32_t i = 0; i < n; ++i)
        for (uint32_t j = 0; j < k; ++j)
            neighbors.push_back(i < 2 ? (j == 0 ? i : j == 1 ? 5 : ~0u) : j);
    const Output y = run(p, neighbors, k, {.fallbacks = true});
    EXPECT_EQ(y.normals[3], 2);
    EXPECT_EQ(y.normals[2], 1);
    for (uint32_t i = 2; i < n; ++i) {
        ASSERT_EQ(y.normals[i * 4 + 3], 1);
        const double out = (y.normals[i * 4] * (p[i * 3] - 3) + y.normals[i * 4 + 1] * p[i * 3 + 1]) / 0.05;
        ASSERT_GT(std::abs(out), 0.95) << i;
    }
}

TEST(kernel_pca_normal, labels_decide_what_is_a_line_between_the_two_ratios)
{
    const std::vector<float> p = cloud(100, {0.3, 0.16, 0.15}, 0, 5); // eigenvalue ratio 0.3
    std::vector<uint32_t> neighbors, labels;
    for (uint32_t i = 0; i < 100; ++i) {
        labels.push_back(i % 2 ? 5 : 2);
        for (uint32_t j = 0; j < 100; ++j)
            neighbors.push_back(j);
    }
    const Output y = run(p, neighbors, 100, {.fallbacks = true, .line_labels = 1u << 5}, labels);
    for (uint32_t i = 0; i < 100; ++i)
        ASSERT_EQ(y.normals[i * 4 + 3], i % 2 ? 1 : 0) << i;
}

} // namespace kernel_pca_normal_test
} // namespace semrover
