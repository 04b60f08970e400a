// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/eval/kernel_distance.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <Eigen/Dense>
#include <random>
#include <span>
#include <system_error>
#include <thread>

namespace semrover {

namespace {

using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
constexpr Eigen::Index kBlock = 256; // samples a side of a block of the kernel matrix

// samples of a set, as rows
struct Samples {
    Rows rows;
    Eigen::VectorXd norms; // squared lengths

    explicit Samples(Rows values) : rows(std::move(values)), norms(rows.rowwise().squaredNorm()) {}
    static Samples all(const Features& f) { return Samples(Eigen::Map<const Rows>(f.values.data(), f.rows, f.cols)); }
    static Samples pooled(const Features& a, const Features& b)
    {
        Rows rows(Eigen::Index(a.rows) + b.rows, a.cols);
        rows.topRows(a.rows) = Eigen::Map<const Rows>(a.values.data(), a.rows, a.cols);
        rows.bottomRows(b.rows) = Eigen::Map<const Rows>(b.values.data(), b.rows, b.cols);
        return Samples(std::move(rows));
    }
    static Samples chosen(const Features& f, std::span<const uint32_t> index)
    {
        Rows rows(Eigen::Index(index.size()), f.cols);
        for (size_t i = 0; i < index.size(); ++i)
            rows.row(Eigen::Index(i)) = Eigen::Map<const Eigen::RowVectorXd>(f.row(index[i]), f.cols);
        return Samples(std::move(rows));
    }
    Eigen::Index size() const { return rows.rows(); }
};

// kernel values of a block, from its dot products
void apply(const SampleKernel& k, const Samples& x, Eigen::Index i, const Samples& y, Eigen::Index j, Rows& block)
{
    if (k.kind == SampleKernel::Kind::polynomial) {
        block = (k.gamma * block.array() + k.coefficient).matrix();
        const Rows base = block;
        for (int power = 1; power < k.degree; ++power)
            block.array() *= base.array();
        return;
    }
    const double scale = -1 / (2 * k.bandwidth * k.bandwidth);
    for (Eigen::Index r = 0; r < block.rows(); ++r)
        for (Eigen::Index c = 0; c < block.cols(); ++c) {
            const double distance2 = std::max(x.norms[i + r] + y.norms[j + c] - 2 * block(r, c), 0.);
            block(r, c) = std::exp(scale * distance2);
        }
}

void in_parallel(size_t count, const std::function<void(size_t)>& body)
{
    std::atomic<size_t> next = 0;
    const auto work = [&] {
        for (size_t i = next++; i < count; i = next++)
            body(i);
    };
    std::vector<std::jthread> threads; // joined when they go
    try {
        for (size_t t = 1; t < std::min<size_t>(std::thread::hardware_concurrency(), count); ++t)
            threads.emplace_back(work);
    } catch (const std::system_error&) { // no more threads: those that are there do it
    }
    work();
}

// the whole kernel matrix of pooled samples, for subsets that overlap so often that it is less work
constexpr uint32_t kMaxPooled = 8192;
Rows kernel_matrix(const SampleKernel& k, const Samples& x)
{
    Rows y(x.size(), x.size());
    in_parallel(size_t((x.size() + kBlock - 1) / kBlock), [&](size_t b) {
        const Eigen::Index i = Eigen::Index(b) * kBlock, rows = std::min(kBlock, x.size() - i);
        for (Eigen::Index j = 0; j <= i; j += kBlock) {
            const Eigen::Index cols = std::min(kBlock, x.size() - j);
            Rows block = x.rows.middleRows(i, rows) * x.rows.middleRows(j, cols).transpose();
            apply(k, x, i, x, j, block);
            y.block(i, j, rows, cols) = block;
        }
    });
    y.triangularView<Eigen::StrictlyUpper>() = y.transpose();
    return y;
}

// sums of a kernel matrix: everything, and the diagonal
struct KernelSum {
    double all = 0, diagonal = 0;
};

// the upper half of the blocks, twice, when both sets are the same one
KernelSum sum_block(const SampleKernel& k, const Samples& x, Eigen::Index i, const Samples& y, Eigen::Index j,
                    bool same)
{
    const Eigen::Index rows = std::min(kBlock, x.size() - i), cols = std::min(kBlock, y.size() - j);
    Rows block = x.rows.middleRows(i, rows) * y.rows.middleRows(j, cols).transpose();
    apply(k, x, i, y, j, block);
    KernelSum sum{block.sum(), 0};
    if (same && i == j)
        sum.diagonal = block.diagonal().sum();
    else if (same)
        sum.all *= 2;
    return sum;
}

KernelSum sum_kernel(const SampleKernel& k, const Samples& x, const Samples& y, bool same)
{
    std::vector<std::pair<Eigen::Index, Eigen::Index>> blocks;
    for (Eigen::Index i = 0; i < x.size(); i += kBlock)
        for (Eigen::Index j = same ? i : 0; j < y.size(); j += kBlock)
            blocks.emplace_back(i, j);
    std::vector<KernelSum> sums(blocks.size());
    in_parallel(blocks.size(),
                [&](size_t b) { sums[b] = sum_block(k, x, blocks[b].first, y, blocks[b].second, same); });
    KernelSum total;
    for (const KernelSum& s : sums) { // in the order of blocks, whoever made them
        total.all += s.all;
        total.diagonal += s.diagonal;
    }
    return total;
}

Status check_sets(const Features& a, const Features& b)
{
    if (a.cols != b.cols)
        return fail(ErrorCode::bad_input, "{} features a sample on one side and {} on the other: of different networks",
                    a.cols, b.cols);
    if (a.rows < 2 || b.rows < 2)
        return fail(ErrorCode::bad_input, "{} and {} samples; each set needs two or more", a.rows, b.rows);
    return {};
}

SampleKernel with_defaults(SampleKernel k, uint32_t size)
{
    SR_ASSERT(k.degree >= 1 && (k.kind != SampleKernel::Kind::rbf || k.bandwidth > 0),
              "a kernel of degree {}, bandwidth {}", k.degree, k.bandwidth);
    k.gamma = k.gamma == 0 ? 1.0 / size : k.gamma;
    return k;
}

Discrepancy combine(const KernelSum& xx, const KernelSum& yy, double xy, double n, double m)
{
    const double cross = 2 * xy / (n * m);
    Discrepancy d;
    d.unbiased = (xx.all - xx.diagonal) / (n * (n - 1)) + (yy.all - yy.diagonal) / (m * (m - 1)) - cross;
    d.biased = std::max(xx.all / (n * n) + yy.all / (m * m) - cross, 0.);
    return d;
}

Discrepancy discrepancy_of(const Samples& x, const Samples& y, const SampleKernel& k)
{
    return combine(sum_kernel(k, x, x, true), sum_kernel(k, y, y, true), sum_kernel(k, x, y, false).all,
                   double(x.size()), double(y.size()));
}

// the same from the kernel matrix of pooled samples
Discrepancy discrepancy_of(const Rows& matrix, std::span<const uint32_t> x, std::span<const uint32_t> y)
{
    const auto sum = [&](std::span<const uint32_t> rows, std::span<const uint32_t> cols) {
        KernelSum s;
        for (const uint32_t i : rows) {
            const double* row = matrix.data() + Eigen::Index(i) * matrix.cols();
            double of_row = 0;
            for (const uint32_t j : cols)
                of_row += row[j];
            s.all += of_row;
            s.diagonal += row[i];
        }
        return s;
    };
    return combine(sum(x, x), sum(y, y), sum(x, y).all, double(x.size()), double(y.size()));
}

// `count` different numbers below `size`
std::vector<uint32_t> choose(uint32_t size, uint32_t count, std::mt19937_64& random)
{
    std::vector<uint32_t> all(size);
    for (uint32_t i = 0; i < size; ++i)
        all[i] = i;
    for (uint32_t i = 0; i < count; ++i) // not std::shuffle, which each library does in its own way
        std::swap(all[i], all[i + random() % (size - i)]);
    all.resize(count);
    return all;
}

} // namespace

Result<Discrepancy> discrepancy(const Features& a, const Features& b, const SampleKernel& kernel)
{
    SR_CHECK(check_sets(a, b));
    return discrepancy_of(Samples::all(a), Samples::all(b), with_defaults(kernel, a.cols));
}

Result<double> median_distance(const Features& a, const Features& b)
{
    SR_CHECK(check_sets(a, b));
    const size_t total = size_t(a.rows) + b.rows, count = std::min<size_t>(total, kMedianSamples);
    Rows rows(Eigen::Index(count), a.cols);
    for (size_t i = 0; i < count; ++i) {
        const size_t from = i * total / count;
        const double* row = from < a.rows ? a.row(from) : b.row(from - a.rows);
        rows.row(Eigen::Index(i)) = Eigen::Map<const Eigen::RowVectorXd>(row, a.cols);
    }
    std::vector<double> distances;
    distances.reserve(count * (count - 1) / 2);
    for (Eigen::Index i = 0; i < rows.rows(); ++i)
        for (Eigen::Index j = 0; j < i; ++j)
            distances.push_back((rows.row(i) - rows.row(j)).norm());
    const auto middle = distances.begin() + int64_t(distances.size() / 2);
    std::nth_element(distances.begin(), middle, distances.end());
    if (*middle <= 0)
        return fail(ErrorCode::bad_input, "most samples are the same: their median distance is 0; give --bandwidth");
    return *middle;
}

Result<SubsetDistance> subset_distance(const Features& a, const Features& b, const SubsetOptions& o)
{
    SR_CHECK(check_sets(a, b));
    if (o.size < 2 || o.subsets < 1 || o.size > std::min(a.rows, b.rows))
        return fail(ErrorCode::bad_input, "subsets of {} out of {} and {} samples: too few samples", o.size, a.rows,
                    b.rows);
    const SampleKernel kernel = with_defaults(o.kernel, a.cols);
    const uint64_t total = uint64_t(a.rows) + b.rows;
    Rows matrix;
    if (total <= kMaxPooled && total * total / 2 < uint64_t(o.subsets) * o.size * o.size * 2)
        matrix = kernel_matrix(kernel, Samples::pooled(a, b));
    std::mt19937_64 random(o.seed);
    std::vector<double> values;
    for (uint32_t s = 0; s < o.subsets; ++s) {
        auto x = choose(a.rows, o.size, random), y = choose(b.rows, o.size, random);
        if (matrix.size()) {
            for (uint32_t& i : y)
                i += a.rows;
            values.push_back(discrepancy_of(matrix, x, y).unbiased);
        } else {
            values.push_back(discrepancy_of(Samples::chosen(a, x), Samples::chosen(b, y), kernel).unbiased);
        }
        if (o.moved)
            SR_CHECK(o.moved(s + 1));
    }
    SubsetDistance d;
    for (double v : values)
        d.mean += v / double(values.size());
    for (double v : values)
        d.deviation += (v - d.mean) * (v - d.mean) / double(values.size());
    d.deviation = std::sqrt(d.deviation);
    return d;
}

} // namespace semrover
