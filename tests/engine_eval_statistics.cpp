// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/safetensors.h"
#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"
#include "tools/eval/frechet.h"
#include "tools/eval/kernel_distance.h"

#include <cmath>
#include <numeric>
#include <random>

namespace semrover {
namespace engine_eval_statistics_test {

Features random_features(uint32_t rows, uint32_t cols, uint32_t seed, double scale = 1, double shift = 0)
{
    std::mt19937 random(seed);
    std::normal_distribution<double> normal(shift, scale);
    Features f{rows, cols, {}, {}};
    for (size_t i = 0; i < size_t(rows) * cols; ++i)
        f.values.push_back(normal(random));
    return f;
}

Gaussian diagonal(const std::vector<double>& mean, const std::vector<double>& variance)
{
    Gaussian g{uint32_t(mean.size()), mean, std::vector<double>(mean.size() * mean.size())};
    for (size_t i = 0; i < mean.size(); ++i)
        g.covariance[i * mean.size() + i] = variance[i];
    return g;
}

// Q diag(v) Q^T, with Q the reflection I - 2 u u^T
Gaussian reflected(const std::vector<double>& mean, const std::vector<double>& variance, std::vector<double> u)
{
    const size_t n = mean.size();
    const double length = std::sqrt(std::inner_product(u.begin(), u.end(), u.begin(), 0.));
    for (double& v : u)
        v /= length;
    Gaussian g{uint32_t(n), mean, std::vector<double>(n * n)};
    for (size_t i = 0; i < n; ++i)
        for (size_t j = 0; j < n; ++j)
            for (size_t k = 0; k < n; ++k)
                g.covariance[i * n + j] +=
                    (double(i == k) - 2 * u[i] * u[k]) * variance[k] * (double(j == k) - 2 * u[j] * u[k]);
    return g;
}

double frechet(const Gaussian& a, const Gaussian& b)
{
    const auto d = frechet_distance(a, b);
    EXPECT_TRUE(d) << d.error().message;
    return d ? d->distance : NAN;
}

TEST(engine_eval_statistics, frechet_distance_of_diagonal_gaussians_is_the_sum_of_one_dimensional_ones)
{
    // (1 - 3)^2 + (2 - 5)^2 + 0, (0 - -1)^2 + (1 - 1)^2, (4 - 0)^2 alone
    EXPECT_DOUBLE_EQ(frechet(diagonal({1}, {4}), diagonal({3}, {25})), 4 + 9);
    EXPECT_NEAR(frechet(diagonal({0, 1, 0}, {4, 0, 16}), diagonal({-1, 1, 0}, {9, 0, 0})), 1 + 1 + 16, 1e-12);
    EXPECT_DOUBLE_EQ(frechet(diagonal({1, 2}, {0, 0}), diagonal({4, 6}, {0, 0})), 25);
}

TEST(engine_eval_statistics, frechet_distance_is_that_of_commuting_covariances_in_any_basis)
{
    const std::vector<double> u = {1, -2, 0.5, 3, 1};
    const std::vector<double> a = {9, 4, 1, 0.25, 1e-8}, b = {1, 16, 1, 4, 1e-4};
    double expect = 0;
    for (size_t i = 0; i < 5; ++i)
        expect += (std::sqrt(a[i]) - std::sqrt(b[i])) * (std::sqrt(a[i]) - std::sqrt(b[i]));
    const std::vector<double> zero(5);
    EXPECT_NEAR(frechet(reflected(zero, a, u), reflected(zero, b, u)), expect, 1e-7);
    EXPECT_NEAR(frechet(reflected(zero, b, u), reflected(zero, a, u)), expect, 1e-7);
}

// tr sqrt of a 2 x 2 matrix M is sqrt(tr M + 2 sqrt(det M)); the eigenvalues of C1 C2 are those under the root
TEST(engine_eval_statistics,
     frechet_distance_of_covariances_that_do_not_commute_follows_the_closed_form_of_two_dimensions)
{
    const Gaussian a{2, {0, 0}, {2, 1, 1, 3}}, b{2, {1, -1}, {5, -2, -2, 1}};
    const double trace = 2 * 5 + 1 * -2 + 1 * -2 + 3 * 1, determinant = (2 * 3 - 1) * (5 * 1 - 4);
    const double cross = std::sqrt(trace + 2 * std::sqrt(determinant));
    EXPECT_NEAR(frechet(a, b), 2 + 5 + 6 - 2 * cross, 1e-12);
    EXPECT_NEAR(frechet(b, a), 2 + 5 + 6 - 2 * cross, 1e-12);
    // one of them singular: determinant 0
    const Gaussian c{2, {0, 0}, {1, 2, 2, 4}};
    EXPECT_NEAR(frechet(a, c), 5 + 5 - 2 * std::sqrt(2 * 1 + 1 * 2 + 1 * 2 + 3 * 4), 1e-7);
}

// covariances u u^T and v v^T: the cross term is |u.v|, known though both have rank one
TEST(engine_eval_statistics, frechet_distance_of_covariances_of_rank_one_is_exact)
{
    const size_t n = 40;
    Gaussian a{n, std::vector<double>(n), {}}, b{n, std::vector<double>(n, 0.5), {}};
    std::vector<double> u(n), v(n);
    double uu = 0, vv = 0, uv = 0;
    for (size_t i = 0; i < n; ++i) {
        u[i] = std::sin(double(i));
        v[i] = 0.3 + std::cos(double(3 * i));
        uu += u[i] * u[i];
        vv += v[i] * v[i];
        uv += u[i] * v[i];
    }
    for (size_t i = 0; i < n * n; ++i) {
        a.covariance.push_back(u[i / n] * u[i % n]);
        b.covariance.push_back(v[i / n] * v[i % n]);
    }
    EXPECT_NEAR(frechet(a, b), n * 0.25 + uu + vv - 2 * std::abs(uv), 1e-9);
}

TEST(engine_eval_statistics, moments_match_their_definition_and_a_shift_moves_the_mean_only)
{
    const Features f{3, 2, {1, 10, 2, 30, 6, 20}, {}};
    const auto g = gaussian_of(f);
    ASSERT_TRUE(g) << g.error().message;
    EXPECT_EQ(g->mean, (std::vector<double>{3, 20}));
    const std::vector<double> expect = {7, 5, 5, 100}; // (4 + 1 + 9) / 2, (20 - 10 + 0) / 2, (100 + 100) / 2
    for (size_t i = 0; i < 4; ++i)
        EXPECT_NEAR(g->covariance[i], expect[i], 1e-12);
    for (const auto& [rows, cols] : {std::pair{50u, 1u}, {12u, 30u}, {300u, 40u}}) {
        const Features a = random_features(rows, cols, 1);
        Features b = a;
        for (double& v : b.values)
            v += 0.75;
        EXPECT_NEAR(frechet(*gaussian_of(a), *gaussian_of(b)), cols * 0.75 * 0.75, 1e-6 * cols) << rows;
        EXPECT_NEAR(frechet(*gaussian_of(a), *gaussian_of(a)), 0, 1e-6) << rows << " x " << cols;
    }
}

// fewer samples than dimensions: N(0, a^2) against N(0, b^2) of the same samples is (a - b)^2 tr C
TEST(engine_eval_statistics, scaled_samples_have_the_distance_of_their_scales_when_covariances_are_singular)
{
    const Features a = random_features(20, 64, 5);
    Features b = a;
    for (double& v : b.values)
        v *= 3;
    const auto g = gaussian_of(a), h = gaussian_of(b);
    double trace = 0, mean2 = 0;
    for (uint32_t i = 0; i < 64; ++i) {
        trace += g->covariance[i * 64 + i];
        mean2 += g->mean[i] * g->mean[i];
    }
    EXPECT_NEAR(frechet(*g, *h), 4 * (trace + mean2), 1e-9 * trace);
}

long double kernel(const SampleKernel& k, const double* x, const double* y, uint32_t n)
{
    long double dot = 0, distance2 = 0;
    for (uint32_t i = 0; i < n; ++i) {
        dot += static_cast<long double>(x[i]) * y[i];
        distance2 += (static_cast<long double>(x[i]) - y[i]) * (static_cast<long double>(x[i]) - y[i]);
    }
    if (k.kind == SampleKernel::Kind::rbf)
        return std::exp(-distance2 / (2 * static_cast<long double>(k.bandwidth) * k.bandwidth));
    const long double gamma = k.gamma == 0 ? 1 / static_cast<long double>(n) : static_cast<long double>(k.gamma);
    return std::pow(gamma * dot + k.coefficient, static_cast<long double>(k.degree));
}

Discrepancy defined(const Features& a, const Features& b, const SampleKernel& k)
{
    long double xx = 0, yy = 0, xy = 0, x_diagonal = 0, y_diagonal = 0;
    for (uint32_t i = 0; i < a.rows; ++i)
        for (uint32_t j = 0; j < a.rows; ++j)
            (i == j ? x_diagonal : xx) += kernel(k, a.row(i), a.row(j), a.cols);
    for (uint32_t i = 0; i < b.rows; ++i)
        for (uint32_t j = 0; j < b.rows; ++j)
            (i == j ? y_diagonal : yy) += kernel(k, b.row(i), b.row(j), a.cols);
    for (uint32_t i = 0; i < a.rows; ++i)
        for (uint32_t j = 0; j < b.rows; ++j)
            xy += kernel(k, a.row(i), b.row(j), a.cols);
    const long double n = a.rows, m = b.rows;
    return {double(xx / (n * (n - 1)) + yy / (m * (m - 1)) - 2 * xy / (n * m)),
            double((xx + x_diagonal) / (n * n) + (yy + y_diagonal) / (m * m) - 2 * xy / (n * m))};
}

const SampleKernel kKernels[] = {{}, // of the kernel inception distance
                                 {.degree = 1},
                                 {.degree = 2, .gamma = 0.3, .coefficient = 0},
                                 {.kind = SampleKernel::Kind::rbf, .bandwidth = 0.7},
                                 {.kind = SampleKernel::Kind::rbf, .bandwidth = 6}};

TEST(engine_eval_statistics, discrepancies_match_their_definition_in_long_double)
{
    for (const auto& [n, m, cols] : {std::tuple{2u, 2u, 1u}, {7u, 5u, 3u}, {300u, 270u, 9u}, {257u, 40u, 33u}})
        for (const SampleKernel& k : kKernels) {
            const Features a = random_features(n, cols, 1), b = random_features(m, cols, 2, 1.2, 0.3);
            const auto d = discrepancy(a, b, k);
            ASSERT_TRUE(d) << d.error().message;
            const Discrepancy expect = defined(a, b, k);
            const double scale = std::abs(expect.unbiased) + std::abs(expect.biased) + 1;
            EXPECT_NEAR(d->unbiased, expect.unbiased, 1e-11 * scale) << n << " x " << m << " x " << cols;
            EXPECT_NEAR(d->biased, expect.biased, 1e-11 * scale) << n << " x " << m << " x " << cols;
        }
}

// by hand, D = 1, k = x y + 1: A = {0, 2}, B = {1, 3}: (1 + 1) / 2 + (4 + 4) / 2 - 2 (1 + 1 + 3 + 7) / 4 = 1 + 4 - 6
TEST(engine_eval_statistics, the_linear_kernel_is_the_distance_of_the_means)
{
    const auto d = discrepancy({2, 1, {0, 2}, {}}, {2, 1, {1, 3}, {}}, {.degree = 1});
    ASSERT_TRUE(d);
    EXPECT_DOUBLE_EQ(d->unbiased, -1);
    EXPECT_DOUBLE_EQ(d->biased, 1); // (1 - 2)^2
}

TEST(engine_eval_statistics, identical_sets_have_no_biased_discrepancy)
{
    const Features a = random_features(64, 8, 3);
    for (const SampleKernel& k : kKernels) {
        const auto d = discrepancy(a, a, k);
        ASSERT_TRUE(d);
        EXPECT_NEAR(d->biased, 0, 1e-12);
        EXPECT_LT(d->unbiased, 0); // the diagonal is missing on one side
    }
}

TEST(engine_eval_statistics, subsets_of_the_whole_sets_are_the_full_distance)
{
    const Features a = random_features(60, 5, 1), b = random_features(60, 5, 2, 1, 0.5);
    const auto full = discrepancy(a, b, {});
    const auto subsets = subset_distance(a, b, {.subsets = 3, .size = 60});
    ASSERT_TRUE(full && subsets);
    EXPECT_NEAR(subsets->mean, full->unbiased, 1e-13);
    EXPECT_NEAR(subsets->deviation, 0, 1e-13);
}

// kernel values are looked up in one matrix when subsets overlap much, and computed for each subset when they do not
TEST(engine_eval_statistics, subsets_depend_on_the_seed_and_scatter_around_the_full_distance)
{
    const Features a = random_features(400, 5, 1), b = random_features(300, 5, 2, 1, 0.5);
    const double full = discrepancy(a, b, {})->unbiased;
    for (const auto& [count, size] : {std::pair{200u, 100u}, {3u, 100u}}) {
        const auto one = subset_distance(a, b, {.subsets = count, .size = size, .seed = 1});
        const auto again = subset_distance(a, b, {.subsets = count, .size = size, .seed = 1});
        const auto other = subset_distance(a, b, {.subsets = count, .size = size, .seed = 2});
        ASSERT_TRUE(one && again && other);
        EXPECT_EQ(one->mean, again->mean);
        EXPECT_EQ(one->deviation, again->deviation);
        EXPECT_NE(one->mean, other->mean);
        EXPECT_GT(one->deviation, 0);
        EXPECT_NEAR(one->mean, full, 5 * one->deviation / std::sqrt(count) + one->deviation);
    }
}

// rows of a random subset: the first `count` of a shuffle by swaps
Features chosen(const Features& f, uint32_t count, std::mt19937_64& random)
{
    std::vector<uint32_t> index(f.rows);
    std::iota(index.begin(), index.end(), 0);
    Features y{count, f.cols, {}, {}};
    for (uint32_t i = 0; i < count; ++i) {
        std::swap(index[i], index[i + random() % (f.rows - i)]);
        y.values.insert(y.values.end(), f.row(index[i]), f.row(index[i]) + f.cols);
    }
    return y;
}

TEST(engine_eval_statistics, subset_means_and_deviations_match_their_definition_either_way_they_are_computed)
{
    const Features a = random_features(90, 5, 1), b = random_features(70, 5, 2, 1, 0.5);
    for (const uint32_t subsets : {3u, 40u}) {
        std::mt19937_64 random(7);
        double sum = 0, squares = 0;
        for (uint32_t i = 0; i < subsets; ++i) {
            const Features x = chosen(a, 30, random), y = chosen(b, 30, random);
            const double v = defined(x, y, {}).unbiased;
            sum += v;
            squares += v * v;
        }
        const double mean = sum / subsets;
        const auto d = subset_distance(a, b, {.subsets = subsets, .size = 30, .seed = 7});
        ASSERT_TRUE(d) << d.error().message;
        EXPECT_NEAR(d->mean, mean, 1e-11);
        EXPECT_NEAR(d->deviation, std::sqrt(squares / subsets - mean * mean), 1e-9);
    }
}

TEST(engine_eval_statistics, the_median_distance_is_that_of_all_pairs)
{
    const auto m = median_distance({2, 1, {0, 1}, {}}, {2, 1, {3, 10}, {}}); // 1 3 10 2 9 7: sorted 1 2 3 7 9 10
    ASSERT_TRUE(m);
    EXPECT_DOUBLE_EQ(*m, 7);
    EXPECT_TRUE(says(median_distance({2, 1, {1, 1}, {}}, {2, 1, {1, 1}, {}}), "median distance is 0"));
}

TEST(engine_eval_statistics, sets_that_cannot_be_compared_are_refused)
{
    const Features a = random_features(5, 3, 1), b = random_features(5, 4, 1), one = random_features(1, 3, 1);
    EXPECT_TRUE(says(gaussian_of(one), "needs two samples or more, found 1"));
    EXPECT_TRUE(says(frechet_distance(*gaussian_of(a), *gaussian_of(b)), "3 features a sample on one side and 4"));
    EXPECT_TRUE(says(discrepancy(a, b, {}), "3 features a sample on one side and 4"));
    EXPECT_TRUE(says(discrepancy(a, one, {}), "5 and 1 samples; each set needs two or more"));
    EXPECT_TRUE(says(subset_distance(a, a, {.subsets = 2, .size = 6}), "subsets of 6 out of 5 and 5 samples"));
    EXPECT_TRUE(says(subset_distance(a, b, {}), "3 features a sample on one side and 4"));
    EXPECT_TRUE(says(median_distance(a, b), "3 features a sample on one side and 4"));
}

// a file of these tensors, all F64
Path put(const ScratchFolder& folder,
         const std::map<std::string, std::pair<std::vector<uint64_t>, std::vector<double>>>& t)
{
    std::vector<TensorData> tensors;
    for (const auto& [name, tensor] : t)
        tensors.push_back({name, DType::f64, tensor.first, std::as_bytes(std::span(tensor.second))});
    const Path path = folder / "in.safetensors";
    EXPECT_TRUE(write_safetensors(path, tensors));
    return path;
}

TEST(engine_eval_statistics, feature_files_come_back_as_they_were_written)
{
    const ScratchFolder folder;
    const Features f{2, 3, {1, -2, 0.5, 1e-3f, 7, 8}, "a network"};
    ASSERT_TRUE(write_features(folder / "f.safetensors", f));
    EXPECT_EQ(*feature_file_kind(folder / "f.safetensors"), FeatureFile::features);
    const auto back = read_features(folder / "f.safetensors");
    ASSERT_TRUE(back) << back.error().message;
    EXPECT_EQ(back->values, f.values);
    EXPECT_EQ(back->network, "a network");
    const Path moments = put(folder, {{"mu", {{2}, {1, 1.0 / 3}}}, {"sigma", {{2, 2}, {4, 1, 1, 0.1}}}});
    EXPECT_EQ(*feature_file_kind(moments), FeatureFile::gaussian);
    const auto g = read_gaussian(moments);
    ASSERT_TRUE(g) << g.error().message;
    EXPECT_EQ(g->mean, (std::vector<double>{1, 1.0 / 3}));
    EXPECT_EQ(g->covariance, (std::vector<double>{4, 1, 1, 0.1}));
}

TEST(engine_eval_statistics, feature_files_that_are_something_else_are_refused)
{
    const ScratchFolder folder;
    EXPECT_TRUE(says(feature_file_kind(folder / "none.safetensors"), "No such file"));
    EXPECT_TRUE(says(feature_file_kind(folder.put("x.safetensors", "short")), "x.safetensors"));
    EXPECT_TRUE(
        says(feature_file_kind(put(folder, {{"x", {{1}, {1}}}})), "expected a tensor 'features' [N, D], or 'mu'"));
    EXPECT_TRUE(
        says(feature_file_kind(put(folder, {{"mu", {{1}, {1}}}})), "expected a tensor 'features' [N, D], or 'mu'"));
    EXPECT_TRUE(
        says(read_features(put(folder, {{"features", {{3}, {1, 2, 3}}}})), "'features' is [3], expected [N, D]"));
    EXPECT_TRUE(says(read_features(put(folder, {{"features", {{1, 2}, {1, 2}}}, {"extra", {{1}, {1}}}})), "extra"));
    EXPECT_TRUE(says(read_features(put(folder, {{"features", {{2, 2}, {1, 2, NAN, 3}}}})), "nan in row 1, column 0"));
    EXPECT_TRUE(
        says(read_features(put(folder, {{"features", {{2, 2}, {1, 2, 3, INFINITY}}}})), "inf in row 1, column 1"));
    const std::vector<double> wide(9000);
    EXPECT_TRUE(
        says(read_features(put(folder, {{"features", {{1, 9000}, wide}}})), "9000 features a sample, expected 1 to"));
    EXPECT_TRUE(says(read_gaussian(put(folder, {{"mu", {{2}, {0, 0}}}, {"sigma", {{2, 1}, {1, 1}}}})), "sigma"));
    EXPECT_TRUE(says(read_gaussian(put(folder, {{"mu", {{2}, {0, 0}}}})), "sigma"));
    EXPECT_TRUE(says(read_gaussian(put(folder, {{"mu", {{2}, {0, 0}}}, {"sigma", {{2, 2}, {1, 0.5, -0.5, 1}}}})),
                     "sigma is not symmetric: -0.5 at 1, 0 and 0.5 at 0, 1"));
    EXPECT_TRUE(says(read_gaussian(put(folder, {{"mu", {{2}, {0, 0}}}, {"sigma", {{2, 2}, {1, 0, 0, -1}}}})),
                     "negative variance -1 at 1"));
    EXPECT_TRUE(
        says(read_gaussian(put(folder, {{"mu", {{1}, {NAN}}}, {"sigma", {{1, 1}, {1}}}})), "nan in row 0, column 0"));
}

} // namespace engine_eval_statistics_test
} // namespace semrover
