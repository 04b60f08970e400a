// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// golden kind mesh_voxelization; there is no other storage than fp32
#include "engine/mesh/voxelizer.h"
#include "tools/verify/golden_case.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

Result<Mesh> mesh_of(const GoldenCase& c)
{
    const std::vector<float> vertices = c.floats("input.vertices");
    const std::vector<int64_t> faces = c.integers("input.faces");
    Mesh mesh;
    for (size_t i = 0; i + 2 < vertices.size(); i += 3)
        mesh.positions.push_back({vertices[i], vertices[i + 1], vertices[i + 2]});
    for (size_t i = 0; i + 2 < faces.size(); i += 3) {
        for (size_t k = 0; k < 3; ++k)
            if (faces[i + k] < 0 || faces[i + k] >= int64_t(mesh.positions.size()))
                return fail(ErrorCode::bad_input, "input.faces: vertex {} of {}", faces[i + k], mesh.positions.size());
        mesh.faces.push_back({uint32_t(faces[i]), uint32_t(faces[i + 1]), uint32_t(faces[i + 2])});
    }
    return mesh;
}

} // namespace

// a voxel below min_area may be missing; any other must be there, and none of that size may be there besides
Result<GoldenOutputs> run_mesh_voxelization(Device& device, const GoldenCase& c, DType)
{
    SR_TRY(const double voxel_size, c.number("voxel_size"));
    SR_TRY(const double min_area, c.number("min_area"));
    SR_TRY(const double total_area, c.number("total_area"));
    SR_TRY(const Mesh mesh, mesh_of(c));
    VoxelizeOptions options{.voxel_size = float(voxel_size), .points_per_voxel = 1, .min_area = 0, .default_label = 0};
    SR_TRY(const VoxelizedMesh got, voxelize(device, mesh, options));
    const std::vector<int64_t> cells = c.integers("expect.cells");
    const std::vector<float> areas = c.floats("expect.area");
    GoldenOutputs out;
    std::vector<int64_t>& out_cells = out.integers["cells"];
    std::vector<float>& out_areas = out.floats["area"];
    std::vector<bool> expected(got.area.size());
    for (size_t i = 0; i < areas.size() && 3 * i + 2 < cells.size(); ++i) {
        const Cell cell = {int32_t(cells[3 * i]), int32_t(cells[3 * i + 1]), int32_t(cells[3 * i + 2])};
        const auto at = find_cell(got.grid, cell);
        if (at)
            expected[*at] = true;
        if (at || areas[i] < min_area)
            out_cells.insert(out_cells.end(), cell.begin(), cell.end());
        out_areas.push_back(at ? got.area[*at] : 0);
    }
    double sum = 0;
    for (size_t i = 0; i < got.area.size(); ++i) {
        sum += got.area[i];
        if (!expected[i] && got.area[i] >= min_area)
            out_cells.insert(out_cells.end(), got.grid.cells[i].begin(), got.grid.cells[i].end());
    }
    if (std::abs(sum - total_area) > 1e-4 * std::max(1.0, total_area))
        return fail(ErrorCode::verify_failed, "a surface of {:.7g} m^2, expected {:.7g}", sum, total_area);
    return out;
}

} // namespace semrover
