// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// pairs sorted by key, stably, a digit of at most 8 bits at a time from the lowest: digits are counted per chunk, the
// prefix sum over [digit][chunk] says where each chunk's pairs of a digit go, and every chunk moves its pairs there
#include "kernels/sort.h"

#include "radix_sort_count.spv.h"
#include "radix_sort_scatter.spv.h"

#include <algorithm>

namespace semrover {

namespace {

constexpr uint32_t kDigitBits = 8;
constexpr uint32_t kSortChunk = 3072, kMaxSortWorkers = 1024; // pairs a worker should have at least; chunks

// an odd multiple of 8: whole workgroups of the CPU variant, and columns of counters that do not fall into one cache
// set
uint32_t workers_for(uint32_t size)
{
    const uint32_t groups = divide_up(std::min(divide_up(size, kSortChunk), kMaxSortWorkers), 8);
    return 8 * (groups | 1);
}

} // namespace

SortedPairs radix_sort(Graph& g, Tensor keys, Tensor values, const RadixSortOptions& options)
{
    SR_ASSERT(keys.dtype == DType::u32 && keys.ld == 1 && options.bits >= 1 && options.bits <= 32,
              "radix_sort: keys [{}, {}] {}, {} bits", keys.rows, keys.cols, dtype_name(keys.dtype), options.bits);
    SR_ASSERT(!values.valid() || (values.rows == keys.rows && values.ld == 1), "radix_sort: {} values for {} keys",
              values.rows, keys.rows);
    const uint32_t passes = divide_up(options.bits, kDigitBits), digit = divide_up(options.bits, passes);
    RadixSortPush push{.size = keys.rows, .workers = workers_for(keys.rows), .shift = 0, .buckets = 0};
    const Tensor count = options.count; // or none
    const auto workgroups = [&](const Kernel& kernel) {
        return groups(divide_up(push.workers, g.variant(kernel).value("kWorkers")));
    };
    for (uint32_t pass = 0; pass < passes; ++pass) {
        push.shift = pass * digit;
        push.buckets = 1u << std::min(digit, options.bits - push.shift);
        const Tensor counters = fill(g, push.buckets * push.workers, 0);
        const SortedPairs to = {g.array(keys.rows, DType::u32, "sorted keys"),
                                g.array(keys.rows, DType::u32, "sorted values")};
        DispatchOptions dispatch;
        dispatch.constants = {{"kCounted", options.count.valid()}, {"kIota", !values.valid()}};
        g.dispatch(kernel::radix_sort_count, {{"Keys", keys}, {"Count", count}, {"Counters", counters}}, push,
                   workgroups(kernel::radix_sort_count), dispatch);
        const Tensor first = prefix_sum(g, counters).sums;
        g.dispatch(kernel::radix_sort_scatter,
                   {{"Keys", keys},
                    {"Count", count},
                    {"Values", values},
                    {"First", first},
                    {"SortedKeys", to.keys},
                    {"SortedValues", to.values}},
                   push, workgroups(kernel::radix_sort_scatter), dispatch);
        keys = to.keys;
        values = to.values;
    }
    return {keys, values};
}

} // namespace semrover
