// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// stage 3: which shader runs each pass on this device, with which constants
#include "runtime/graph/plan.h"

#include "runtime/graph/protocol.h"

#include <algorithm>
#include <cstring>

namespace semrover {

namespace {

// with the constants that the op gives; those that the planner sets (kHalf*, tiles) size no shared memory
uint32_t shared_bytes(const KernelVariant& v, std::span<const ConstantValue> given)
{
    std::vector<uint32_t> values;
    for (const ConstantInfo& c : v.constants) {
        const auto found = std::ranges::find(given, c.name, &ConstantValue::name);
        values.push_back(found == given.end() ? c.value : found->value);
    }
    return v.shared_bytes(values.data());
}

bool runs_on(const KernelVariant& v, const DeviceLimits& limits, std::span<const ConstantValue> constants)
{
    const auto buffers = std::ranges::count(v.bindings, BindingKind::storage, &BindingInfo::kind);
    const uint32_t group_threads = v.local_size[0] * v.local_size[1] * v.local_size[2];
    return shared_bytes(v, constants) <= limits.max_shared_bytes && group_threads <= limits.max_group_threads &&
           (v.needs & ~limits.needs_supported) == 0 && v.push_bytes <= limits.max_push_bytes &&
           uint64_t(buffers) <= limits.max_storage_buffers;
}

// a variant without kHalf<B>, which another one has, takes fp16 there
bool takes(const Kernel& kernel, const KernelVariant& v, std::span<const Tensor> tensors)
{
    if (!(v.needs & kNeedsCooperativeMatrix))
        return true;
    for (size_t b = 0; b < std::min(tensors.size(), v.bindings.size()); ++b) {
        const std::string name = protocol::half_constant(v.bindings[b].name);
        const bool either = std::ranges::any_of(kernel.variants, [&](const auto& o) { return o.constant(name); });
        if (either && !v.constant(name) && tensors[b].dtype != DType::f16)
            return false;
    }
    return true;
}

// lower is better; kernels with one variant have an empty name
int preference(std::string_view name, const DeviceLimits& limits)
{
    if (!limits.force_variant.empty() && name == limits.force_variant)
        return 0;
    const bool cpu = limits.type == DeviceType::cpu;
    if (name == "cpu")
        return cpu ? 1 : 4;
    if (name == "coopmat")
        return cpu ? 5 : 1;
    return name.empty() ? 2 : 3; // "", "simt"
}

void set_constant(Pass& pass, std::string_view name, uint32_t value)
{
    const ConstantInfo* c = pass.variant->constant(name);
    if (c && c->value != value)
        pass.constants[c->id] = value;
}

// The tile of a workgroup. Where its lanes may lie otherwise (col_lanes of them side by side), as few outputs as can be
// are computed beyond the last row and column.
void fit_tile(Pass& pass)
{
    const ConstantInfo *lanes = pass.variant->constant(protocol::kColLanes),
                       *m = pass.variant->constant(protocol::kTileRows),
                       *n = pass.variant->constant(protocol::kTileCols);
    if (m)
        pass.tile_rows = m->value;
    if (n)
        pass.tile_cols = n->value;
    if (!lanes || pass.grid.unit != Grid::Unit::tiles)
        return;
    const uint32_t all = pass.variant->local_size[0];
    const uint32_t lane_rows = m->value * lanes->value / all, lane_cols = n->value / lanes->value;
    const auto outputs = [&](uint32_t across) {
        return uint64_t(round_up(pass.grid.x, lane_rows * (all / across))) * round_up(pass.grid.y, lane_cols * across);
    };
    uint32_t best = lanes->value;
    for (uint32_t across = all; across >= 1; across /= 2)
        if (outputs(across) < outputs(best))
            best = across;
    pass.tile_rows = lane_rows * (all / best);
    pass.tile_cols = lane_cols * best;
    pass.set_push(protocol::kColLanesMember, best);
}

// of a pass whose workgroups make square tiles
uint64_t workgroups(const Pass& pass, uint32_t tile)
{
    return uint64_t(divide_up(pass.grid.x, tile)) * divide_up(pass.grid.y, tile) * std::max(pass.grid.z, 1u);
}

void set_tile(Pass& pass, uint32_t tile)
{
    pass.tile_rows = pass.tile_cols = tile;
    set_constant(pass, protocol::kTileRows, tile);
    set_constant(pass, protocol::kTileCols, tile);
}

// Square tiles that a variant can make, and the workgroups from which a large GPU has enough to do with each. All give
// the same bits, so the choice may depend on the number of rows.
struct SquareTile {
    uint32_t size, enough;
};

SquareTile largest_that_fills(const Pass& pass, std::span<const SquareTile> tiles)
{
    for (const SquareTile& t : tiles)
        if (workgroups(pass, t.size) >= t.enough)
            return t;
    return tiles.back();
}

// Shape and threads of cooperative matrices. Four subgroups share a tile: a lane holds 128 sums at most, and has
// something to load.
void fit_matrices(Pass& pass, const DeviceLimits& limits)
{
    if (!(pass.variant->needs & kNeedsCooperativeMatrix))
        return;
    constexpr uint32_t kMostSums = 128, kLoadsOfSmall = 32 * 32 / 8;
    constexpr SquareTile kTiles[] = {{128, 256}, {64, 128}, {32, 0}};
    const MatrixShape& shape = limits.matrix;
    set_constant(pass, protocol::kMatM, shape.m);
    set_constant(pass, protocol::kMatN, shape.n);
    set_constant(pass, protocol::kMatK, shape.k);
    set_constant(pass, protocol::kThreads, 4 * shape.subgroup);
    if (pass.tile_rows != kTiles[0].size || pass.tile_cols != kTiles[0].size)
        return;
    const size_t first = kTiles[0].size * kTiles[0].size / (4 * shape.subgroup) > kMostSums;
    const size_t last = 4 * shape.subgroup <= kLoadsOfSmall ? 3 : 2;
    set_tile(pass, largest_that_fills(pass, std::span(kTiles).subspan(first, last - first)).size);
}

void fit_simt_tile(Pass& pass)
{
    constexpr SquareTile kTiles[] = {{64, 128}, {32, 0}};
    if (pass.variant->name == "simt" && pass.tile_rows == kTiles[0].size && pass.tile_cols == kTiles[0].size)
        set_tile(pass, largest_that_fills(pass, kTiles).size);
}

Status bind(Pass& pass)
{
    const auto& declared = pass.variant->bindings;
    for (size_t b = 0; b < declared.size(); ++b) {
        const Tensor& t = pass.tensors[b];
        pass.bindings.push_back(
            {t.resource, t.offset, t.bytes(), declared[b].access, declared[b].kind, declared[b].name});
        set_constant(pass, protocol::half_constant(declared[b].name), t.dtype == DType::f16);
    }
    return {};
}

} // namespace

void Pass::set_push(std::string_view name, uint32_t value)
{
    const PushMember* m = variant->push_member(name);
    SR_ASSERT(m, "{}.{}: no push member {}", kernel->name, variant->name, name);
    std::memcpy(&push[m->offset], &value, 4);
}

const KernelVariant* choose_variant(const Kernel& kernel, const DeviceLimits& limits,
                                    std::span<const ConstantValue> constants, std::span<const Tensor> tensors)
{
    const KernelVariant* best = nullptr;
    for (const KernelVariant& v : kernel.variants)
        if (runs_on(v, limits, constants) && takes(kernel, v, tensors) &&
            (!best || preference(v.name, limits) < preference(best->name, limits)))
            best = &v;
    return best;
}

Status stage::pick_variants(Plan& plan, const DeviceLimits& limits)
{
    for (Pass& pass : plan.passes) {
        DeviceLimits allowed = limits;
        allowed.needs_supported &= ~pass.options.without_needs;
        pass.variant = choose_variant(*pass.kernel, allowed, pass.options.constants, pass.tensors);
        if (!pass.variant)
            return fail(
                ErrorCode::no_device,
                "no variant of kernel '{}' runs on this device ({} bytes of shared memory, {} threads a group, {} "
                "storage buffers a shader)",
                pass.kernel->name, limits.max_shared_bytes, limits.max_group_threads, limits.max_storage_buffers);
        for (const ConstantValue& c : pass.options.constants)
            set_constant(pass, c.name, c.value);
        fit_tile(pass);
        fit_matrices(pass, limits);
        fit_simt_tile(pass);
        SR_CHECK(bind(pass));
    }
    return {};
}

} // namespace semrover
