// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// s_0 = 0, s_j = argmax_i min_{k < j} |p_i - p_{s_k}|^2 per set of points: points [sets * N, 4] -> [sets * samples]
#include "kernels/recognition.h"

#include "farthest_point.spv.h"
#include "kernels/sort.h"
#include "kernels/splat.h"

#include <algorithm>

namespace semrover {

// lavapipe ends the loops of an invocation after 65535 rounds, all loops together, and says nothing; others have
// watchdogs
constexpr uint32_t kMaxRounds = 32768;

PointSamples farthest_point(Graph& g, Tensor points, uint32_t sets, uint32_t samples)
{
    SR_ASSERT(points.dtype == DType::f32 && points.cols == 4 && points.ld == 4 && sets && points.rows % sets == 0,
              "farthest_point: points [{}, {}] in {} sets", points.rows, points.cols, sets);
    FarthestPointPush push{.count = points.rows / sets, .samples = samples, .first = 0, .end = 0};
    SR_ASSERT(samples && samples <= push.count, "farthest_point: {} of {} points", samples, push.count);
    const Tensor distances = fill(g, points.rows, 0x7f7fffff); // the largest float
    const PointSamples y{g.array(sets * samples, DType::u32, "farthest points"),
                         g.array(sets * samples, DType::f32, "group centers", 4)};
    const uint32_t rounds = divide_up(push.count, 64) + 64; // of a sample: its points, then the 64 threads' best
    const uint32_t at_once = std::max(kMaxRounds / rounds, 2u) - 1; // the first of a dispatch is looked for once more
    for (; push.end < samples; push.first = push.end) {
        push.end = std::min(push.end + at_once, samples);
        g.dispatch(kernel::farthest_point,
                   {{"Points", points}, {"Distances", distances}, {"Index", y.index}, {"Centers", y.points}}, push,
                   groups(sets));
    }
    return y;
}

} // namespace semrover
