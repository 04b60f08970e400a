// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// points drawn uniformly from the surface in voxels: the point first, its texels from whichever page holds them, then
// the colour
#include "kernels/mesh.h"

#include "gather_texels.spv.h"
#include "sample_surface.spv.h"
#include "surface_color.spv.h"

namespace semrover {

constexpr double kOperationsPerSample = 5000; // a triangle is clipped to the voxel
constexpr double kMaskedAttempts = 4;         // of which most succeed at once

SurfaceSamples sample_surface(Graph& g, const SurfaceTriangles& s, Tensor triangles, Tensor sums, Tensor starts,
                              Tensor cells, uint32_t samples, uint64_t seed, bool canonical)
{
    SR_ASSERT(cells.dtype == DType::i32 && cells.ld == 4 && samples && triangles.rows == sums.rows,
              "sample_surface: cells [{}, {}], {} samples, {} triangles, {} sums", cells.rows, cells.ld, samples,
              triangles.rows, sums.rows);
    const uint32_t size = cells.rows * samples;
    const SurfaceSamples y{g.array(size, DType::f32, "samples", 8), g.array(size, DType::u32, "texel addresses", 4)};
    const SampleSurfacePush push{
        .cells = cells.rows, .samples = samples, .seed_low = uint32_t(seed), .seed_high = uint32_t(seed >> 32)};
    g.dispatch(kernel::sample_surface,
               {{"Triangles", s.records},
                {"Attributes", s.attributes},
                {"Materials", s.materials},
                {"Textures", s.textures},
                {"Values", triangles},
                {"Sums", sums},
                {"Starts", starts},
                {"Cells", cells},
                {"Samples", y.points},
                {"Addresses", y.addresses},
                {"Alphas", s.alphas}},
               push, threads(size),
               {.constants = {{"kCanonical", canonical}, {"kMasked", s.masked}},
                .max_flops = size * kOperationsPerSample * (s.masked ? kMaskedAttempts : 1)});
    return y;
}

void gather_texels(Graph& g, Tensor addresses, Tensor page, uint32_t first, Tensor y, Tensor count)
{
    SR_ASSERT(addresses.rows * addresses.ld == y.rows * y.ld, "gather_texels: {} addresses, {} results",
              addresses.rows * addresses.ld, y.rows * y.ld);
    const GatherTexelsPush push{.size = addresses.rows * addresses.ld, .first = first, .texels = page.rows};
    g.dispatch(kernel::gather_texels, {{"Addresses", addresses}, {"Page", page}, {"Count", count}, {"Y", y}}, push,
               threads(push.size), {.constants = {{"kCounted", count.valid()}}});
}

Tensor surface_color(Graph& g, const SurfaceSamples& samples, Tensor texels, Tensor linear)
{
    SR_ASSERT(texels.rows * texels.ld == samples.points.rows * 4 && linear.rows == 512,
              "surface_color: {} texels for {} samples, {} linear values", texels.rows * texels.ld, samples.points.rows,
              linear.rows);
    const Tensor y = g.array(samples.points.rows, DType::u32, "coloured samples", 4);
    g.dispatch(kernel::surface_color, {{"Samples", samples.points}, {"Texels", texels}, {"Linear", linear}, {"Y", y}},
               SurfaceColorPush{.size = y.rows}, threads(y.rows));
    return y;
}

} // namespace semrover
