// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = (x - shift) factor, or x / factor + shift: [M, N] -> [M, cols]
#include "kernels/picture.h"

#include "scale_latent.spv.h"

namespace semrover {

Tensor scale_latent(Graph& g, Tensor x, uint32_t pixels, uint32_t cols, const LatentScale& scale)
{
    SR_ASSERT(x.dtype == DType::f32 && cols <= x.cols && pixels <= x.rows && scale.factor != 0,
              "scale_latent: {} columns and {} pixels of [{}, {}] {}, factor {}", cols, pixels, x.rows, x.cols,
              dtype_name(x.dtype), scale.factor);
    const Tensor y = g.matrix(x.rows, cols, DType::f32, "latent");
    const ScaleLatentPush push{.rows = x.rows,
                               .pixels = pixels,
                               .cols = cols,
                               .x_ld = x.ld,
                               .y_ld = y.ld,
                               .factor = scale.factor,
                               .shift = scale.shift};
    DispatchOptions options;
    options.constants = {{"kBack", scale.back}};
    g.dispatch(kernel::scale_latent, {{"X", x}, {"Y", y}}, push, threads(y.rows * y.ld), std::move(options));
    return y;
}

} // namespace semrover
