// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/grid.h"

#include <functional>

namespace semrover {

struct WorldBox {
    std::array<double, 3> low = {}, high = {}; // metres
};
struct WorldSphere {
    std::array<double, 3> center = {};
    double radius = 0; // metres
};

// Selects the voxels for which all given conditions hold. A voxel is in a box or sphere when its centre is, surface
// included.
struct CellSelection {
    std::optional<uint8_t> label;
    std::optional<WorldBox> box;
    std::optional<WorldSphere> sphere;
    std::optional<Cell> object; // the 26-connected component of equal label that holds this voxel

    bool any() const { return label || box || sphere || object; }
    bool bounded() const { return box || sphere; }
    bool holds_place(const Cell& cell, float voxel_size) const; // box and sphere only
};

// indices into `grid` of the voxels selected, ascending. bad_input when `object` names a place that is empty.
Result<std::vector<uint32_t>> select_cells(const VoxelGrid& grid, const CellSelection& selection);

// voxels connected with `start` through faces, edges and corners for which `same` holds, sorted; `start` is one
std::vector<Cell> connected_cells(const Cell& start, const std::function<bool(const Cell&)>& same);

// every place, occupied or not, inside the box and sphere of a bounded selection, sorted; bad_input for more than 2^22
Result<std::vector<Cell>> places_in(const CellSelection& selection, float voxel_size);

// what people write: "car" or "13"; "x0,y0,z0:x1,y1,z1"; "x,y,z,radius"; "i,j,k"; "x,y,z". Errors: usage
Result<uint8_t> parse_class(std::string_view text);
Result<WorldBox> parse_box(std::string_view text);
Result<WorldSphere> parse_sphere(std::string_view text);
Result<Cell> parse_cell(std::string_view text);
Result<std::array<double, 3>> parse_point(std::string_view text);

// bad_input for numbers that are not finite or beyond 1e7 m, a box whose low corner is above its high one, a radius
// that is not above 0
Status check_box(const WorldBox& box);
Status check_sphere(const WorldSphere& sphere);

} // namespace semrover
