// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/scene/label_edits.h"

namespace semrover {

VoxelGrid with_edits(const VoxelGrid& grid, const LabelEdits& edits)
{
    VoxelGrid out;
    out.voxel_size = grid.voxel_size;
    out.points_per_voxel = grid.points_per_voxel;
    out.metadata = grid.metadata;
    for (size_t c = 0; c < grid.cells.size(); ++c) {
        const auto edit = edits.find(grid.cells[c]);
        if (edit == edits.end() || edit->second == grid.labels[c])
            append_cell(out, grid, c);
    }
    const size_t width = grid.has_points() ? size_t(grid.points_per_voxel) * 3 : 0;
    for (const auto& [cell, label] : edits) {
        const auto there = find_cell(grid, cell);
        if (!label || (there && grid.labels[*there] == *label))
            continue;
        out.cells.push_back(cell);
        out.labels.push_back(*label);
        out.points.insert(out.points.end(), width, 0);
        out.colors.insert(out.colors.end(), width, 0);
        if (width)
            out.generated.push_back(0);
    }
    sort_cells(out);
    return out;
}

} // namespace semrover
