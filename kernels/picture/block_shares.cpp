// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = visible pixels / pixels, of each block: [P] -> [blocks]
#include "kernels/picture.h"

#include "block_shares.spv.h"

namespace semrover {

Tensor block_shares(Graph& g, Tensor seen, const PictureShape& s, uint32_t block)
{
    SR_ASSERT(seen.ld == 1 && seen.rows == s.width * s.height && block && s.padded_width % block == 0 &&
                  s.padded_height % block == 0 && s.width && s.height,
              "block_shares: {} words of {} x {} pixels, in blocks of {} x {} / {}", seen.rows, s.width, s.height,
              s.padded_width, s.padded_height, block);
    BlockSharesPush push{};
    push.y_width = s.padded_width / block;
    push.y_height = s.padded_height / block;
    push.rows = round_up(push.y_width * push.y_height, kImageRowPadding);
    push.width = s.width;
    push.height = s.height;
    push.block = block;
    const Tensor y = g.array(push.rows, DType::f32, "shares");
    g.dispatch(kernel::block_shares, {{"Pixels", seen}, {"Y", y}}, push, threads(push.rows));
    return y;
}

} // namespace semrover
