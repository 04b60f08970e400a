// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/graph/graph.h"

// Ops that rank and sort arrays; what ops are and how they are called: kernels/network.h
namespace semrover {

// y[i] = value
[[nodiscard]] Tensor fill(Graph& g, uint32_t size, uint32_t value); // [size] u32

// y[i] = x[0] + .. + x[i - 1]
struct PrefixSumOptions {
    Tensor count = {}; // [1] u32, or none: only the first count[0] elements of x are there; the rest of y is undefined
    bool non_zero = false; // counts the elements that are not zero instead of adding them
};
struct PrefixSum {
    Tensor sums;  // [N] u32
    Tensor total; // [1] u32; 2^32 - 1 if it does not fit
};
[[nodiscard]] PrefixSum prefix_sum(Graph& g, Tensor x, const PrefixSumOptions& options = {}); // [N] u32 array -> [N]

// pairs sorted by the low bits of their keys; equal keys stay in their order
struct RadixSortOptions {
    uint32_t bits = 32; // only these low bits of the keys are compared
    Tensor count = {};  // [1] u32, or none: only the first count[0] pairs are there; what follows them is undefined
};
struct SortedPairs {
    Tensor keys;   // [N] u32
    Tensor values; // [N] u32
};
[[nodiscard]] SortedPairs radix_sort(Graph& g,
                                     Tensor keys,   // [N] u32 array
                                     Tensor values, // [N] u32 array, or none: 0, 1, 2, ..
                                     const RadixSortOptions& options = {});

// starts[b] = how many of the sorted keys are below b: the pairs of bucket b are [starts[b], starts[b + 1])
[[nodiscard]] Tensor bucket_starts(Graph& g,
                                   Tensor keys, // [N] u32 array, sorted
                                   uint32_t buckets,
                                   Tensor count = {}); // [1] u32, or none: only the first count[0] keys are there

} // namespace semrover
