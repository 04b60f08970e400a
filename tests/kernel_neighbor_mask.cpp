// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "tests/support/attention_sets.h"

namespace semrover {
namespace kernel_neighbor_mask_test {

void check(const std::vector<CellSet>& sets, const NeighborRadius& radius)
{
    const PackedSets packed(sets);
    SCOPED_TRACE(fmt::format("{} rows, longest set {}, radius2 {}, from row {} {}", packed.rows, packed.longest,
                             radius.radius2, radius.near_row, radius.near_radius2));
    KernelCase k(test_device());
    const uint32_t words = divide_up(packed.longest, 32);
    const Tensor out = k.output(packed.rows, words, DType::u32, words);
    k.graph.keep(neighbor_mask(k.graph, k.input(packed.cells, 4), k.input(packed.sets, 2), packed.longest, radius),
                 out);
    const Status status = k.compile_and_run();
    ASSERT_TRUE(status) << status.error().message;
    const std::vector<uint32_t> mask = k.read_array<uint32_t>(out);
    for (uint32_t i = 0; i < packed.rows; ++i)
        for (uint32_t bit = 0; bit < words * 32; ++bit) {
            const uint32_t first = packed.sets[2 * i], count = packed.sets[2 * i + 1];
            const int32_t radius2 = i < radius.near_row ? radius.radius2 : radius.near_radius2;
            const bool expected = bit < count && packed.sees(i, first + bit, radius2);
            ASSERT_EQ(mask[i * words + bit / 32] >> bit % 32 & 1, expected) << "row " << i << " bit " << bit;
        }
}

TEST(kernel_neighbor_mask, has_a_bit_for_every_cell_of_the_own_set_within_the_radius)
{
    std::mt19937 random(3);
    check({{{0, 0, 0}}}, {9});
    check({random_set(random, 31, false), random_set(random, 32, false), random_set(random, 33, false)}, {9});
    check({random_set(random, 1, false), random_set(random, 150, true), random_set(random, 51, false)}, {25});
    check({random_set(random, 64, false)}, {0});
}

TEST(kernel_neighbor_mask, has_another_radius_from_a_row_on)
{
    std::mt19937 random(4);
    const CellSet a = random_set(random, 70, true), b = random_set(random, 41, false);
    for (const uint32_t row : {0u, 1u, 70u, 100u, 111u})
        check({a, b}, {25, row, 4});
    check({a, a}, {9, 70, 0});
}

TEST(kernel_neighbor_mask, does_not_wrap_for_cells_that_are_far_apart)
{
    check({{{0, 0, 0}, {65536, 0, 0}, {0, -65536, 65536}, {2000000000, 0, 0}, {50000, 50000, 50000}}}, {9});
}

} // namespace kernel_neighbor_mask_test
} // namespace semrover
