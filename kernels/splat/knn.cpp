// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// the k nearest points of every point, exact: points sorted by the hash of their grid cell, then shells of cells
#include "kernels/splat.h"

#include "kernels/sort.h"
#include "knn_gather.spv.h"
#include "knn_hash.spv.h"
#include "knn_search.spv.h"

#include <bit>

namespace semrover {

constexpr double kCandidates = 27 * 16; // of a point: the cells around it, with more in each than surfaces have

Tensor knn(Graph& g, Tensor points, const KnnOptions& options)
{
    const uint32_t rows = points.rows;
    SR_ASSERT(points.dtype == DType::f32 && points.cols >= 3, "knn: points [{}, {}] {}", rows, points.cols,
              dtype_name(points.dtype));
    SR_ASSERT(options.neighbors >= 1 && options.neighbors <= kMaxNeighbors && options.cell_size > 0,
              "knn: {} neighbours, cells of {} m", options.neighbors, options.cell_size);
    const bool labelled = options.labels.valid();
    SR_ASSERT(!labelled || (options.labels.rows == rows && options.labels.ld == 1), "knn: {} labels for {} points",
              options.labels.rows, rows);
    const bool others = options.queries.valid();
    SR_ASSERT(!others || (options.queries.dtype == DType::f32 && options.queries.cols >= 3 && !labelled),
              "knn: queries [{}, {}]{}", options.queries.rows, options.queries.cols, labelled ? " with labels" : "");
    const uint32_t bits = std::clamp<uint32_t>(uint32_t(std::bit_width(rows / 2)), 6, 22);
    const KnnPush push{.rows = rows,
                       .points_ld = points.ld,
                       .mask = (1u << bits) - 1,
                       .cell_size = options.cell_size,
                       .per_metre = 1 / options.cell_size,
                       .radius2 = options.radius > 0 ? options.radius * options.radius : 1e38f,
                       .queries = others ? options.queries.rows : 0,
                       .queries_ld = others ? options.queries.ld : 0,
                       .min_same_label = labelled ? options.min_same_label : 0};
    const ConstantValue has_labels{"kLabels", labelled};
    const Tensor keys = g.array(rows, DType::u32, "cell hashes");
    g.dispatch(kernel::knn_hash, {{"Points", points}, {"Keys", keys}}, push, threads(rows));
    const SortedPairs order = radix_sort(g, keys, {}, {.bits = bits});
    const Tensor starts = bucket_starts(g, order.keys, 1u << bits);
    const Tensor sorted = g.array(rows, DType::f32, "sorted points", 4);
    const Tensor sorted_labels = g.array(rows, DType::u32, "sorted labels");
    g.dispatch(kernel::knn_gather,
               {{"Points", points},
                {"Labels", options.labels},
                {"Order", order.values},
                {"Sorted", sorted},
                {"SortedLabels", sorted_labels}},
               push, threads(rows), {.constants = {has_labels}});
    const uint32_t sought = others ? push.queries : rows;
    const Tensor neighbors = g.array(sought, DType::u32, "neighbours", options.neighbors);
    g.dispatch(kernel::knn_search,
               {{"Sorted", sorted},
                {"SortedLabels", sorted_labels},
                {"Starts", starts},
                {"Queries", options.queries},
                {"Neighbors", neighbors}},
               push, threads(sought),
               {.constants = {{"kNeighbors", options.neighbors}, has_labels, {"kQueries", others}},
                .max_flops = double(sought) * kCandidates * (16 + 6 * options.neighbors)});
    return neighbors;
}

} // namespace semrover
