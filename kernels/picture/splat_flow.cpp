// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// optical flow of what splats show: a pixel's point at its median depth, moved as the thing that it is of moves,
// through the lens of the next picture
#include "kernels/picture.h"

#include "splat_flow.spv.h"

namespace semrover {

FlowTensors splat_flow(Graph& g, Tensor cameras, const FlowMoves& moves, const FlowSource& now, Tensor next_depth,
                       const FlowOptions& o)
{
    const uint32_t pixels = o.width * o.height;
    SR_ASSERT(cameras.rows == 2 && cameras.ld == kLensCameraFloats && moves.moves.rows >= 1 && moves.moves.ld == 12 &&
                  now.depth.rows == pixels && now.depth.ld == 2 && now.owners.rows == pixels &&
                  next_depth.rows == pixels && next_depth.ld == 2,
              "splat_flow: {} x {} pixels, {} and {} depths, {} owners, {} cameras of {}, {} moves of {}", o.width,
              o.height, now.depth.rows, next_depth.rows, now.owners.rows, cameras.rows, cameras.ld, moves.moves.rows,
              moves.moves.ld);
    const FlowTensors y{g.array(pixels, DType::f32, "flow", 2), g.array(pixels, DType::u32, "flow states")};
    const SplatFlowPush push{.width = o.width,
                             .height = o.height,
                             .mover_numbers = moves.rows.valid() ? moves.rows.rows : 0,
                             .tolerance = o.tolerance};
    g.dispatch(kernel::splat_flow,
               {{"Cameras", cameras},
                {"Moves", moves.moves},
                {"Depth", now.depth},
                {"Owners", now.owners},
                {"NextDepth", next_depth},
                {"MoverRows", moves.rows},
                {"Flow", y.flow},
                {"States", y.states}},
               push, threads(pixels), {.constants = {{"kModel", uint32_t(o.lens)}, {"kMoving", o.moving}}});
    return y;
}

} // namespace semrover
