// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/eval/frechet.h"

#include <algorithm>
#include <cmath>
#include <Eigen/Dense>

namespace semrover {

namespace {

using Matrix = Eigen::MatrixXd;
using Solver = Eigen::SelfAdjointEigenSolver<Matrix>;

Eigen::Map<const Matrix> covariance_of(const Gaussian& g) // symmetric: the order of its elements does not matter
{
    return {g.covariance.data(), g.size, g.size};
}

// what rounding leaves of an eigenvalue that is zero
double smallest(const Eigen::VectorXd& ascending)
{
    const double largest = ascending.size() ? ascending[ascending.size() - 1] : 0;
    return std::max(largest, 0.) * double(ascending.size()) * std::numeric_limits<double>::epsilon();
}

tl::unexpected<Error> no_convergence()
{
    return fail(ErrorCode::internal, "the eigenvalues of a covariance did not converge");
}

// R [D, r] with R R^T = C, r the number of its eigenvalues that are not zero
Result<Matrix> root_of(const Matrix& c)
{
    const Solver solver(c);
    if (solver.info() != Eigen::Success)
        return no_convergence();
    const Eigen::VectorXd& values = solver.eigenvalues();
    const double least = smallest(values);
    Eigen::Index first = 0;
    while (first < values.size() && values[first] <= least)
        ++first;
    const Eigen::Index rank = values.size() - first;
    return Matrix(solver.eigenvectors().rightCols(rank) * values.tail(rank).cwiseSqrt().asDiagonal());
}

} // namespace

Result<Gaussian> gaussian_of(const Features& f)
{
    if (f.rows < 2)
        return fail(ErrorCode::bad_input, "a covariance needs two samples or more, found {}", f.rows);
    using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    const Eigen::Map<const Rows> x(f.values.data(), f.rows, f.cols);
    const Eigen::RowVectorXd mean = x.colwise().mean();
    const Rows centered = x.rowwise() - mean;
    Matrix c = Matrix::Zero(f.cols, f.cols);
    c.selfadjointView<Eigen::Lower>().rankUpdate(centered.transpose(), 1.0 / (double(f.rows) - 1));
    c.triangularView<Eigen::StrictlyUpper>() = c.transpose();
    return Gaussian{f.cols, {mean.data(), mean.data() + f.cols}, {c.data(), c.data() + c.size()}};
}

// with C1 = R R^T, (C1^1/2 C2 C1^1/2) and (R^T C2 R) have the same eigenvalues but for zeros
Result<FrechetDistance> frechet_distance(const Gaussian& a, const Gaussian& b)
{
    if (a.size != b.size)
        return fail(ErrorCode::bad_input, "{} features a sample on one side and {} on the other: of different networks",
                    a.size, b.size);
    FrechetDistance y;
    for (uint32_t i = 0; i < a.size; ++i)
        y.mean_part += (a.mean[i] - b.mean[i]) * (a.mean[i] - b.mean[i]);
    const Matrix c1 = covariance_of(a), c2 = covariance_of(b);
    SR_TRY(const Matrix root, root_of(c1));
    double cross = 0;
    if (root.cols() > 0) {
        const Matrix product = root.transpose() * (c2 * root);
        const Solver solver((product + product.transpose()) / 2, Eigen::EigenvaluesOnly);
        if (solver.info() != Eigen::Success)
            return no_convergence();
        const double least = smallest(solver.eigenvalues());
        for (double v : solver.eigenvalues())
            cross += v > least ? std::sqrt(v) : 0;
    }
    y.covariance_part = std::max(c1.trace() + c2.trace() - 2 * cross, 0.);
    y.distance = y.mean_part + y.covariance_part;
    return y;
}

} // namespace semrover
