// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// z = normals of Philox4x32-10, key (seed), counter (voxel, draw | stream | channel / 4): -> [M, N]
#include "kernels/sampling.h"

#include "step_noise.spv.h"

namespace semrover {

Tensor step_noise(Graph& g, StepTable steps, Tensor cells, Tensor known, uint32_t cols, uint64_t seed)
{
    SR_ASSERT(cols <= kNoiseChannels, "step_noise: {} channels, the counter has room for {}", cols, kNoiseChannels);
    const Tensor z = g.matrix(cells.rows, cols, DType::f32, "noise");
    StepNoisePush push{};
    push.rows = cells.rows;
    push.cols = cols;
    push.z_ld = z.ld;
    push.seed_low = uint32_t(seed);
    push.seed_high = uint32_t(seed >> 32);
    g.dispatch(kernel::step_noise,
               {{"Clock", steps.clock}, {"Steps", steps.rows}, {"Cells", cells}, {"Known", known}, {"Z", z}}, push,
               threads(z.rows * (z.ld / 4)));
    return z;
}

} // namespace semrover
