// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/mesh/chamfer.h"

#include "engine/mesh/nearest_surface.h"
#include "kernels/kernels.h"
#include "runtime/program.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace semrover {

namespace {

using Row = std::array<float, 4>;
using Origin = std::array<double, 3>;

constexpr size_t kBatch = 1 << 20;   // points or queries at once
constexpr float kEverywhere = 1e18f; // metres; its square is a float too

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

Result<double> mean_to_surface(const NearestSurface& surface, const std::vector<Row>& points)
{
    SR_TRY(const std::vector<NearestFace> nearest, surface.find(points, kEverywhere));
    double sum = 0;
    for (const NearestFace& n : nearest)
        sum += n.distance;
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
    SR_TRY(const NearestSurface surface, NearestSurface::create(device, mesh));
    const std::vector<Row> points = points_from(grid, surface.origin());
    if (points.empty())
        return fail(ErrorCode::bad_input, "no cell of the grid has points yet");
    SR_TRY(const std::vector<Row> samples, surface_samples(mesh, surface.origin(), options));
    Chamfer result;
    SR_TRY(result.to_surface, mean_to_surface(surface, points));
    SR_TRY(result.to_points, mean_to_points(device, samples, points, grid.voxel_size));
    return result;
}

} // namespace semrover
