// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/device/tensor_pool.h"
#include "tests/support/graph_memory.h"

#include <gtest/gtest.h>

namespace semrover {
namespace graph_keep_test {

// of slots and graphs without a device: what is planned, and what is refused
struct KeepCase {
    TensorPool state;
    DeviceTensor x = state.tensor(16, 64, DType::f32, "x"), y = state.tensor(16, 64, DType::f32, "y");
    Graph g{test_limits()};

    std::string levels() const { return levels_text(*make_plan(g)); }
};

TEST(graph_keep, a_slot_is_one_resource_of_a_graph_however_often_it_is_asked_for)
{
    KeepCase c;
    const Tensor a = c.x.in(c.g), b = c.x.in(c.g), other = c.y.in(c.g), part = c.x.row_range(4, 8).in(c.g);
    EXPECT_EQ(a.resource, b.resource);
    EXPECT_NE(a.resource, other.resource);
    EXPECT_EQ(part.resource, a.resource);
    EXPECT_EQ(part.offset, 4u * 64 * 4);
    EXPECT_EQ(part.rows, 8u);
    EXPECT_EQ(c.g.resources().size(), 2u);
    EXPECT_FALSE(DeviceTensor().in(c.g).valid());
}

TEST(graph_keep, a_slot_says_its_shape)
{
    TensorPool state;
    const DeviceTensor words = state.tensor(10, 1, DType::u32, "words", 1),
                       rows = state.tensor(3, 5, DType::f16, "rows");
    EXPECT_EQ(words.bytes(), 40u);
    EXPECT_EQ(rows.ld(), 8u);
    EXPECT_EQ(rows.bytes(), 3u * 8 * 2);
    EXPECT_EQ(rows.name(), "rows");
    EXPECT_DEATH((void)words.row_range(8, 3), "rows 8 to 11 of 'words', which has 10");
    EXPECT_DEATH((void)state.tensor(0, 4, DType::f32, "none"), "slot 'none' is \\[0, 4\\]");
}

TEST(graph_keep, planned_bytes_are_those_of_the_slots_in_blocks_a_device_can_allocate)
{
    TensorPool state;
    (void)state.tensor(1, 1, DType::u32, "one", 1);
    (void)state.tensor(300, 1, DType::u32, "more", 1);
    DeviceLimits limits = test_limits();
    limits.offset_alignment = 256;
    EXPECT_EQ(state.planned_bytes(limits), 256u + 1280);
    TensorPool moved = std::move(state);
    EXPECT_EQ(moved.planned_bytes(limits), 256u + 1280);
}

TEST(graph_keep, what_is_kept_takes_no_memory_of_the_graph_and_may_be_read_on)
{
    KeepCase c;
    const Tensor made = gelu(c.g, c.x.in(c.g));
    const Tensor kept = c.g.keep(made, c.y);
    EXPECT_EQ(kept.resource, c.y.in(c.g).resource);
    (void)silu(c.g, made); // by either name
    (void)silu(c.g, kept);
    const Plan plan = *make_plan(c.g);
    EXPECT_EQ(levels_text(plan), "gelu | silu | silu");
    EXPECT_EQ(plan.passes[1].bindings.front().resource, kept.resource);
    EXPECT_EQ(plan.passes[2].bindings.front().resource, kept.resource);
    EXPECT_EQ(plan.arena_bytes(), c.x.bytes()); // of the two silus, one after the other
}

TEST(graph_keep, what_reads_the_slot_before_is_ordered_before_what_is_kept_there)
{
    KeepCase c;
    const Tensor old = silu(c.g, c.y.in(c.g)); // the old contents
    c.g.keep(gelu(c.g, c.x.in(c.g)), c.y);
    (void)old;
    EXPECT_EQ(c.levels(), "silu | gelu");
}

TEST(graph_keep, a_part_of_a_slot_is_kept_beside_what_another_part_holds)
{
    TensorPool state;
    const DeviceTensor both = state.tensor(32, 64, DType::f32, "both"), x = state.tensor(16, 64, DType::f32, "x");
    Graph g{test_limits()};
    const Tensor lower = silu(g, x.in(g)), upper = gelu(g, both.row_range(0, 16).in(g));
    g.keep(lower, both.row_range(16, 16));
    (void)upper;
    EXPECT_EQ(levels_text(*make_plan(g)), "silu gelu"); // they touch other rows
}

TEST(graph_keep, two_externals_of_the_same_memory_are_ordered_too)
{
    Graph g{test_limits()};
    const BufferSlice memory = fake_memory(16 * 64 * 4);
    const Tensor read = g.external(memory, 16, 64, DType::f32, "read"),
                 written = g.external(memory, 16, 64, DType::f32, "written");
    (void)silu(g, read);
    g.keep(gelu(g, fake_external(g, 16, 64)), written);
    EXPECT_EQ(levels_text(*make_plan(g)), "silu | gelu");
    Graph wrong(test_limits());
    const Tensor a = wrong.external(memory, 16, 64, DType::f32, "a"),
                 b = wrong.external(memory, 16, 64, DType::f32, "b");
    const Tensor made = gelu(wrong, fake_external(wrong, 16, 64));
    (void)silu(wrong, a);
    EXPECT_DEATH(wrong.keep(made, b), "'gelu' is kept in 'b', which activation uses after it is made");
}

TEST(graph_keep, refuses_a_slot_whose_old_contents_are_still_read)
{
    KeepCase c;
    const Tensor made = gelu(c.g, c.x.in(c.g));
    (void)silu(c.g, c.y.in(c.g));
    EXPECT_DEATH(c.g.keep(made, c.y), "'gelu' is kept in 'y', which activation uses after it is made");
    KeepCase in_place;
    const Tensor own = gelu(in_place.g, in_place.x.in(in_place.g));
    EXPECT_DEATH(in_place.g.keep(own, in_place.x), "'gelu' is kept in 'x', which activation uses after it is made");
}

TEST(graph_keep, refuses_what_does_not_fit_and_says_both)
{
    KeepCase c;
    const DeviceTensor narrow = c.state.tensor(16, 60, DType::f32, "narrow"),
                       half = c.state.tensor(16, 64, DType::f16, "half"),
                       wide = c.state.tensor(16, 64, DType::f32, "wide", 72);
    const Tensor made = gelu(c.g, c.x.in(c.g));
    EXPECT_DEATH(c.g.keep(made, narrow),
                 "'gelu', \\[16, 64\\] F32 with rows 64 apart, is kept in 'narrow', \\[16, 60\\]");
    EXPECT_DEATH(c.g.keep(made, half), "is kept in 'half', \\[16, 64\\] F16");
    EXPECT_DEATH(c.g.keep(made, wide), "is kept in 'wide', \\[16, 64\\] F32 with rows 72 apart");
    EXPECT_DEATH(c.g.keep(made.row_range(0, 8), c.y.row_range(0, 8)), "a part of 'gelu' is kept, not all of it");
}

TEST(graph_keep, refuses_to_keep_twice_or_what_is_kept_already)
{
    KeepCase c;
    EXPECT_DEATH(c.g.keep(c.x.in(c.g), c.y), "'x' is kept, but lies outside the graph already");
    EXPECT_DEATH(c.g.keep(gelu(c.g, c.x.in(c.g)), c.g.matrix(16, 64, DType::f32, "here")),
                 "'gelu' is kept in 'here', which is memory of the graph");
    const Tensor made = gelu(c.g, c.x.in(c.g)), other = silu(c.g, c.x.in(c.g));
    c.g.keep(made, c.y);
    EXPECT_DEATH(c.g.keep(made, c.y), "'gelu' is kept in 'y' already");
    EXPECT_DEATH(c.g.keep(other, c.y), "'silu' is kept in 'y', and so is 'gelu'");
    EXPECT_DEATH(c.g.keep(Tensor{}, c.y), "a tensor of another graph, or none");
}

} // namespace graph_keep_test
} // namespace semrover
