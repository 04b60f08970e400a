// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/graph/graph.h"

#include <map>
#include <optional>
#include <string>
#include <vector>

// What compiling a graph decides, before anything is allocated. The stages run in this order; each is a function over
// this data in a file of its own, testable without a device.
namespace semrover {

struct PassBinding {
    uint32_t resource = 0;
    uint64_t offset = 0; // bytes from the resource's start
    uint64_t bytes = 0;
    Access access = Access::read;
    BindingKind kind = BindingKind::storage;
    std::string_view name;
};

struct Pass {
    const Kernel* kernel = nullptr;
    const KernelVariant* variant = nullptr;
    std::vector<Tensor> tensors;
    std::vector<PassBinding> bindings;
    std::map<uint32_t, uint32_t> constants; // id -> value, those that differ from the default
    std::vector<uint8_t> push;
    Grid grid;
    uint32_t group_count[3] = {1, 1, 1};
    DispatchOptions options;
    std::vector<uint32_t> absorbed; // ids of the constants of fused epilogues, and the bindings they took
    std::vector<size_t> slots;
    uint32_t level = 0;                           // passes of one level run without a barrier between them
    std::optional<uint32_t> tile_rows, tile_cols; // of the output, that a workgroup makes; where its shader says so

    void set_constant(std::string_view name, uint32_t value); // where the shader has one
    void set_push(std::string_view name, uint32_t value);     // the shader has such a member
    // one of tiles_of; workgroups are counted later
    void set_tile(uint32_t tile, const DeviceLimits& limits);
};

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
    uint32_t fused = 0; // nodes absorbed by their producers

    uint64_t arena_bytes() const;
    uint64_t transient_bytes() const; // what it would be without aliasing
    uint32_t barriers() const { return levels; }
};

class WorkRates;

// rates: what the device has shown of its shaders; without any, as estimated
Result<Plan> make_plan(const GraphDesc& graph, const DeviceLimits& limits, const WorkRates& rates);
Result<Plan> make_plan(const GraphDesc& graph, const DeviceLimits& limits);

namespace stage {
Status check(Plan& plan); // every transient is written before it is read, ranges fit
Status fuse(Plan& plan);  // epilogues into their producers
Status pick_variants(Plan& plan, const DeviceLimits& limits); // a shader per pass, its constants and bindings
void fit_tile(Pass& pass, const DeviceLimits& limits);        // part of it
void bind(Pass& pass);                                        // part of it: tensors to bindings
void split(Plan& plan, const DeviceLimits& limits);           // long sums over few outputs into slices
// Levels before memory is shared: of what passes read and write where they may run side by side, else one each. So
// passes of a level do not share memory, and lie in levels of their own later only if memory has to be shared.
void arrange(Plan& plan, bool side_by_side);
Status lifetimes(Plan& plan);                                // first and last level of each transient
Status place(Plan& plan, const DeviceLimits& limits);        // aliased arena
Status slice(Plan& plan, const DeviceLimits& limits);        // row bands for limits, groups
Status count_groups(Pass& pass, const DeviceLimits& limits); // part of it: workgroups of a grid
Status order(Plan& plan);                                    // levels from access x byte range: the barriers
// dispatches and submits for passes that take that many seconds each; may be done again once they are measured
void schedule(Plan& plan, const DeviceLimits& limits, std::span<const double> seconds);
} // namespace stage

// The sizes of square tiles that workgroups of a pass can make on a device, the largest first; a pass has one of them,
// by how many workgroups it has. All give the same bits. Fewer than two: nothing to choose.
std::vector<uint32_t> tiles_of(const Pass& pass, const DeviceLimits& limits);

// Seconds that a pass takes on a slow GPU: arithmetic or memory, whichever takes longer. Good enough to keep the first
// submits under a watchdog.
double estimated_seconds(const Pass& pass);

// do the memory ranges of two bindings overlap? Before placement no two transients do
bool overlaps(const Plan& plan, const PassBinding& a, const PassBinding& b);
// does one write what the other reads or writes?
bool conflict(const Plan& plan, const Pass& a, const Pass& b);

// bytes of shared memory that a variant takes with these constants (id -> value); others have their defaults
uint32_t shared_bytes(const KernelVariant& variant, const std::map<uint32_t, uint32_t>& constants);

// The variant of `kernel` for a device, among those its limits allow with these constants and tensors (none: fp16
// ones): the forced one, else cpu, coopmat or simt by device type.
const KernelVariant* choose_variant(const Kernel& kernel, const DeviceLimits& limits,
                                    std::span<const ConstantValue> constants = {},
                                    std::span<const Tensor> tensors = {});

} // namespace semrover
