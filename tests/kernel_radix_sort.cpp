// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "kernels/sort.h"
#include "tests/support/kernel_case.h"

#include <algorithm>
#include <chrono>
#include <numeric>

namespace semrover {
namespace kernel_radix_sort_test {

struct SortCase {
    uint32_t size, present, bits, below; // pairs; those that the count admits; bits compared; keys lie below this
    bool counted, iota;
};

// one pair; all keys equal; a tail; digits of 4, 6 and 8 bits; few pairs in a large capacity, none, too many; large;
// several tiles a worker
const SortCase kCases[] = {
    {1, 1, 32, ~0u, false, false},
    {777, 777, 8, 1, false, true},
    {1025, 1025, 32, ~0u, false, true},
    {5000, 5000, 4, 16, false, false},
    {70001, 70001, 11, 1053, false, false},
    {70001, 313, 11, 1053, true, false},
    {4096, 0, 32, ~0u, true, false},
    {4096, 5000, 17, 1u << 20, true, true},
    {100000, 100000, 32, 3, false, false},
    {300007, 299999, 32, ~0u, true, false},
    {1000000, 1000000, 32, ~0u, false, true},
    {3300003, 3300003, 8, 199, false, true},
};

void check(const SortCase& c)
{
    SCOPED_TRACE(fmt::format("{} of {} pairs, {} bits", c.present, c.size, c.bits));
    KernelCase k(test_device());
    const std::vector<uint32_t> keys = k.indices(c.size, c.below);
    std::vector<uint32_t> values(c.size);
    for (uint32_t i = 0; i < c.size; ++i)
        values[i] = c.iota ? i : 3 * i + 1;
    RadixSortOptions options;
    options.bits = c.bits;
    if (c.counted)
        options.count = k.input(std::vector<uint32_t>{c.present});
    const SortedPairs y = radix_sort(k.graph, k.input(keys), c.iota ? Tensor{} : k.input(values), options);
    const Tensor out_keys = k.output(c.size, 1, DType::u32, 1), out_values = k.output(c.size, 1, DType::u32, 1);
    k.graph.keep(y.keys, out_keys);
    k.graph.keep(y.values, out_values);
    const Status status = k.compile_and_run();
    ASSERT_TRUE(status) << status.error().message;

    const uint32_t present = std::min(c.size, c.counted ? c.present : c.size);
    const uint32_t mask = c.bits == 32 ? ~0u : (1u << c.bits) - 1;
    std::vector<uint32_t> order(present);
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(),
                     [&](uint32_t a, uint32_t b) { return (keys[a] & mask) < (keys[b] & mask); });
    const auto got_keys = k.read_array<uint32_t>(out_keys), got_values = k.read_array<uint32_t>(out_values);
    for (uint32_t i = 0; i < present; ++i) {
        ASSERT_EQ(got_keys[i], keys[order[i]]) << i;
        ASSERT_EQ(got_values[i], values[order[i]]) << i;
    }
}

TEST(kernel_radix_sort, matches_a_stable_sort_on_the_host)
{
    for (const SortCase& c : kCases)
        check(c);
}

} // namespace kernel_radix_sort_test
} // namespace semrover
