// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/graph/graph.h"

#include <span>
#include <vector>

// What compiling a graph decides, before anything is allocated. The stages run in this order; each is a function over
// this data in a file of its own, testable without a device.
namespace semrover {

// a part of a pass's workgroups, or all of them, as the device gets it
struct Dispatch {
    uint32_t pass = 0;                                  // its index
    uint32_t submit = 0;                                // index of the command buffer it is recorded in
    uint32_t base[3] = {0, 0, 0}, count[3] = {1, 1, 1}; // workgroups

    bool operator==(const Dispatch&) const = default;
};

struct Placement {
    uint32_t block = 0; // transients: block of the arena
    uint64_t offset = 0;
    uint32_t first_use = ~0u, last_use = 0; // levels, before memory is shared
};

struct Plan {
    std::vector<Resource> resources;
    std::vector<Pass> passes;
    std::vector<Placement> placements; // one per resource
    std::vector<uint64_t> blocks;      // bytes of the arena's blocks
    std::vector<Dispatch> dispatches;  // in order of the passes
    uint32_t levels = 0;
    uint32_t submits = 0;
    uint32_t fused = 0; // passes that became epilogues of others

    uint64_t arena_bytes() const;
    uint64_t transient_bytes() const; // what it would be without aliasing
    uint32_t barriers() const;        // of one run: between levels, and at the end of each submit
};

class CostModel;

// costs: what the device has shown of its shaders; without any, as estimated
Result<Plan> make_plan(const Graph& graph, const CostModel& costs);
Result<Plan> make_plan(const Graph& graph);

namespace stage {
Status check(Plan& plan); // every transient is written before it is read, ranges fit
Status fuse(Plan& plan);  // epilogues into their producers
// Levels before memory is shared: of what passes read and write where they may run side by side, else one each. So
// passes of a level do not share memory, and lie in levels of their own later only if memory has to be shared.
void levels(Plan& plan, bool side_by_side);
Status place(Plan& plan, const DeviceLimits& limits);        // aliased arena
Status bands(Plan& plan, const DeviceLimits& limits);        // row bands for limits, groups
Status count_groups(Pass& pass, const DeviceLimits& limits); // part of it: workgroups of a grid
void barriers(Plan& plan);                                   // levels from access x byte range
// dispatches and submits for passes that take that many seconds each; may be done again once they are measured
void submits(Plan& plan, const DeviceLimits& limits, std::span<const double> seconds);
} // namespace stage

// do the memory ranges of two bindings overlap? Before placement no two transients do
bool overlaps(const Plan& plan, const PassBinding& a, const PassBinding& b);
// does one write what the other reads or writes?
bool conflict(const Plan& plan, const Pass& a, const Pass& b);

} // namespace semrover
