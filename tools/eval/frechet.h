// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/eval/features.h"

namespace semrover {

// mean and unbiased covariance (divided by N - 1); bad_input for fewer than two samples
Result<Gaussian> gaussian_of(const Features& features);

// Squared Frechet (2-Wasserstein) distance of two Gaussians (Dowson and Landau 1982; Heusel et al. 2017, arXiv
// 1706.08500, calls it FID when the features are Inception's):
//   |m1 - m2|^2 + tr(C1 + C2 - 2 (C1^1/2 C2 C1^1/2)^1/2)
// by symmetric eigendecompositions in double, in the subspace where C1 has variance, so that singular covariances
// (N <= D) are exact too; never negative. Errors, bad_input: sizes that differ; internal: no convergence
struct FrechetDistance {
    double distance = 0;
    double mean_part = 0, covariance_part = 0;
};
Result<FrechetDistance> frechet_distance(const Gaussian& a, const Gaussian& b);

} // namespace semrover
