// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y[i] = x[0] + .. + x[i - 1], reduce then scan: sums of chunks, their prefix sums, then every chunk again. No
// workgroup waits for another, so it needs no forward progress guarantee.
#include "kernels/sort.h"

#include "prefix_sum_apply.spv.h"
#include "prefix_sum_reduce.spv.h"
#include "prefix_sum_spine.spv.h"

#include <algorithm>

namespace semrover {

namespace {

constexpr uint32_t kSumChunk = 1024, kMaxSumWorkers = 1024; // elements a worker should have at least; chunks

} // namespace

PrefixSum prefix_sum(Graph& g, Tensor x, const PrefixSumOptions& options)
{
    SR_ASSERT(x.dtype == DType::u32 && x.cols == 1 && x.ld == 1, "prefix_sum: x [{}, {}] {}", x.rows, x.cols,
              dtype_name(x.dtype));
    const PrefixSumPush push{.size = x.rows, .workers = std::min(divide_up(x.rows, kSumChunk), kMaxSumWorkers)};
    const Tensor partial = g.array(push.workers, DType::u32, "partial sums");
    const Tensor first = g.array(push.workers, DType::u32, "sums before chunks");
    const Tensor total = g.array(1, DType::u32, "total");
    const Tensor y = g.array(x.rows, DType::u32, "prefix sums");
    DispatchOptions dispatch;
    dispatch.constants = {{"kCounted", options.count.valid()}, {"kNonZero", options.non_zero}};
    const auto workgroups = [&](const Kernel& kernel) {
        return groups(divide_up(push.workers, g.variant(kernel).value("kWorkers")));
    };
    g.dispatch(kernel::prefix_sum_reduce, {{"X", x}, {"Count", options.count}, {"Partial", partial}}, push,
               workgroups(kernel::prefix_sum_reduce), dispatch);
    g.dispatch(kernel::prefix_sum_spine, {{"Partial", partial}, {"First", first}, {"Total", total}}, push, groups(1));
    g.dispatch(kernel::prefix_sum_apply, {{"X", x}, {"Count", options.count}, {"First", first}, {"Y", y}}, push,
               workgroups(kernel::prefix_sum_apply), dispatch);
    return {y, total};
}

} // namespace semrover
