// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// areas and labels of voxels from those of their pairs, one thread per voxel, in the order of the pairs
#include "kernels/mesh.h"

#include "cell_area.spv.h"

namespace semrover {

CellAreas cell_area(Graph& g, Tensor areas, Tensor labels, Tensor starts, uint32_t cells)
{
    SR_ASSERT(areas.rows == labels.rows && starts.rows == cells + 1, "cell_area: {} areas, {} labels, {} starts",
              areas.rows, labels.rows, starts.rows);
    const CellAreas y{g.array(areas.rows, DType::f32, "area sums"), g.array(cells, DType::f32, "voxel areas"),
                      g.array(cells, DType::u32, "voxel labels"), g.array(cells, DType::f32, "unlabelled areas")};
    g.dispatch(kernel::cell_area,
               {{"Areas", areas},
                {"Labels", labels},
                {"Starts", starts},
                {"Sums", y.sums},
                {"Cells", y.areas},
                {"CellLabels", y.labels},
                {"Unlabelled", y.unlabelled}},
               CellAreaPush{.cells = cells}, threads(cells));
    return y;
}

} // namespace semrover
