// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// tokens as grids store their points: [M, 6n] -> [M, 3n] words
#include "kernels/sampling.h"

#include "decode_tokens.spv.h"

namespace semrover {

Tensor decode_tokens(Graph& g, Tensor tokens, Tensor normalization, float half_voxel)
{
    SR_ASSERT(tokens.dtype == DType::f32 && tokens.cols % 6 == 0 && normalization.rows == 2 && normalization.ld == 6,
              "decode_tokens: [{}, {}] tokens, normalization [{}, {}]", tokens.rows, tokens.cols, normalization.rows,
              normalization.ld);
    SR_ASSERT(half_voxel <= kMostHalfVoxel, "decode_tokens: voxels of {} m", 2 * half_voxel);
    const uint32_t points = tokens.cols / 6;
    const Tensor y = g.array(tokens.rows, DType::u32, "points", 3 * points);
    const DecodeTokensPush push{.rows = tokens.rows, .ld = tokens.ld, .points = points, .half_voxel = half_voxel};
    g.dispatch(kernel::decode_tokens, {{"Tokens", tokens}, {"Normalization", normalization}, {"Y", y}}, push,
               threads(tokens.rows * points));
    return y;
}

} // namespace semrover
