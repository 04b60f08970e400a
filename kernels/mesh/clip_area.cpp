// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// area of triangles within voxels, and where the texels that say their labels are
#include "kernels/mesh.h"

#include "clip_area.spv.h"

namespace semrover {

constexpr double kOperationsPerPair = 4000;        // six planes, up to eleven corners
constexpr double kOperationsPerMaskedPair = 20000; // and 64 places

SurfaceAreas clip_area(Graph& g, const SurfaceTriangles& s, const SurfacePairs& pairs)
{
    SR_ASSERT(s.records.ld == 12 && s.attributes.ld == 16 && s.attributes.rows == s.records.rows &&
                  s.materials.ld == 8 && s.textures.ld == 4,
              "clip_area: {} records of {} words, {} attributes of {}", s.records.rows, s.records.ld, s.attributes.rows,
              s.attributes.ld);
    const uint32_t size = pairs.keys.rows;
    const SurfaceAreas y{g.array(size, DType::f32, "pair areas"), g.array(size, DType::u32, "pair labels"),
                         g.array(size, DType::u32, "label addresses")};
    g.dispatch(kernel::clip_area,
               {{"Triangles", s.records},
                {"Attributes", s.attributes},
                {"Materials", s.materials},
                {"Textures", s.textures},
                {"Count", pairs.count},
                {"Keys", pairs.keys},
                {"Values", pairs.triangles},
                {"Areas", y.areas},
                {"Labels", y.labels},
                {"Addresses", y.label_addresses},
                {"Alphas", s.alphas}},
               ClipAreaPush{.size = size}, threads(size),
               {.constants = {{"kMasked", s.masked}},
                .max_flops = size * (s.masked ? kOperationsPerMaskedPair : kOperationsPerPair)});
    return y;
}

} // namespace semrover
