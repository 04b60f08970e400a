// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// the voxels that triangles may have area in: counted per triangle, then written where the prefix sum of counts says
#include "kernels/mesh.h"

#include "kernels/sort.h"
#include "triangle_cells_count.spv.h"
#include "triangle_cells_emit.spv.h"

namespace semrover {

SurfacePairs triangle_cells(Graph& g, Tensor records, uint32_t capacity)
{
    SR_ASSERT(records.dtype == DType::u32 && records.ld == 12 && capacity, "triangle_cells: records [{}, {}] {}",
              records.rows, records.ld, dtype_name(records.dtype));
    const TriangleCellsPush push{.size = records.rows, .capacity = capacity};
    const Tensor counts = g.array(records.rows, DType::u32, "voxels of triangles");
    g.dispatch(kernel::triangle_cells_count, {{"Triangles", records}, {"Counts", counts}}, push, threads(records.rows));
    const PrefixSum first = prefix_sum(g, counts);
    SurfacePairs pairs{g.array(capacity, DType::u32, "pair voxels"), g.array(capacity, DType::u32, "pair triangles"),
                       first.total};
    g.dispatch(kernel::triangle_cells_emit,
               {{"Triangles", records}, {"First", first.sums}, {"Keys", pairs.keys}, {"Values", pairs.triangles}}, push,
               threads(records.rows));
    return pairs;
}

} // namespace semrover
