// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/streets/street_grid.h"

#include "tools/streets/class_label.h"

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

} // namespace semrover
