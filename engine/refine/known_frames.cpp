// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/refine/known_frames.h"

#include <cmath>
#include <Eigen/Cholesky>

namespace semrover {

std::vector<float> known_frame_weights(const SamplingPlan& plan, uint32_t frames, uint32_t known, double correlation)
{
    std::vector<float> weights(plan.rows.size() * frames * frames, 0.f);
    if (known == 0 || known == frames)
        return weights;
    Eigen::MatrixXd before(frames, frames); // covariance of the frames
    for (uint32_t i = 0; i < frames; ++i)
        for (uint32_t j = 0; j < frames; ++j)
            before(i, j) = std::pow(correlation, i > j ? i - j : j - i);
    for (size_t row = 0; row < plan.rows.size(); ++row) {
        const double abar = plan.rows[row].coefficients.abar, noise = (1 - abar) / abar; // variance, of the frames' 1
        Eigen::MatrixXd noisy = before;
        noisy.diagonal().array() += noise;
        // covariance given the noisy frames, but for the factor `noise`
        const Eigen::MatrixXd given = noisy.llt().solve(before);
        const Eigen::MatrixXd carry =
            given.topLeftCorner(known, known).ldlt().solve(given.topRightCorner(known, frames - known));
        for (uint32_t u = known; u < frames; ++u)
            for (uint32_t k = 0; k < known; ++k)
                weights[(row * frames + u) * frames + k] = float(carry(k, u - known));
    }
    return weights;
}

} // namespace semrover
