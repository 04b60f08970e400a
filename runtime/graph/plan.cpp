// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/graph/plan.h"

#include "runtime/graph/measurements.h"

#include <numeric>

namespace semrover {

namespace {

Plan from_desc(const GraphDesc& graph)
{
    Plan plan;
    plan.resources = graph.resources;
    plan.placements.resize(graph.resources.size());
    for (const Node& node : graph.nodes) {
        Pass pass;
        pass.kernel = node.kernel;
        pass.tensors = node.tensors;
        pass.push = node.push;
        pass.grid = node.grid;
        pass.options = node.options;
        plan.passes.push_back(std::move(pass));
    }
    return plan;
}

} // namespace

Result<Plan> make_plan(const GraphDesc& graph, const DeviceLimits& limits)
{
    return make_plan(graph, limits, WorkRates());
}

Result<Plan> make_plan(const GraphDesc& graph, const DeviceLimits& limits, const WorkRates& rates)
{
    Plan plan = from_desc(graph);
    SR_CHECK(stage::check(plan));
    SR_CHECK(stage::fuse(plan));
    SR_CHECK(stage::pick_variants(plan, limits));
    stage::split(plan, limits);
    stage::arrange(plan, limits.side_by_side && !graph.in_order);
    SR_CHECK(stage::lifetimes(plan));
    SR_CHECK(stage::place(plan, limits));
    SR_CHECK(stage::slice(plan, limits));
    SR_CHECK(stage::order(plan));
    stage::schedule(plan, limits, rates.seconds(plan));
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

bool overlaps(const Plan& plan, const PassBinding& a, const PassBinding& b)
{
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
