// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/mesh/chamfer.h"

#include "engine/mesh/nearest_points.h"
#include "engine/mesh/nearest_surface.h"
#include "runtime/base/dtype.h"
#include "runtime/base/mix64.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace semrover {

namespace {

using Origin = std::array<double, 3>;

constexpr float kEverywhere = 1e18f; // metres; its square is a float too

std::vector<PointRow> points_from(const VoxelGrid& grid, const Origin& origin)
{
    const auto n = size_t(grid.points_per_voxel);
    std::vector<PointRow> rows;
    for (size_t cell = 0; cell < grid.cells.size(); ++cell) {
        if (!grid.generated[cell])
            continue;
        for (size_t i = cell * n; i < (cell + 1) * n; ++i) {
            PointRow row{};
            for (size_t a = 0; a < 3; ++a)
                row[a] = float((grid.cells[cell][a] + 0.5) * double(grid.voxel_size) +
                               half_to_float(grid.points[3 * i + a]) - origin[a]);
            rows.push_back(row);
        }
    }
    return rows;
}

// uniform in [0, 1), keyed by (seed, sample, which)
double uniform(uint64_t seed, uint64_t sample, uint64_t which)
{
    const uint64_t h = mix64(seed * 0xD1342543DE82EF95ull + (sample * 4 + which + 1) * kMixStep);
    return double(h >> 11) * 0x1p-53;
}

Result<std::vector<PointRow>> surface_samples(const Mesh& mesh, const Origin& origin, const ChamferOptions& o)
{
    std::vector<double> sums;
    double sum = 0;
    for (size_t f = 0; f < mesh.faces.size(); ++f)
        sums.push_back(sum += face_area(mesh, f));
    if (!(sum > 0))
        return fail(ErrorCode::bad_input, "the mesh has no surface");
    std::vector<PointRow> rows;
    for (uint64_t s = 0; s < o.samples; ++s) {
        const auto at = std::upper_bound(sums.begin(), sums.end(), uniform(o.seed, s, 0) * sum);
        const size_t face = std::min(size_t(at - sums.begin()), sums.size() - 1);
        const double r = std::sqrt(uniform(o.seed, s, 1)), t = uniform(o.seed, s, 2);
        const auto& f = mesh.faces[face];
        PointRow row{};
        for (size_t a = 0; a < 3; ++a)
            row[a] = float((1 - r) * mesh.positions[f[0]][a] + r * (1 - t) * mesh.positions[f[1]][a] +
                           r * t * mesh.positions[f[2]][a] - origin[a]);
        rows.push_back(row);
    }
    return rows;
}

Result<double> mean_to_surface(const NearestSurface& surface, const std::vector<PointRow>& points)
{
    SR_TRY(const std::vector<NearestFace> nearest, surface.find(points, kEverywhere));
    double sum = 0;
    for (const NearestFace& n : nearest)
        sum += n.distance;
    return sum / double(points.size());
}

Result<double> mean_to_points(Device& device, const std::vector<PointRow>& samples, const std::vector<PointRow>& points,
                              float voxel_size)
{
    SR_TRY(
        const std::vector<double> nearest,
        nearest_distances(device, samples, points, {.cell_size = voxel_size / 2, .first_radius = 1.5f * voxel_size}));
    return std::accumulate(nearest.begin(), nearest.end(), 0.0) / double(nearest.size());
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
    const std::vector<PointRow> points = points_from(grid, surface.origin());
    if (points.empty())
        return fail(ErrorCode::bad_input, "no cell of the grid has points yet");
    SR_TRY(const std::vector<PointRow> samples, surface_samples(mesh, surface.origin(), options));
    Chamfer result;
    SR_TRY(result.to_surface, mean_to_surface(surface, points));
    SR_TRY(result.to_points, mean_to_points(device, samples, points, grid.voxel_size));
    return result;
}

} // namespace semrover
