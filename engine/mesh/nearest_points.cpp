// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/mesh/nearest.h"

#include "kernels/network.h"
#include "kernels/splat.h"
#include "runtime/device/executable.h"
#include "runtime/device/tensor_pool.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace semrover {

namespace {

constexpr size_t kBatch = 1 << 20; // points or queries at once
constexpr double kFar = std::numeric_limits<double>::infinity();

// lowers `best` to the distances of queries from the nearest of some points within `radius`; 0: however far
Status search_batch(Device& device, std::span<const PointRow> queries, std::span<const PointRow> batch, float cell_size,
                    float radius, std::span<double> best)
{
    const auto rows = uint32_t(queries.size());
    TensorPool state;
    const DeviceTensor points = state.tensor(uint32_t(batch.size()), 4, DType::f32, "points", 4);
    const DeviceTensor samples = state.tensor(rows, 4, DType::f32, "queries", 4);
    const DeviceTensor nearest = state.tensor(rows, 1, DType::u32, "nearest", 1);
    SR_CHECK(state.allocate(device, "points"));
    SR_CHECK(points.write(device, batch));
    SR_CHECK(samples.write(device, queries));
    Graph g(device.limits());
    KnnOptions options{.neighbors = 1, .cell_size = cell_size, .radius = radius};
    options.queries = samples.in(g);
    g.keep(knn(g, points.in(g), options), nearest);
    SR_TRY(const auto executable, Executable::create(device, g));
    SR_CHECK(executable->run());
    SR_TRY(const std::vector<uint32_t> index, nearest.read<uint32_t>(device));
    for (size_t i = 0; i < rows; ++i) {
        if (index[i] >= batch.size())
            continue;
        const PointRow &a = queries[i], &b = batch[index[i]];
        best[i] = std::min(best[i], std::hypot(double(a[0]) - b[0], double(a[1]) - b[1], double(a[2]) - b[2]));
    }
    return {};
}

Status search(Device& device, std::span<const PointRow> queries, std::span<const PointRow> points, float cell_size,
              float radius, std::span<double> best)
{
    for (size_t q = 0; q < queries.size(); q += kBatch)
        for (size_t p = 0; p < points.size(); p += kBatch) {
            const size_t count = std::min(kBatch, queries.size() - q);
            SR_CHECK(search_batch(device, queries.subspan(q, count),
                                  points.subspan(p, std::min(kBatch, points.size() - p)), cell_size, radius,
                                  best.subspan(q, count)));
        }
    return {};
}

} // namespace

Result<std::vector<double>> nearest_distances(Device& device, std::span<const PointRow> queries,
                                              std::span<const PointRow> points, const NearestPointsOptions& options)
{
    SR_ASSERT(!points.empty(), "distances from no points");
    std::vector<double> best(queries.size(), kFar);
    // within a radius the search ends after a few voxels
    SR_CHECK(search(device, queries, points, options.cell_size, options.first_radius, best));
    std::vector<PointRow> lonely;
    for (size_t i = 0; i < queries.size(); ++i)
        if (best[i] == kFar)
            lonely.push_back(queries[i]);
    std::vector<double> far(lonely.size(), kFar);
    SR_CHECK(search(device, lonely, points, options.cell_size, 0, far));
    for (size_t i = 0, next = 0; i < best.size(); ++i)
        if (best[i] == kFar)
            best[i] = far[next++];
    return best;
}

} // namespace semrover
