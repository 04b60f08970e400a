// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// texels = bytes, four a pixel instead of three: [words] -> [pixels]
#include "kernels/picture.h"

#include "picture_texels.spv.h"

namespace semrover {

Tensor picture_texels(Graph& g, Tensor bytes, uint32_t pixels)
{
    SR_ASSERT(bytes.dtype == DType::u32 && bytes.ld == 1 && bytes.rows == picture_words(pixels, 1),
              "picture_texels: {} words for {} pixels", bytes.rows, pixels);
    const Tensor y = g.array(pixels, DType::u32, "texels");
    g.dispatch(kernel::picture_texels, {{"Bytes", bytes}, {"Texels", y}}, PictureTexelsPush{.pixels = pixels},
               threads(pixels));
    return y;
}

} // namespace semrover
