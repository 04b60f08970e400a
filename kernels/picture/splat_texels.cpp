// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// numbers of splats as images have them: [cameras * pixels, 2 or 4] -> [cameras * words]
#include "kernels/picture.h"

#include "shaders/picture/splat_texels.h"
#include "splat_texels.spv.h"

namespace semrover {

uint32_t texel_bytes(Texels texels)
{
    switch (texels) {
    case Texels::byte:
        return 1;
    case Texels::half1:
        return 2;
    case Texels::half4:
        return 8;
    case Texels::float4:
        return 16;
    case Texels::unorm8:
    case Texels::snorm8:
    case Texels::float1:
    case Texels::word:
        return 4;
    case Texels::none:
    case Texels::whole:
        break;
    }
    return 0;
}

Tensor splat_texels(Graph& g, Tensor x, uint32_t cameras, const PictureFormat& format, Tensor scale)
{
    const uint32_t pixels = x.rows / cameras, words = texel_words(format.texels, pixels);
    SR_ASSERT(words && x.rows % cameras == 0 && (x.ld == 4 || x.ld == 2 || x.ld == 1) && scale.valid() == format.scaled,
              "splat_texels: [{}, {}] of {} cameras", x.rows, x.ld, cameras);
    const Tensor y = g.array(cameras * words, DType::u32, "texels");
    DispatchOptions options;
    options.constants = {{"kTexels", uint32_t(format.texels)}, {"kLinear", format.linear}, {"kScaled", format.scaled}};
    g.dispatch(kernel::splat_texels, {{"X", x}, {"Scale", scale}, {"Y", y}},
               SplatTexelsPush{.pixels = pixels, .numbers = x.ld, .words = words, .cameras = cameras}, threads(y.rows),
               std::move(options));
    return y;
}

} // namespace semrover
