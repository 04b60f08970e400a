// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "kernels/sort.h"
#include "tests/support/kernel_case.h"

namespace semrover {
namespace kernel_prefix_sum_test {

struct PrefixSumCase {
    uint32_t size, present; // elements; those that the count on the device admits
    bool counted, non_zero;
};

// one element; one chunk; an odd tail; a count below, at and above the size; many chunks; the most chunks
const PrefixSumCase kCases[] = {
    {1, 1, false, false},  {64, 64, false, false},    {1025, 1025, false, true},   {4099, 77, true, false},
    {4099, 0, true, true}, {4099, 9999, true, false}, {100003, 99999, true, true}, {3000001, 3000001, false, false},
};

TEST(kernel_prefix_sum, matches_a_sum_in_integers)
{
    for (const PrefixSumCase& c : kCases) {
        SCOPED_TRACE(fmt::format("{} of {} non_zero {}", c.present, c.size, c.non_zero));
        KernelCase k(test_device());
        const std::vector<uint32_t> x = k.indices(c.size, 5);
        PrefixSumOptions options;
        options.non_zero = c.non_zero;
        if (c.counted)
            options.count = k.input(std::vector<uint32_t>{c.present});
        const PrefixSum y = prefix_sum(k.graph, k.input(x), options);
        const Tensor sums = k.output(c.size, 1, DType::u32, 1);
        k.graph.keep(y.sums, sums);
        const Tensor total = k.graph.keep(y.total, k.output(1, 1, DType::u32, 1));
        const Status status = k.compile_and_run();
        ASSERT_TRUE(status) << status.error().message;
        const std::vector<uint32_t> got = k.read_array<uint32_t>(sums);
        uint32_t sum = 0;
        for (uint32_t i = 0; i < std::min(c.size, c.counted ? c.present : c.size); ++i) {
            ASSERT_EQ(got[i], sum) << i;
            sum += c.non_zero ? x[i] != 0 : x[i];
        }
        EXPECT_EQ(k.read_array<uint32_t>(total)[0], sum);
    }
}

TEST(kernel_prefix_sum, says_when_the_total_does_not_fit)
{
    KernelCase k(test_device());
    const PrefixSum y = prefix_sum(k.graph, k.input(std::vector<uint32_t>(70000, 100000)));
    const Tensor total = k.graph.keep(y.total, k.output(1, 1, DType::u32, 1));
    const Status status = k.compile_and_run();
    ASSERT_TRUE(status) << status.error().message;
    EXPECT_EQ(k.read_array<uint32_t>(total)[0], 0xffffffffu);
}

} // namespace kernel_prefix_sum_test
} // namespace semrover
