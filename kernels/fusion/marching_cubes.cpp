// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// the surface distance = 0 in sparse blocks: cases of cells, vertices of edges, their numbers by prefix sums
#include "kernels/fusion.h"

#include "marching_cubes_classify.spv.h"
#include "marching_cubes_count.spv.h"
#include "marching_cubes_faces.spv.h"
#include "marching_cubes_vertices.spv.h"

namespace semrover {

namespace {

MarchingCubesPush make_push(const MarchingCubesField& f, uint32_t rows, const MarchingCubesRange& range = {})
{
    const uint64_t voxels = uint64_t(f.blocks.rows) * kTsdfBlockVoxels;
    SR_ASSERT(f.distances.rows == voxels && f.attributes.rows == voxels && f.bitmap.rows == f.ranks.rows,
              "marching_cubes: {} distances and {} attributes of {} blocks", f.distances.rows, f.attributes.rows,
              f.blocks.rows);
    return {.rows = rows,
            .blocks_x = f.blocks_x,
            .blocks_y = f.blocks_y,
            .blocks_z = f.blocks_z,
            .min_views = f.min_views,
            .max_jump = f.max_jump,
            .first_row = range.first,
            .first_vertex = range.first_vertex,
            .first_face = range.first_face};
}

} // namespace

void marching_cubes_count(Graph& g, const MarchingCubesField& f, Tensor table, const MarchingCubesCounts& counts)
{
    const uint32_t blocks = f.blocks.rows, voxels = blocks * kTsdfBlockVoxels;
    SR_ASSERT(counts.cases.rows == voxels && counts.edges.rows == voxels && counts.first_vertex.rows == blocks &&
                  counts.first_face.rows == blocks,
              "marching_cubes_count: cases of {} voxels, first vertices of {} blocks", counts.cases.rows,
              counts.first_vertex.rows);
    g.dispatch(kernel::marching_cubes_classify,
               {{"Bitmap", f.bitmap},
                {"Ranks", f.ranks},
                {"Blocks", f.blocks},
                {"Distances", f.distances},
                {"Attributes", f.attributes},
                {"Cases", counts.cases}},
               make_push(f, voxels), threads(voxels));
    const Tensor vertices = g.array(blocks, DType::u32, "vertices of blocks");
    const Tensor faces = g.array(blocks, DType::u32, "faces of blocks");
    g.dispatch(kernel::marching_cubes_count,
               {{"Bitmap", f.bitmap},
                {"Ranks", f.ranks},
                {"Blocks", f.blocks},
                {"Cases", counts.cases},
                {"Table", table},
                {"Edges", counts.edges},
                {"Vertices", vertices},
                {"Faces", faces}},
               make_push(f, blocks), threads(blocks * 64));
    for (const auto& [sizes, first, total] :
         {std::tuple{vertices, counts.first_vertex, counts.vertices}, {faces, counts.first_face, counts.faces}}) {
        const PrefixSum sums = prefix_sum(g, sizes);
        g.keep(sums.sums, first);
        g.keep(sums.total, total);
    }
}

void marching_cubes_vertices(Graph& g, const MarchingCubesField& f, const MarchingCubesCounts& counts,
                             const MarchingCubesRange& range, Tensor vertices)
{
    SR_ASSERT(vertices.ld == 4, "marching_cubes_vertices: rows of {} numbers", vertices.ld);
    g.dispatch(kernel::marching_cubes_vertices,
               {{"Bitmap", f.bitmap},
                {"Ranks", f.ranks},
                {"Blocks", f.blocks},
                {"Distances", f.distances},
                {"Attributes", f.attributes},
                {"Edges", counts.edges},
                {"First", counts.first_vertex},
                {"Vertices", vertices}},
               make_push(f, range.count, range), threads(range.count * kTsdfBlockVoxels));
}

void marching_cubes_faces(Graph& g, const MarchingCubesField& f, const MarchingCubesCounts& counts, Tensor table,
                          const MarchingCubesRange& range, Tensor faces)
{
    SR_ASSERT(faces.ld == 3, "marching_cubes_faces: rows of {} numbers", faces.ld);
    g.dispatch(kernel::marching_cubes_faces,
               {{"Bitmap", f.bitmap},
                {"Ranks", f.ranks},
                {"Blocks", f.blocks},
                {"Cases", counts.cases},
                {"Edges", counts.edges},
                {"Table", table},
                {"FirstVertex", counts.first_vertex},
                {"FirstFace", counts.first_face},
                {"Faces", faces}},
               make_push(f, range.count, range), threads(range.count * 64));
}

} // namespace semrover
