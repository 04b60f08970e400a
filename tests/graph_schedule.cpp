// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "kernels/network.h"
#include "kernels/sort.h"
#include "runtime/graph/cost_model.h"
#include "tests/support/graph_memory.h"

#include <gtest/gtest.h>

namespace semrover {
namespace graph_schedule_test {

double sum(const Plan& plan, uint32_t pass, const std::vector<double>& seconds, uint32_t submit)
{
    double out = 0;
    for (const Dispatch& d : plan.dispatches)
        if (d.submit == submit && d.pass == pass)
            out += seconds[pass] * d.count[0] * d.count[1] * d.count[2] /
                   (double(plan.passes[pass].group_count[0]) * plan.passes[pass].group_count[1] *
                    plan.passes[pass].group_count[2]);
    return out;
}

// every workgroup of every pass once, in order; submits no longer than they may be but for one workgroup more
void expect_complete(const Plan& plan, const std::vector<double>& seconds, double limit)
{
    uint32_t pass = 0, next = 0, submit = 0;
    for (const Dispatch& d : plan.dispatches) {
        ASSERT_LT(d.pass, plan.passes.size());
        const uint32_t* n = plan.passes[d.pass].group_count;
        int cut = 0;
        for (int i = 0; i < 3; ++i) {
            ASSERT_GT(d.count[i], 0u);
            if (d.count[i] != n[i])
                cut = i;
            else
                EXPECT_EQ(d.base[i], 0u);
        }
        EXPECT_EQ(d.pass, pass);
        EXPECT_EQ(d.base[cut], next);
        next = d.base[cut] + d.count[cut];
        ASSERT_LE(next, n[cut]);
        if (next == n[cut]) {
            ++pass;
            next = 0;
        }
        EXPECT_TRUE(d.submit == submit || d.submit == submit + 1);
        submit = d.submit;
    }
    EXPECT_EQ(pass, plan.passes.size());
    EXPECT_EQ(plan.submits, submit + 1);
    for (uint32_t s = 0; limit > 0 && s < plan.submits; ++s) {
        double all = 0, longest_group = 0;
        for (uint32_t p = 0; p < plan.passes.size(); ++p) {
            all += sum(plan, p, seconds, s);
            const uint32_t* n = plan.passes[p].group_count;
            longest_group = std::max(longest_group, seconds[p] / std::max({n[0], n[1], n[2]}));
        }
        EXPECT_LE(all, limit * 1.001 + longest_group) << "submit " << s;
    }
}

// 137 GFLOP, 0.27 s at the assumed rate
Plan long_product(double submit_seconds)
{
    DeviceLimits limits = test_limits();
    limits.submit_seconds = submit_seconds;
    Graph g(limits);
    const Tensor x = fake_external(g, 4096, 4096), w = fake_external(g, 4096, 4096);
    (void)gemm(g, x, w, {}, {.dtype = DType::f32});
    return planned(g);
}

TEST(graph_schedule, cuts_long_work_into_ranges_of_workgroups)
{
    const Plan plan = long_product(0.1);
    EXPECT_EQ(plan.passes.size(), 1u);
    EXPECT_EQ(plan.dispatches.size(), 3u);
    EXPECT_EQ(plan.submits, 3u);
    expect_complete(plan, {estimated_seconds(plan.passes[0])}, 0.1);
    EXPECT_EQ(long_product(0).dispatches.size(), 1u); // nothing is cut without a watchdog
}

TEST(graph_schedule, fills_a_submit_with_short_passes)
{
    DeviceLimits limits = test_limits();
    limits.submit_seconds = 0.002;
    Graph g(limits);
    Tensor x = fake_external(g, 512, 512);
    const Tensor w = fake_external(g, 512, 512);
    for (int i = 0; i < 12; ++i)
        x = gemm(g, x, w, {}, {.dtype = DType::f32}); // 0.54 ms each
    const Plan plan = planned(g);
    EXPECT_EQ(plan.dispatches.size(), 12u);
    EXPECT_EQ(plan.submits, 4u);
}

// a barrier between levels, and one at the end of a submit; submits are cut again once passes are measured
TEST(graph_schedule, counts_dispatches_and_barriers_of_one_run)
{
    DeviceLimits limits = test_limits();
    limits.submit_seconds = 0.1;
    Graph g(limits);
    const Tensor x = fake_external(g, 16, 64), y = fake_external(g, 16, 64);
    const Tensor a = gelu(g, x), b = silu(g, y);
    (void)add(g, a, b);
    Plan plan = planned(g);
    EXPECT_EQ(levels_text(plan), "gelu silu | add");
    EXPECT_EQ(plan.dispatches.size(), 3u);
    EXPECT_EQ(plan.barriers(), 2u);
    stage::submits(plan, limits, std::vector<double>{1, 1, 1}); // a submit each: a group of workgroups is the least
    EXPECT_EQ(plan.submits, plan.dispatches.size());
    EXPECT_EQ(plan.barriers(), plan.submits);
    stage::submits(plan, limits, std::vector<double>{0.01, 0.01, 0.01});
    EXPECT_EQ(plan.dispatches.size(), 3u);
    EXPECT_EQ(plan.barriers(), 2u);
}

// measured seconds of passes of all kinds of grids
TEST(graph_schedule, gives_every_workgroup_once_whatever_passes_take)
{
    DeviceLimits limits = test_limits();
    limits.max_groups = 60;
    Graph g(limits);
    const Tensor x = fake_external(g, 1000, 64);
    (void)gelu(g, x);                                                                 // threads
    (void)modulate(g, x, {fake_external(g, 1, 128), fake_array(g, 1000)}, 64, 1e-6f); // row tiles, folded
    (void)gemm(g, x, fake_external(g, 512, 64), {}, {.dtype = DType::f32});           // tiles
    (void)prefix_sum(g, fake_array(g, 50000));                                        // and a group alone
    for (const double limit : {0.0, 0.001, 0.01, 0.1, 10.0}) {
        limits.submit_seconds = limit;
        Plan plan = planned(g);
        for (const double scale : {1e-5, 1e-3, 0.02, 0.5}) {
            std::vector<double> seconds;
            for (size_t i = 0; i < plan.passes.size(); ++i)
                seconds.push_back(scale * double(1 + i * 7 % 5));
            stage::submits(plan, limits, seconds);
            SCOPED_TRACE(fmt::format("limit {}, scale {}", limit, scale));
            expect_complete(plan, seconds, limit);
            EXPECT_TRUE(limit > 0 || plan.submits == 1) << plan.submits;
        }
    }
}

// bytes that are moved take time, too: no pass is free
TEST(graph_schedule, estimates_passes_that_count_no_operations)
{
    Graph g(test_limits());
    (void)add(g, fake_external(g, 100000, 64), fake_external(g, 100000, 64));
    const Plan plan = planned(g);
    EXPECT_NEAR(estimated_seconds(plan.passes[0]), 3 * 100000. * 64 * 4 / 2e10, 1e-6);
}

TEST(graph_schedule, learns_how_long_a_shader_takes)
{
    Graph g(test_limits());
    const Tensor x = fake_external(g, 4096, 4096), w = fake_external(g, 4096, 4096);
    (void)gelu(g, gemm(g, x, w, {}, {.groups = 2, .dtype = DType::f32}));
    Plan plan = planned(g);
    CostModel rates;
    Pass& pass = plan.passes[0];
    const double estimated = estimated_seconds(pass);
    EXPECT_EQ(rates.seconds(pass), estimated);
    rates.learn(pass, 1e-6); // too short to mean anything
    EXPECT_EQ(rates.seconds(pass), estimated);
    rates.learn(pass, estimated / 10);
    EXPECT_NEAR(rates.seconds(pass), estimated / 10, 1e-9);
    rates.learn(pass, estimated / 2); // of two, the mean
    EXPECT_NEAR(rates.seconds(pass), estimated * 0.3, 1e-9);
    for (int i = 0; i < 1000; ++i)
        rates.learn(pass, std::max(estimated / 1000, 1.1e-4));
    EXPECT_NEAR(rates.seconds(pass), estimated / 64, 1e-4 * estimated / 64); // not believed
    pass.options.max_flops = pass.options.flops;
    EXPECT_EQ(rates.seconds(pass), estimated); // the next data may have all that there can be
    for (int i = 0; i < 100000; ++i)
        rates.learn(pass, estimated * 4);
    EXPECT_NEAR(rates.seconds(pass), estimated * 4, 0.05 * estimated);
    EXPECT_EQ(rates.seconds(plan)[0], rates.seconds(pass));
}

} // namespace graph_schedule_test
} // namespace semrover
