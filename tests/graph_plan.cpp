// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/support/graph_memory.h"
#include "tests/support/random_graph.h"

#include <gtest/gtest.h>

namespace semrover {
namespace graph_plan_test {

TEST(graph_plan, puts_no_barrier_between_passes_that_read_the_same)
{
    Graph g(test_limits());
    const Tensor x = fake_external(g, 16, 64);
    const Tensor a = gelu(g, x), b = silu(g, x), c = gelu(g, x);
    add(g, a, b, {fake_external(g, 16, 64)});
    add(g, b, c, {fake_external(g, 16, 64)});
    EXPECT_EQ(levels_text(planned(g)), "gelu silu gelu | add add");
}

TEST(graph_plan, lets_independent_branches_share_a_level)
{
    Graph g(test_limits());
    const Tensor x = fake_external(g, 16, 64), y = fake_external(g, 16, 64), z = fake_external(g, 16, 64);
    const Tensor a = gelu(g, x), b = gelu(g, y), c = silu(g, x);
    add(g, a, b, {z});
    add(g, b, c, {x}); // also after the reads of x
    EXPECT_EQ(levels_text(planned(g)), "gelu gelu silu | add add");
}

TEST(graph_plan, orders_a_write_after_the_reads_before_it)
{
    Graph g(test_limits());
    const Tensor x = fake_external(g, 16, 64), y = fake_external(g, 16, 64);
    (void)gelu(g, x);
    add(g, y, y, {x});
    (void)silu(g, x);
    EXPECT_EQ(levels_text(planned(g)), "gelu | add | silu");
}

TEST(graph_plan, orders_writes_to_the_same_bytes_and_not_to_different_rows)
{
    Graph g(test_limits());
    const Tensor x = fake_external(g, 16, 64), y = fake_external(g, 32, 64);
    add(g, x, x, {y, 0});
    add(g, x, x, {y, 16});
    EXPECT_EQ(levels_text(planned(g)), "add add");
    add(g, x, x, {y, 8});
    EXPECT_EQ(levels_text(planned(g)), "add add | add");
}

TEST(graph_plan, knows_two_tensors_in_the_same_memory)
{
    Graph g(test_limits());
    const BufferSlice memory = fake_memory(16 * 64 * 4);
    const Tensor a = g.external(memory, 16, 64, DType::f32, "a"), b = g.external(memory, 16, 64, DType::f32, "b");
    add(g, fake_external(g, 16, 64), fake_external(g, 16, 64), {a});
    (void)gelu(g, b);
    EXPECT_EQ(levels_text(planned(g)), "add | gelu");
}

TEST(graph_plan, separates_passes_that_only_meet_in_aliased_memory)
{
    Graph g(test_limits());
    const Tensor x = fake_external(g, 16, 64);
    Tensor t = x;
    for (int i = 0; i < 5; ++i)
        t = gelu(g, t);
    const Plan plan = planned(g);
    EXPECT_EQ(levels_text(plan), "gelu | gelu | gelu | gelu | gelu");
    EXPECT_EQ(plan.arena_bytes(), 2 * 16 * 64 * 4u);
    EXPECT_EQ(plan.transient_bytes(), 5 * 16 * 64 * 4u);
}

DeviceLimits side_by_side()
{
    DeviceLimits limits = test_limits();
    limits.side_by_side = true;
    return limits;
}

// two chains that meet: in the least memory the second one waits for bytes of the first
Plan chains_that_meet(const DeviceLimits& limits)
{
    Graph g(limits);
    const Tensor x = fake_external(g, 16, 64), y = fake_external(g, 16, 64);
    const Tensor a = silu(g, gelu(g, silu(g, x))), b = silu(g, gelu(g, silu(g, y)));
    add(g, a, b, {fake_external(g, 16, 64)});
    return planned(g);
}

TEST(graph_plan, lets_branches_run_side_by_side_on_gpus)
{
    const Plan branches = chains_that_meet(side_by_side()), row = chains_that_meet(test_limits());
    EXPECT_EQ(levels_text(branches), "silu silu | gelu gelu | silu silu | add");
    EXPECT_EQ(branches.arena_bytes(), 4 * 16 * 64 * 4u);
    EXPECT_GT(row.levels, 4u);
    EXPECT_EQ(row.arena_bytes(), 3 * 16 * 64 * 4u);
}

TEST(graph_plan, keeps_the_order_of_passes_where_that_is_wanted)
{
    Graph g(side_by_side());
    const Tensor x = fake_external(g, 16, 64), y = fake_external(g, 16, 64);
    g.keep(silu(g, gelu(g, silu(g, x))), fake_external(g, 16, 64));
    g.keep(silu(g, gelu(g, silu(g, y))), fake_external(g, 16, 64));
    EXPECT_EQ(planned(g).arena_bytes(), 4 * 16 * 64 * 4u);
    g.keep_order();
    EXPECT_EQ(planned(g).arena_bytes(), 2 * 16 * 64 * 4u);
}

TEST(graph_plan, runs_what_can_wait_as_late_as_it_may)
{
    Graph g(side_by_side());
    Tensor t = fake_external(g, 16, 64);
    std::vector<Tensor> keys; // of external memory, so each could be made at once
    for (int i = 0; i < 6; ++i)
        keys.push_back(silu(g, fake_external(g, 16, 64)));
    for (int i = 0; i < 6; ++i)
        t = add(g, gelu(g, t), keys[size_t(i)]);
    g.keep(t, fake_external(g, 16, 64));
    const Plan plan = planned(g);
    EXPECT_EQ(plan.levels, 12u);
    EXPECT_LE(plan.arena_bytes(), 4 * 16 * 64 * 4u);
}

// Runs the plan over tags instead of numbers: whoever writes 16 bytes of the arena owns them, and whoever reads them
// must find the owner that it asked for.
void expect_owned_reads(const Plan& plan)
{
    std::vector<std::vector<uint32_t>> owner;
    for (uint64_t bytes : plan.blocks)
        owner.emplace_back(bytes / 16, ~0u);
    for (size_t i = 0; i < plan.passes.size(); ++i)
        for (Access wanted : {Access::read, Access::write}) // a pass reads before it writes
            for (const PassBinding& b : plan.passes[i].bindings) {
                if (!b.given() || plan.resources[b.resource].external || !(uint8_t(b.access) & uint8_t(wanted)))
                    continue;
                const Placement& p = plan.placements[b.resource];
                for (uint64_t at = (p.offset + b.offset) / 16; at < (p.offset + b.offset + b.bytes) / 16; ++at) {
                    uint32_t& tag = owner.at(p.block).at(at);
                    ASSERT_TRUE(wanted == Access::write || tag == b.resource)
                        << "pass " << i << " reads bytes that another tensor has overwritten";
                    tag = b.resource;
                }
            }
}

void expect_no_hazard_within_a_level(const Plan& plan)
{
    for (const Pass& a : plan.passes)
        for (const Pass& b : plan.passes) {
            if (&a == &b || a.level != b.level)
                continue;
            for (const PassBinding& x : a.bindings)
                for (const PassBinding& y : b.bindings)
                    ASSERT_FALSE((uint8_t(x.access) & uint8_t(Access::write)) && overlaps(plan, x, y))
                        << a.kernel->name << " and " << b.kernel->name;
        }
}

// the most bytes that are alive at once
uint64_t most_alive(const Plan& plan)
{
    uint64_t most = 0;
    for (uint32_t at = 0; at < 200; ++at) {
        uint64_t sum = 0;
        for (size_t r = 0; r < plan.resources.size(); ++r)
            if (!plan.resources[r].external && plan.placements[r].first_use <= at && at <= plan.placements[r].last_use)
                sum += plan.resources[r].bytes;
        most = std::max(most, sum);
    }
    return most;
}

void check_random(uint32_t seed, const DeviceLimits& limits)
{
    SCOPED_TRACE(seed);
    Graph g(limits);
    const RandomGraph made(g, seed, [&](uint32_t rows, uint32_t cols) { return fake_external(g, rows, cols); });
    const Plan plan = planned(g);
    ASSERT_FALSE(plan.passes.empty());
    expect_owned_reads(plan);
    expect_no_hazard_within_a_level(plan);
    EXPECT_GE(plan.arena_bytes(), most_alive(plan));
    EXPECT_LE(plan.arena_bytes(), plan.transient_bytes());
    for (uint64_t bytes : plan.blocks)
        EXPECT_LE(bytes, limits.max_allocation);
}

TEST(graph_plan, never_gives_two_live_tensors_the_same_bytes)
{
    for (uint32_t seed = 0; seed < 400; ++seed)
        check_random(seed, seed % 2 ? test_limits() : side_by_side());
}

TEST(graph_plan, never_does_so_either_over_several_blocks_bands_and_submits)
{
    DeviceLimits limits = test_limits();
    limits.max_allocation = 40000;
    limits.max_storage_range = 16384;
    limits.submit_seconds = 1e-6;
    for (uint32_t seed = 1000; seed < 1200; ++seed) {
        limits.side_by_side = seed % 2;
        check_random(seed, limits);
    }
}

TEST(graph_plan, saves_memory_on_deep_graphs)
{
    Graph g(test_limits());
    Tensor t = fake_external(g, 256, 64);
    for (int i = 0; i < 50; ++i)
        t = silu(g, gelu(g, t));
    const Plan plan = planned(g);
    EXPECT_EQ(plan.arena_bytes(), plan.transient_bytes() / 50);
}

} // namespace graph_plan_test
} // namespace semrover
