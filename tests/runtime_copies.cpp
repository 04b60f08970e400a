// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "runtime/device/readback_ring.h"

#include "kernels/sort.h"
#include "tests/support/kernel_case.h"

#include <numeric>

namespace semrover {
namespace runtime_copies_test {

constexpr uint32_t kSize = 5000;

// a slot, and an executable that counts every element up
struct Counter {
    TensorPool state;
    DeviceTensor x = state.tensor(kSize, 1, DType::u32, "x", 1), one = state.tensor(kSize, 1, DType::u32, "other", 1);
    std::unique_ptr<Executable> executable;

    Counter()
    {
        EXPECT_TRUE(state.allocate(test_device(), "counter"));
        EXPECT_TRUE(x.write(test_device(), std::vector<uint32_t>(kSize, 0)));
    }
    // x is 100 i everywhere
    Status set(uint32_t i)
    {
        Graph g(test_device().limits());
        g.keep(fill(g, kSize, 100 * i), x);
        SR_TRY(executable, Executable::create(test_device(), g));
        return executable->submit().map([](uint64_t) {});
    }
};

std::vector<uint32_t> words(std::span<const std::byte> bytes)
{
    std::vector<uint32_t> v(bytes.size() / 4);
    std::memcpy(v.data(), bytes.data(), bytes.size());
    return v;
}

TEST(runtime_copies, a_copy_takes_its_place_among_what_is_submitted)
{
    Counter c;
    const auto copies = std::move(*CopyRing::create(test_device(), 2));
    uint64_t last = 0;
    for (uint32_t i = 1; i <= 5; ++i) { // more than it has command buffers
        ASSERT_TRUE(c.set(i));
        last = *copies->copy(c.x, c.one);
    }
    ASSERT_TRUE(c.set(9)); // what comes later does not matter
    ASSERT_TRUE(test_device().wait(last));
    EXPECT_TRUE(*test_device().finished(last));
    EXPECT_EQ(*c.one.read<uint32_t>(test_device()), std::vector<uint32_t>(kSize, 500));
    EXPECT_EQ(*c.x.read<uint32_t>(test_device()), std::vector<uint32_t>(kSize, 900));
    EXPECT_DEATH((void)copies->copy(c.x, c.one.row_range(0, 3)), "20000 bytes copied to 12");
}

TEST(runtime_copies, what_is_freed_while_it_is_copied_is_freed_afterwards)
{
    constexpr uint32_t kWords = 1 << 22; // a copy takes longer than to free it
    const auto copies = std::move(*CopyRing::create(test_device()));
    const auto state_of = [](TensorPool& state) {
        const DeviceTensor slot = state.tensor(kWords, 1, DType::u32, "words", 1);
        EXPECT_TRUE(state.allocate(test_device(), "words"));
        return slot;
    };
    TensorPool kept;
    const DeviceTensor to = state_of(kept);
    for (uint32_t i = 1; i <= 5; ++i) {
        const std::vector<uint32_t> numbers(kWords, i);
        {
            TensorPool from;
            const DeviceTensor slot = state_of(from);
            ASSERT_TRUE(slot.write(test_device(), numbers));
            for (int k = 0; k < 3; ++k)
                ASSERT_TRUE(copies->copy(slot, to));
        }
        EXPECT_TRUE(*to.read<uint32_t>(test_device()) == numbers);
    }
}

TEST(runtime_copies, a_read_has_what_the_slot_held_then_and_comes_in_order)
{
    Counter c;
    const auto ring = std::move(*ReadbackRing::create(test_device(), c.x.bytes(), 3));
    std::vector<uint32_t> seen;
    for (uint32_t i = 1; i <= 7; ++i) {
        ASSERT_TRUE(c.set(i));
        ASSERT_TRUE(ring->read(c.x, [&, i](std::span<const std::byte> bytes) -> Status {
            EXPECT_EQ(words(bytes), std::vector<uint32_t>(kSize, 100 * i));
            seen.push_back(i);
            return {};
        }));
        EXPECT_LE(ring->pending(), 3u);
        EXPECT_GE(seen.size() + 3, i); // those for which there was no room were handed over
    }
    ASSERT_TRUE(ring->read(c.x.row_range(10, 2), [&](std::span<const std::byte> bytes) -> Status {
        EXPECT_EQ(words(bytes), std::vector<uint32_t>(2, 700));
        seen.push_back(8);
        return {};
    }));
    ASSERT_TRUE(ring->drain());
    std::vector<uint32_t> expected(8);
    std::iota(expected.begin(), expected.end(), 1u);
    EXPECT_EQ(seen, expected);
    EXPECT_EQ(ring->pending(), 0u);
}

TEST(runtime_copies, what_has_arrived_is_handed_over_without_waiting)
{
    Counter c;
    const auto ring = std::move(*ReadbackRing::create(test_device(), c.x.bytes()));
    size_t arrived = 0;
    ASSERT_TRUE(c.set(1));
    ASSERT_TRUE(ring->read(c.x, [&](std::span<const std::byte>) -> Status {
        ++arrived;
        return {};
    }));
    ASSERT_TRUE(test_device().wait(test_device().last_ticket()));
    ASSERT_TRUE(ring->poll());
    EXPECT_EQ(arrived, 1u);
}

TEST(runtime_copies, a_sinks_error_comes_out_and_dropped_reads_reach_nobody)
{
    Counter c;
    const auto ring = std::move(*ReadbackRing::create(test_device(), c.x.bytes()));
    const auto refuse = [](std::span<const std::byte>) -> Status { return fail(ErrorCode::bad_input, "disk full"); };
    ASSERT_TRUE(ring->read(c.x, refuse));
    const Status status = ring->drain();
    ASSERT_FALSE(status);
    EXPECT_EQ(status.error().message, "disk full");
    ASSERT_TRUE(ring->read(c.x, refuse));
    ring->drop();
    EXPECT_TRUE(ring->drain());
}

TEST(runtime_copies, a_ring_takes_the_memory_that_was_planned)
{
    Device& device = test_device();
    const uint64_t before = device.allocated_bytes();
    const auto ring = std::move(*ReadbackRing::create(device, 12345, 4));
    EXPECT_EQ(device.allocated_bytes() - before, ReadbackRing::planned_bytes(device.limits(), 12345, 4));
}

TEST(runtime_copies, a_sink_gets_the_slices_in_order_in_pieces_that_make_them_up)
{
    for (const char* limits : {"", "staging=1"}) { // from memory that the host sees, and through the window
        auto device = Device::create({.limits = limits});
        ASSERT_TRUE(device);
        TensorPool state;
        const DeviceTensor large = state.tensor(5000001, 1, DType::u32, "large", 1),
                           small = state.tensor(3, 1, DType::u32, "small", 1);
        ASSERT_TRUE(state.allocate(**device, "slots"));
        std::vector<std::vector<uint32_t>> expected = {std::vector<uint32_t>(5000001), {7, 8, 9}};
        std::iota(expected[0].begin(), expected[0].end(), 1u);
        ASSERT_TRUE(large.write(**device, expected[0]));
        ASSERT_TRUE(small.write(**device, expected[1]));
        std::vector<std::vector<uint32_t>> got(2);
        const BufferSlice slices[] = {large.slice(), small.slice()};
        ASSERT_TRUE((*device)->read(slices, [&](const ReadPiece& piece) {
            ASSERT_LT(piece.slice, 2u);
            EXPECT_EQ(piece.at % 16, 0u);
            EXPECT_EQ(piece.at, got[piece.slice].size() * 4);
            const std::vector<uint32_t> some = words(piece.bytes);
            got[piece.slice].insert(got[piece.slice].end(), some.begin(), some.end());
        }));
        EXPECT_TRUE(got == expected);
        EXPECT_EQ((*device)->host_bytes().read, 4u * 5000004);
    }
}

} // namespace runtime_copies_test
} // namespace semrover
