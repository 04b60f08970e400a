// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/streets/street_grid.h"

#include "engine/scene/cell_reach.h"
#include "runtime/device/executable.h"
#include "runtime/device/tensor_pool.h"
#include "tools/streets/class_label.h"
#include "tools/trace/trace_scene.h"

#include <bit>
#include <cmath>
#include <numbers>

namespace semrover {

namespace {

// faces of one class
Mesh part_of(const Mesh& mesh, uint8_t wanted)
{
    Mesh part;
    for (size_t f = 0; f < mesh.faces.size(); ++f) {
        if (mesh.face_labels[f] != wanted)
            continue;
        const uint32_t first = uint32_t(part.positions.size());
        for (uint32_t v : mesh.faces[f])
            part.positions.push_back(mesh.positions[v]);
        part.faces.push_back({first, first + 1, first + 2});
        part.face_labels.push_back(wanted);
    }
    return part;
}

// Voxels with enough of a mesh; none, where voxels are so large that it is too narrow for all of them: an error of the
// voxelizer then, unless cells with as little as `least` of it are found.
Result<std::vector<Cell>> cells_of(Device& device, const Mesh& mesh, VoxelizeOptions options, float least)
{
    if (Result<VoxelizedMesh> found = voxelize(device, mesh, options); found || options.min_area <= least)
        return found.map([](VoxelizedMesh& v) { return std::move(v.grid.cells); });
    options.min_area = least;
    return voxelize(device, mesh, options).map([](const VoxelizedMesh&) { return std::vector<Cell>(); });
}

struct Ray {
    std::array<float, 3> origin;
    float near;
    std::array<float, 3> direction;
    float far;
};
using Hit = std::array<uint32_t, 4>; // kernels/trace.h

// Fibonacci's lattice on the sphere
std::vector<Ray> rays_from(const Point3& eye, const SeenOptions& options)
{
    std::vector<Ray> rays;
    for (uint32_t i = 0; i < options.rays; ++i) {
        const double z = 1 - (2 * i + 1.0) / options.rays, r = std::sqrt(1 - z * z);
        const double turn = 2 * std::numbers::pi * std::fmod(i * std::numbers::phi, 1.0);
        rays.push_back({{float(eye[0]), float(eye[1]), float(eye[2])},
                        0,
                        {float(r * std::cos(turn)), float(r * std::sin(turn)), float(z)},
                        float(options.reach)});
    }
    return rays;
}

std::vector<Point3> eyes_along(std::span<const CameraPath> paths, double spacing)
{
    std::vector<Point3> eyes;
    for (const CameraPath& path : paths) {
        const size_t first = eyes.size();
        for (const CameraFrame& frame : path.frames) {
            const Point3 p = translation_of(frame.pose.camera_to_world());
            const auto apart = [&p](const Point3& q) { return std::hypot(p[0] - q[0], p[1] - q[1], p[2] - q[2]); };
            if (eyes.size() == first || apart(eyes.back()) >= spacing)
                eyes.push_back(p);
        }
    }
    return eyes;
}

// the voxel of a hit; a surface that lies between two voxels belongs to the occupied one
std::optional<size_t> cell_of(const VoxelGrid& grid, const Ray& ray, double t)
{
    for (double step : {0.0, 1e-3, -1e-3}) {
        std::array<double, 3> p;
        for (size_t a = 0; a < 3; ++a)
            p[a] = ray.origin[a] + (t + step) * ray.direction[a];
        if (const auto at = find_cell(grid, cell_at(p, grid.voxel_size)))
            return at;
    }
    return std::nullopt;
}

} // namespace

Result<StreetGrids> street_grids(Device& device, const Street& street, const VoxelizeOptions& options, float lane_share)
{
    SR_TRY(VoxelizedMesh all, voxelize(device, street.mesh, options));
    StreetGrids grids{std::move(all.grid), {}};
    const Mesh lanes = part_of(street.mesh, label::kRoadLane);
    if (!lanes.faces.empty()) {
        VoxelizeOptions coarse = options;
        coarse.points_per_voxel = 1;
        coarse.min_area = lane_share;
        SR_TRY(const std::vector<Cell> marked, cells_of(device, lanes, coarse, options.min_area));
        for (const Cell& cell : marked)
            if (const auto at = find_cell(grids.truth, cell))
                grids.truth.labels[*at] = label::kRoadLane;
    }
    grids.semantic = grids.truth;
    grids.semantic.points.clear();
    grids.semantic.colors.clear();
    grids.semantic.generated.clear();
    return grids;
}

StreetGrids part_of(const StreetGrids& grids, std::span<const uint32_t> cells)
{
    StreetGrids part;
    for (const auto& [from, to] : {std::pair(&grids.truth, &part.truth), {&grids.semantic, &part.semantic}}) {
        to->voxel_size = from->voxel_size;
        to->points_per_voxel = from->points_per_voxel;
        to->metadata = from->metadata;
        for (const uint32_t c : cells)
            append_cell(*to, *from, c);
    }
    return part;
}

Result<std::vector<uint32_t>> seen_cells(Device& device, const Mesh& mesh, const VoxelGrid& grid,
                                         std::span<const CameraPath> paths, const SeenOptions& options)
{
    SR_TRY(const DeviceTraceScene scene, DeviceTraceScene::create(device, trace_tables(mesh, {})));
    TensorPool memory;
    const DeviceTensor cast = memory.tensor(options.rays, 8, DType::f32, "rays", 8);
    const DeviceTensor hits = memory.tensor(options.rays, 4, DType::u32, "hits", 4);
    SR_CHECK(memory.allocate(device, "rays"));
    Graph g(device.limits());
    g.keep(trace_rays(g, scene.in(g), cast.in(g)), hits);
    SR_TRY(const auto executable, Executable::create(device, g));

    std::vector<bool> seen(grid.cells.size());
    for (const Point3& eye : eyes_along(paths, options.pose_spacing)) {
        const std::vector<Ray> rays = rays_from(eye, options);
        SR_CHECK(cast.write(device, rays));
        SR_CHECK(executable->run());
        SR_TRY(const std::vector<Hit> found, hits.read<Hit>(device));
        for (size_t i = 0; i < rays.size(); ++i)
            if (found[i][3] != ~0u)
                if (const auto at = cell_of(grid, rays[i], std::bit_cast<float>(found[i][0])))
                    seen[*at] = true;
    }
    std::vector<uint32_t> list;
    for (size_t i = 0; i < seen.size(); ++i)
        if (seen[i])
            list.push_back(uint32_t(i));
    return list;
}

} // namespace semrover
