// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// the nearest triangle of every point, exact, through a grid of cells with the triangles that reach into them
#include "kernels/fusion.h"

#include "nearest_face.spv.h"
#include "shaders/nearest_face.h"

namespace semrover {

Tensor nearest_face(Graph& g, Tensor points, const FaceGrid& grid, float radius)
{
    const uint32_t cells = grid.cells[0] * grid.cells[1] * grid.cells[2];
    SR_ASSERT(points.ld == 4 && grid.corners.ld == 4 && grid.starts.rows == cells + 1 && grid.cell_size > 0,
              "nearest_face: points of {} numbers, {} starts of {} cells", points.ld, grid.starts.rows, cells);
    const NearestFacePush push{.rows = points.rows,
                               .cells_x = grid.cells[0],
                               .cells_y = grid.cells[1],
                               .cells_z = grid.cells[2],
                               .low_x = grid.low[0],
                               .low_y = grid.low[1],
                               .low_z = grid.low[2],
                               .cell_size = grid.cell_size,
                               .radius = radius};
    const Tensor nearest = g.array(points.rows, DType::u32, "nearest faces", 2);
    g.dispatch(kernel::nearest_face, {points, grid.corners, grid.starts, grid.members, nearest}, push,
               threads(points.rows));
    return nearest;
}

} // namespace semrover
