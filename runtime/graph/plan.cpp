// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/graph/plan.h"

#include "runtime/graph/cost_model.h"

#include <numeric>

namespace semrover {

Result<Plan> make_plan(const Graph& graph)
{
    return make_plan(graph, CostModel());
}

Result<Plan> make_plan(const Graph& graph, const CostModel& costs)
{
    SR_CHECK(graph.status());
    const DeviceLimits& limits = graph.limits();
    Plan plan;
    plan.resources = graph.resources();
    plan.passes = graph.passes();
    plan.placements.resize(plan.resources.size());
    SR_CHECK(stage::check(plan));
    SR_CHECK(stage::fuse(plan));
    for (Pass& pass : plan.passes)
        pass.bind();
    stage::levels(plan, limits.side_by_side && !graph.in_order());
    SR_CHECK(stage::place(plan, limits));
    SR_CHECK(stage::bands(plan, limits));
    stage::barriers(plan);
    stage::submits(plan, limits, costs.seconds(plan));
    return plan;
}

uint64_t Plan::arena_bytes() const
{
    return std::accumulate(blocks.begin(), blocks.end(), uint64_t(0));
}

uint64_t Plan::transient_bytes() const
{
    uint64_t sum = 0;
    for (size_t i = 0; i < resources.size(); ++i)
        if (!resources[i].external && placements[i].first_use != ~0u)
            sum += resources[i].bytes;
    return sum;
}

uint32_t Plan::barriers() const
{
    uint32_t count = submits;
    for (size_t i = 1; i < dispatches.size(); ++i)
        count += dispatches[i].submit == dispatches[i - 1].submit &&
                 passes[dispatches[i].pass].level != passes[dispatches[i - 1].pass].level;
    return count;
}

bool overlaps(const Plan& plan, const PassBinding& a, const PassBinding& b)
{
    if (!a.given() || !b.given())
        return false;
    const Resource &ra = plan.resources[a.resource], &rb = plan.resources[b.resource];
    if (ra.external != rb.external)
        return false;
    uint64_t start_a = a.offset, start_b = b.offset;
    if (!ra.external && plan.blocks.empty()) {
        if (a.resource != b.resource)
            return false;
    } else if (ra.external) {
        if (a.resource != b.resource && (!ra.memory.buffer || ra.memory.buffer != rb.memory.buffer))
            return false; // without memory, when only planning, they differ by name only
        start_a += ra.memory.offset;
        start_b += rb.memory.offset;
    } else {
        const Placement &pa = plan.placements[a.resource], &pb = plan.placements[b.resource];
        if (pa.block != pb.block)
            return false;
        start_a += pa.offset;
        start_b += pb.offset;
    }
    return start_a < start_b + b.bytes && start_b < start_a + a.bytes;
}

bool conflict(const Plan& plan, const Pass& a, const Pass& b)
{
    for (const PassBinding& x : a.bindings)
        for (const PassBinding& y : b.bindings)
            if (((uint8_t(x.access) | uint8_t(y.access)) & uint8_t(Access::write)) && overlaps(plan, x, y))
                return true;
    return false;
}

} // namespace semrover
