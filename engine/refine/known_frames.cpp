// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/refine/known_frames.h"

#include <cmath>

namespace semrover {

namespace {

using Matrix = std::vector<std::vector<double>>; // rows

// a^-1 b by Gaussian elimination; a is symmetric and positive definite, so that no pivot is small
Matrix solve(Matrix a, Matrix b)
{
    const size_t n = a.size();
    for (size_t i = 0; i < n; ++i)
        for (size_t j = 0; j < n; ++j) {
            if (j == i)
                continue;
            const double factor = a[j][i] / a[i][i];
            for (size_t k = i; k < n; ++k)
                a[j][k] -= factor * a[i][k];
            for (size_t k = 0; k < b[j].size(); ++k)
                b[j][k] -= factor * b[i][k];
        }
    for (size_t i = 0; i < n; ++i)
        for (double& value : b[i])
            value /= a[i][i];
    return b;
}

// rows and columns [0, rows) x [first, last)
Matrix part(const Matrix& m, size_t rows, size_t first, size_t last)
{
    Matrix out;
    for (size_t i = 0; i < rows; ++i)
        out.emplace_back(m[i].begin() + std::ptrdiff_t(first), m[i].begin() + std::ptrdiff_t(last));
    return out;
}

} // namespace

std::vector<float> known_frame_weights(const SamplingPlan& plan, uint32_t frames, uint32_t known, double correlation)
{
    std::vector<float> weights(plan.rows.size() * frames * frames, 0.f);
    if (known == 0 || known == frames)
        return weights;
    Matrix before(frames, std::vector<double>(frames)); // covariance of the frames
    for (uint32_t i = 0; i < frames; ++i)
        for (uint32_t j = 0; j < frames; ++j)
            before[i][j] = std::pow(correlation, i > j ? i - j : j - i);
    for (size_t row = 0; row < plan.rows.size(); ++row) {
        const double abar = plan.rows[row].coefficients.abar, noise = (1 - abar) / abar; // variance, of the frames' 1
        Matrix noisy = before;
        for (uint32_t i = 0; i < frames; ++i)
            noisy[i][i] += noise;
        const Matrix given = solve(noisy, before); // covariance given the noisy frames, but for the factor `noise`
        const Matrix carry = solve(part(given, known, 0, known), part(given, known, known, frames));
        for (uint32_t u = known; u < frames; ++u)
            for (uint32_t k = 0; k < known; ++k)
                weights[(row * frames + u) * frames + k] = float(carry[k][u - known]);
    }
    return weights;
}

} // namespace semrover
