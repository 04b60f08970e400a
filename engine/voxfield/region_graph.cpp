// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/voxfield/region_graph.h"

#include <algorithm>

namespace semrover {

namespace {

constexpr uint32_t kNobody = UINT32_MAX;

} // namespace

RegionGraph::RegionGraph(const Regions& regions, size_t cell_count, std::span<const uint8_t> generated)
    : owner_(cell_count, kNobody), states_(regions.size(), State::dropped)
{
    SR_ASSERT(generated.empty() || generated.size() == cell_count, "{} flags for {} voxels", generated.size(),
              cell_count);
    find_owners(regions, generated);
    link(regions);
    invert_waits();
    for (uint32_t region = 0; region < regions.size(); ++region) {
        open_waits_.push_back(uint32_t(waits_for(region).size()));
        if (targets(region).empty())
            continue;
        states_[region] = State::waiting;
        ++run_count_;
        if (open_waits_[region] == 0)
            ready_.push(region);
    }
}

void RegionGraph::find_owners(const Regions& regions, std::span<const uint8_t> generated)
{
    for (uint32_t region = 0; region < regions.size(); ++region) {
        for (uint32_t cell : regions.region(region)) {
            SR_ASSERT(cell < owner_.size(), "region {} holds voxel {} of {}", region, cell, owner_.size());
            if (owner_[cell] != kNobody || (!generated.empty() && generated[cell] != 0))
                continue;
            owner_[cell] = region;
            targets_.values.push_back(cell);
        }
        targets_.end_row();
    }
}

void RegionGraph::link(const Regions& regions)
{
    std::vector<uint32_t> owners;
    for (uint32_t region = 0; region < regions.size(); ++region) {
        owners.clear();
        if (!targets(region).empty())
            for (uint32_t cell : regions.region(region))
                if (owner_[cell] != region && owner_[cell] != kNobody)
                    owners.push_back(owner_[cell]);
        std::sort(owners.begin(), owners.end());
        owners.erase(std::unique(owners.begin(), owners.end()), owners.end());
        waits_.values.insert(waits_.values.end(), owners.begin(), owners.end());
        waits_.end_row();
    }
}

// counting sort of (waited for, waiting) pairs
void RegionGraph::invert_waits()
{
    dependents_.offsets.assign(states_.size() + 1, 0);
    for (uint32_t earlier : waits_.values)
        ++dependents_.offsets[earlier + 1];
    for (size_t region = 0; region < states_.size(); ++region)
        dependents_.offsets[region + 1] += dependents_.offsets[region];
    std::vector<uint32_t> next(dependents_.offsets.begin(), dependents_.offsets.end() - 1);
    dependents_.values.resize(waits_.values.size());
    for (uint32_t region = 0; region < states_.size(); ++region)
        for (uint32_t earlier : waits_for(region))
            dependents_.values[next[earlier]++] = region;
}

std::vector<uint32_t> RegionGraph::take(size_t limit)
{
    std::vector<uint32_t> batch;
    while (batch.size() < limit && !ready_.empty()) {
        batch.push_back(ready_.top());
        states_[ready_.top()] = State::taken;
        ready_.pop();
    }
    return batch;
}

void RegionGraph::done(uint32_t region)
{
    SR_ASSERT(region < states_.size() && states_[region] == State::taken, "region {} was not taken", region);
    states_[region] = State::done;
    ++done_count_;
    for (uint32_t later : dependents_.row(region))
        if (--open_waits_[later] == 0)
            ready_.push(later);
}

void RegionGraph::give_back(uint32_t region)
{
    SR_ASSERT(region < states_.size() && states_[region] == State::taken, "region {} was not taken", region);
    states_[region] = State::waiting;
    ready_.push(region);
}

} // namespace semrover
