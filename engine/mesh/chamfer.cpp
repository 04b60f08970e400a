// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/mesh/chamfer.h"

#include "engine/mesh/triangle_tree.h"
#include "kernels/kernels.h"
#include "kernels/meshes.h"
#include "runtime/program.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace semrover {

namespace {

using Row = std::array<float, 4>;
using Origin = std::array<double, 3>;

constexpr size_t kBatch = 1 << 20; // points or queries at once

// the middle of the mesh, from which floats are exact enough
Origin origin_of(const Mesh& mesh)
{
    Origin low, high;
    low.fill(std::numeric_limits<double>::max());
    high.fill(std::numeric_limits<double>::lowest());
    for (const auto& f : mesh.faces)
        for (const uint32_t v : f)
            for (size_t a = 0; a < 3; ++a) {
                low[a] = std::min(low[a], double(mesh.positions[v][a]));
                high[a] = std::max(high[a], double(mesh.positions[v][a]));
            }
    Origin origin;
    for (size_t a = 0; a < 3; ++a)
        origin[a] = std::round((low[a] + high[a]) / 2);
    return origin;
}

std::vector<Row> points_from(const VoxelGrid& grid, const Origin& origin)
{
    const auto n = size_t(grid.points_per_voxel);
    std::vector<Row> rows;
    for (size_t cell = 0; cell < grid.cells.size(); ++cell) {
        if (!grid.generated[cell])
            continue;
        for (size_t i = cell * n; i < (cell + 1) * n; ++i) {
            Row row{};
            for (size_t a = 0; a < 3; ++a)
                row[a] = float((grid.cells[cell][a] + 0.5) * double(grid.voxel_size) +
                               half_to_float(grid.points[3 * i + a]) - origin[a]);
            rows.push_back(row);
        }
    }
    return rows;
}

std::vector<TriangleCorners> triangles_from(const Mesh& mesh, const Origin& origin)
{
    std::vector<TriangleCorners> triangles;
    for (const auto& f : mesh.faces) {
        TriangleCorners t;
        for (size_t c = 0; c < 3; ++c)
            for (size_t a = 0; a < 3; ++a)
                t[c][a] = float(mesh.positions[f[c]][a] - origin[a]);
        triangles.push_back(t);
    }
    return triangles;
}

// uniform in [0, 1), keyed by (seed, sample, which): splitmix64
double uniform(uint64_t seed, uint64_t sample, uint64_t which)
{
    uint64_t h = seed * 0xD1342543DE82EF95ull + (sample * 4 + which + 1) * 0x9E3779B97F4A7C15ull;
    h = (h ^ (h >> 30)) * 0xBF58476D1CE4E5B9ull;
    h = (h ^ (h >> 27)) * 0x94D049BB133111EBull;
    return double((h ^ (h >> 31)) >> 11) * 0x1p-53;
}

Result<std::vector<Row>> surface_samples(const Mesh& mesh, const Origin& origin, const ChamferOptions& o)
{
    std::vector<double> sums;
    double sum = 0;
    for (size_t f = 0; f < mesh.faces.size(); ++f)
        sums.push_back(sum += face_area(mesh, f));
    if (!(sum > 0))
        return fail(ErrorCode::bad_input, "the mesh has no surface");
    std::vector<Row> rows;
    for (uint64_t s = 0; s < o.samples; ++s) {
        const auto at = std::upper_bound(sums.begin(), sums.end(), uniform(o.seed, s, 0) * sum);
        const size_t face = std::min(size_t(at - sums.begin()), sums.size() - 1);
        const double r = std::sqrt(uniform(o.seed, s, 1)), t = uniform(o.seed, s, 2);
        const auto& f = mesh.faces[face];
        Row row{};
        for (size_t a = 0; a < 3; ++a)
            row[a] = float((1 - r) * mesh.positions[f[0]][a] + r * (1 - t) * mesh.positions[f[1]][a] +
                           r * t * mesh.positions[f[2]][a] - origin[a]);
        rows.push_back(row);
    }
    return rows;
}

template <typename T>
Result<std::unique_ptr<Buffer>> upload(Device& device, std::span<const T> values, const char* name)
{
    SR_TRY(auto buffer, Buffer::create(device, values.size_bytes(), MemoryKind::device, name));
    SR_CHECK(device.write(buffer->slice(), std::as_bytes(values)));
    return buffer;
}

// distances of a batch of points from all triangles, in trees that the device can bind
Result<double> sum_to_surface(Device& device, std::span<const Row> batch,
                              std::span<const std::pair<std::unique_ptr<Buffer>, std::unique_ptr<Buffer>>> trees)
{
    SR_TRY(const auto points, upload(device, batch, "points"));
    SR_TRY(const auto results, Buffer::create(device, batch.size() * 4, MemoryKind::device, "distances"));
    const auto rows = uint32_t(batch.size());
    Graph g;
    const Tensor queries = g.external(points->slice(), rows, 4, DType::f32, "points", 4);
    const Tensor y = fill(g, rows, std::bit_cast<uint32_t>(1e18f)); // its square is a float too
    for (const auto& [nodes, triangles] : trees) {
        const SurfaceTree tree{
            g.external(nodes->slice(), uint32_t(nodes->bytes() / 32), 8, DType::u32, "nodes", 8),
            g.external(triangles->slice(), uint32_t(triangles->bytes() / 36), 9, DType::f32, "triangles", 9)};
        surface_distance(g, queries, tree, y);
    }
    g.replace(y.resource, g.external(results->slice(), rows, 1, DType::u32, "distances", 1).resource);
    SR_TRY(const auto program, Program::create(device, g));
    SR_CHECK(program->run());
    std::vector<float> distances(rows);
    SR_CHECK(device.read(results->slice(), std::as_writable_bytes(std::span(distances))));
    double sum = 0;
    for (const float d : distances)
        sum += d;
    return sum;
}

Result<double> mean_to_surface(Device& device, const std::vector<Row>& points, std::vector<TriangleCorners> triangles)
{
    const size_t most = std::min<uint64_t>(1 << 20, device.limits().max_storage_range / sizeof(TriangleCorners));
    std::vector<std::pair<std::unique_ptr<Buffer>, std::unique_ptr<Buffer>>> trees;
    for (size_t first = 0; first < triangles.size(); first += most) {
        const auto begin = triangles.begin() + ptrdiff_t(first);
        const TriangleTree tree = triangle_tree({begin, begin + ptrdiff_t(std::min(most, triangles.size() - first))});
        SR_TRY(auto nodes, upload<TriangleTree::Node>(device, tree.nodes, "nodes"));
        SR_TRY(auto leaves, upload<TriangleCorners>(device, tree.triangles, "triangles"));
        trees.emplace_back(std::move(nodes), std::move(leaves));
    }
    double sum = 0;
    for (size_t first = 0; first < points.size(); first += kBatch) {
        const auto batch = std::span(points).subspan(first, std::min(kBatch, points.size() - first));
        SR_TRY(const double part, sum_to_surface(device, batch, trees));
        sum += part;
    }
    return sum / double(points.size());
}

// lowers `best` to the distances of samples from the nearest of some points within `radius`; 0: however far
Status nearest_points(Device& device, std::span<const Row> samples, std::span<const Row> batch, float cell_size,
                      float radius, std::span<double> best)
{
    SR_TRY(const auto points, upload(device, batch, "points"));
    SR_TRY(const auto queries, upload(device, samples, "samples"));
    SR_TRY(const auto results, Buffer::create(device, samples.size() * 4, MemoryKind::device, "nearest"));
    const auto rows = uint32_t(samples.size());
    Graph g;
    KnnOptions options{.neighbors = 1, .cell_size = cell_size, .radius = radius};
    options.queries = g.external(queries->slice(), rows, 4, DType::f32, "samples", 4);
    const Tensor nearest =
        knn(g, g.external(points->slice(), uint32_t(batch.size()), 4, DType::f32, "points", 4), options);
    g.replace(nearest.resource, g.external(results->slice(), rows, 1, DType::u32, "nearest", 1).resource);
    SR_TRY(const auto program, Program::create(device, g));
    SR_CHECK(program->run());
    std::vector<uint32_t> index(rows);
    SR_CHECK(device.read(results->slice(), std::as_writable_bytes(std::span(index))));
    for (size_t i = 0; i < rows; ++i) {
        if (index[i] >= batch.size())
            continue;
        const Row &a = samples[i], &b = batch[index[i]];
        best[i] = std::min(best[i], std::hypot(double(a[0]) - b[0], double(a[1]) - b[1], double(a[2]) - b[2]));
    }
    return {};
}

Result<double> mean_to_points(Device& device, const std::vector<Row>& samples, const std::vector<Row>& points,
                              float voxel_size)
{
    constexpr double kFar = std::numeric_limits<double>::infinity();
    std::vector<double> best(samples.size(), kFar);
    const auto search = [&](std::span<const Row> queries, std::span<double> found, float radius) -> Status {
        for (size_t q = 0; q < queries.size(); q += kBatch)
            for (size_t p = 0; p < points.size(); p += kBatch) {
                const size_t count = std::min(kBatch, queries.size() - q);
                SR_CHECK(nearest_points(device, queries.subspan(q, count),
                                        std::span(points).subspan(p, std::min(kBatch, points.size() - p)),
                                        voxel_size / 2, radius, found.subspan(q, count)));
            }
        return {};
    };
    // within a radius the search ends after a few cells; the few samples that have no point there see all points
    SR_CHECK(search(samples, best, 1.5f * voxel_size));
    std::vector<Row> lonely;
    for (size_t i = 0; i < samples.size(); ++i)
        if (best[i] == kFar)
            lonely.push_back(samples[i]);
    std::vector<double> far(lonely.size(), kFar);
    SR_CHECK(search(lonely, far, 0));
    double sum = 0;
    for (size_t i = 0, next = 0; i < best.size(); ++i)
        sum += best[i] == kFar ? far[next++] : best[i];
    return sum / double(best.size());
}

} // namespace

Result<Chamfer> chamfer(Device& device, const Mesh& mesh, const VoxelGrid& grid, const ChamferOptions& options)
{
    SR_CHECK(check_mesh(mesh, "the mesh"));
    if (!grid.has_points())
        return fail(ErrorCode::bad_input, "the grid has no points");
    if (options.samples < 1 || options.samples > 1u << 26)
        return fail(ErrorCode::bad_input, "expected 1 to 2^26 samples of the surface, found {}", options.samples);
    const Origin origin = origin_of(mesh);
    const std::vector<Row> points = points_from(grid, origin);
    if (points.empty())
        return fail(ErrorCode::bad_input, "no cell of the grid has points yet");
    SR_TRY(const std::vector<Row> samples, surface_samples(mesh, origin, options));
    Chamfer result;
    SR_TRY(result.to_surface, mean_to_surface(device, points, triangles_from(mesh, origin)));
    SR_TRY(result.to_points, mean_to_points(device, samples, points, grid.voxel_size));
    return result;
}

} // namespace semrover
