// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// stage 4: lifetimes of transients, and offsets in an arena where lives that do not overlap share bytes
#include "runtime/graph/plan.h"

#include <algorithm>

namespace semrover::stage {

namespace {

// first and last level of each transient
void find_lifetimes(Plan& plan)
{
    for (const Pass& pass : plan.passes)
        for (const PassBinding& b : pass.bindings) {
            if (!b.given())
                continue;
            Placement& p = plan.placements[b.resource];
            p.first_use = std::min(p.first_use, pass.level);
            p.last_use = std::max(p.last_use, pass.level);
        }
}

bool alive_together(const Placement& a, const Placement& b)
{
    return a.first_use <= b.last_use && b.first_use <= a.last_use;
}

// lowest offset in `block` where `bytes` fit beside the residents that live at the same time
uint64_t first_fit(const Plan& plan, const std::vector<uint32_t>& residents, const Placement& p, uint64_t bytes)
{
    std::vector<std::pair<uint64_t, uint64_t>> taken;
    for (uint32_t r : residents)
        if (alive_together(plan.placements[r], p))
            taken.emplace_back(plan.placements[r].offset, plan.placements[r].offset + plan.resources[r].bytes);
    std::sort(taken.begin(), taken.end());
    uint64_t at = 0;
    for (const auto& [begin, end] : taken) {
        if (at + bytes <= begin)
            break;
        at = std::max(at, end);
    }
    return at;
}

} // namespace

// greedy by size: large tensors first, each at the lowest offset that is free during its life
Status place(Plan& plan, const DeviceLimits& limits)
{
    find_lifetimes(plan);
    std::vector<uint32_t> order;
    for (uint32_t r = 0; r < plan.resources.size(); ++r)
        if (!plan.resources[r].external && plan.placements[r].first_use != ~0u) {
            plan.resources[r].bytes = round_up64(plan.resources[r].bytes, limits.offset_alignment);
            order.push_back(r);
        }
    std::stable_sort(order.begin(), order.end(),
                     [&](uint32_t a, uint32_t b) { return plan.resources[a].bytes > plan.resources[b].bytes; });
    std::vector<std::vector<uint32_t>> residents;
    for (uint32_t r : order) {
        Placement& p = plan.placements[r];
        const uint64_t bytes = plan.resources[r].bytes;
        if (bytes > limits.max_allocation)
            return fail(ErrorCode::out_of_memory,
                        "tensor '{}' of {} bytes exceeds the device's largest allocation of {}", plan.resources[r].name,
                        bytes, limits.max_allocation);
        for (p.block = 0;; ++p.block) {
            if (p.block == residents.size()) {
                residents.emplace_back();
                plan.blocks.push_back(0);
            }
            p.offset = first_fit(plan, residents[p.block], p, bytes);
            if (p.offset + bytes <= limits.max_allocation)
                break;
        }
        residents[p.block].push_back(r);
        plan.blocks[p.block] = std::max(plan.blocks[p.block], p.offset + bytes);
    }
    return {};
}

} // namespace semrover::stage
