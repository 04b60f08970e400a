// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/mesh/chamfer.h"

#include "engine/mesh/nearest.h"
#include "engine/mesh/surface_blocks.h"
#include "engine/mesh/transparency.h"
#include "runtime/base/dtype.h"
#include "runtime/base/keyed_random.h"

#include <algorithm>
#include <cmath>
#include <functional>

namespace semrover {

namespace {

using Origin = std::array<double, 3>;

constexpr float kEverywhere = 1e18f; // metres; its square is a float too

std::vector<PointRow> rows_from(const MeasuredPoints& points, const Origin& origin)
{
    std::vector<PointRow> rows;
    rows.reserve(points.positions.size());
    for (const Point3& p : points.positions)
        rows.push_back({float(p[0] - origin[0]), float(p[1] - origin[1]), float(p[2] - origin[2]), 0});
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
                           r * t * mesh.positions[f[2]][a] + (mesh.origin[a] - origin[a]));
        rows.push_back(row);
    }
    return rows;
}

// means of distances and of their squares
struct Means {
    double distance = 0, square = 0;
};

Means means_of(const std::vector<double>& distances)
{
    Means sum;
    for (const double d : distances) {
        sum.distance += d;
        sum.square += d * d;
    }
    return {sum.distance / double(distances.size()), sum.square / double(distances.size())};
}

Result<Means> means_to_surface(const NearestSurface& surface, const std::vector<PointRow>& points)
{
    SR_TRY(const std::vector<NearestFace> nearest, surface.find(points, kEverywhere));
    std::vector<double> distances;
    for (const NearestFace& n : nearest)
        distances.push_back(n.distance);
    return means_of(distances);
}

Result<Means> means_to_points(Device& device, const std::vector<PointRow>& from, const std::vector<PointRow>& points,
                              double spacing)
{
    const NearestPointsOptions options{.cell_size = float(spacing) / 2, .first_radius = 1.5f * float(spacing)};
    SR_TRY(const std::vector<double> nearest, nearest_distances(device, from, points, options));
    return means_of(nearest);
}

// whole metres
Origin middle_of(const MeasuredPoints& points)
{
    Origin middle{};
    for (const Point3& p : points.positions)
        for (size_t a = 0; a < 3; ++a)
            middle[a] += p[a] / double(points.positions.size());
    for (double& x : middle)
        x = std::floor(x);
    return middle;
}

} // namespace

MeasuredPoints measured_points(const VoxelGrid& grid, std::optional<double> cell_edge)
{
    const double edge = cell_edge.value_or(grid.voxel_size);
    MeasuredPoints out{{}, edge};
    const auto n = size_t(grid.points_per_voxel);
    for (size_t cell = 0; cell < grid.cells.size() && grid.has_points(); ++cell) {
        if (!grid.generated[cell])
            continue;
        for (size_t i = cell * n; i < (cell + 1) * n; ++i) {
            Point3& p = out.positions.emplace_back();
            for (size_t a = 0; a < 3; ++a)
                p[a] = (grid.cells[cell][a] + 0.5) * edge + half_to_float(grid.points[3 * i + a]);
        }
    }
    return out;
}

MeasuredPoints measured_points(std::vector<Point3> positions)
{
    std::array<double, 3> extent{};
    for (size_t a = 0; a < 3 && !positions.empty(); ++a) {
        const auto [low, high] = std::ranges::minmax(positions, {}, [a](const Point3& p) { return p[a]; });
        extent[a] = high[a] - low[a];
    }
    std::ranges::sort(extent, std::greater());
    // as if they lay on the box's largest side, and of an edge that holds as many as a grid's voxel
    const double apart = std::sqrt(extent[0] * extent[1] / double(std::max<size_t>(positions.size(), 1)));
    return {std::move(positions), std::clamp(4 * apart, 0.05, 5.0)};
}

Result<Chamfer> chamfer(Device& device, const Mesh& mesh, const MeasuredPoints& points, const ChamferOptions& options)
{
    SR_CHECK(check_mesh(mesh, "the mesh"));
    if (points.positions.empty())
        return fail(ErrorCode::bad_input, "there are no points");
    if (options.samples < 1 || options.samples > 1u << 26)
        return fail(ErrorCode::bad_input, "expected 1 to 2^26 samples of the surface, found {}", options.samples);
    if (has_transparency(mesh))
        return chamfer(device, opaque_parts(mesh).mesh, points, options);
    SR_TRY(const NearestSurface surface, NearestSurface::create(device, mesh));
    const std::vector<PointRow> rows = rows_from(points, surface.origin());
    SR_TRY(const std::vector<PointRow> samples, surface_samples(mesh, surface.origin(), options));
    SR_TRY(const Means to_surface, means_to_surface(surface, rows));
    SR_TRY(const Means to_points, means_to_points(device, samples, rows, points.spacing));
    return Chamfer{to_surface.distance, to_points.distance, to_surface.square + to_points.square};
}

Result<Chamfer> chamfer(Device& device, const MeasuredPoints& truth, const MeasuredPoints& points)
{
    if (truth.positions.empty() || points.positions.empty())
        return fail(ErrorCode::bad_input, "there are no points");
    const Origin origin = middle_of(truth);
    const std::vector<PointRow> a = rows_from(truth, origin), b = rows_from(points, origin);
    SR_TRY(const Means to_truth, means_to_points(device, b, a, truth.spacing));
    SR_TRY(const Means to_points, means_to_points(device, a, b, points.spacing));
    return Chamfer{to_truth.distance, to_points.distance, to_truth.square + to_points.square};
}

} // namespace semrover
