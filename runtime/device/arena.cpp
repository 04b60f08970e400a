// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/device/arena.h"

#include <algorithm>
#include <numeric>

namespace semrover {

void ArenaSize::cover(const ArenaSize& other)
{
    blocks.resize(std::max(blocks.size(), other.blocks.size()));
    for (size_t i = 0; i < other.blocks.size(); ++i)
        blocks[i] = std::max(blocks[i], other.blocks[i]);
}

uint64_t ArenaSize::bytes() const
{
    return std::accumulate(blocks.begin(), blocks.end(), uint64_t(0));
}

Result<std::shared_ptr<const Arena>> Arena::create(Device& device, const ArenaSize& size)
{
    const std::shared_ptr<Arena> arena(new Arena(device));
    for (const uint64_t bytes : size.blocks) {
        SR_TRY(auto block, Buffer::create(device, bytes, MemoryKind::device, "graph arena"));
        arena->blocks_.push_back(std::move(block));
    }
    return arena;
}

// transients become memory of the caller's, as slots are
Result<std::unique_ptr<Executable>> Arena::executable(const Graph& graph) const
{
    SR_TRY(Plan plan, make_plan(graph, device_.costs()));
    for (size_t i = 0; i < plan.resources.size(); ++i) {
        Resource& r = plan.resources[i];
        const Placement& p = plan.placements[i];
        if (r.external || p.first_use == ~0u)
            continue;
        SR_ASSERT(p.block < blocks_.size() && plan.blocks[p.block] <= blocks_[p.block]->bytes(),
                  "an arena that is too small for '{}'", r.name);
        r.external = true;
        r.memory = {blocks_[p.block].get(), p.offset, blocks_[p.block]->bytes() - p.offset};
    }
    plan.blocks.clear();
    return Executable::create(device_, std::move(plan));
}

} // namespace semrover
