// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/eval/features.h"

#include <functional>

namespace semrover {

// k(x, y) between samples of D numbers
struct SampleKernel {
    enum class Kind { polynomial, rbf } kind = Kind::polynomial;
    int degree = 3;   // polynomial: (gamma x.y + coefficient)^degree
    double gamma = 0; // 0: 1 / D
    double coefficient = 1;
    double bandwidth = 0; // rbf: exp(-|x - y|^2 / (2 bandwidth^2)); see median_distance()
};

// Squared maximum mean discrepancy (Gretton et al. 2012), sums over i, j of samples x of A and y of B:
//   unbiased: mean_{i != j} k(x_i, x_j) + mean_{i != j} k(y_i, y_j) - 2 mean k(x_i, y_j); may be below zero
//   biased:   the same with i = j; its root is the distance of the mean embeddings
// Dot products and sums are in double, and the same however many threads work. Errors, bad_input: fewer than two
// samples, sizes that differ
struct Discrepancy {
    double unbiased = 0, biased = 0;
};
Result<Discrepancy> discrepancy(const Features& a, const Features& b, const SampleKernel& kernel);

// Median of the distances between different samples of both sets together: the usual bandwidth. Of more than
// kMedianSamples, every n-th is taken. bad_input when it is zero (most samples are alike)
constexpr uint32_t kMedianSamples = 2000;
Result<double> median_distance(const Features& a, const Features& b);

// Kernel Inception distance (Binkowski et al. 2018, arXiv 1801.01401): the unbiased discrepancy with the polynomial
// kernel over random subsets without repetition. Subsets depend on the seed only. Errors: as discrepancy(), and
// subsets larger than a set
struct SubsetOptions {
    uint32_t subsets = 100, size = 1000;
    uint64_t seed = 0;
    SampleKernel kernel = {};
    std::function<Status(uint32_t done)> moved = {}; // after each subset; an error ends it
};
struct SubsetDistance {
    double mean = 0, deviation = 0; // over subsets (population), as torch-fidelity reports them
};
Result<SubsetDistance> subset_distance(const Features& a, const Features& b, const SubsetOptions& options);

} // namespace semrover
