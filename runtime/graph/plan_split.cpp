// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// part of stage 3: sums over a long K by several workgroups, where few outputs would leave a large GPU idle (split-K)
#include "runtime/graph/plan_bands.h"

#include "runtime/graph/protocol.h"

#include <algorithm>
#include <bit>
#include <numeric>

namespace semrover {

namespace {

constexpr uint32_t kTile = 64;           // of the output
constexpr uint32_t kEnoughTiles = 128;   // of an image: from here on nothing is gained
constexpr uint32_t kWantedTiles = 320;   // with slices
constexpr uint32_t kLeastColumns = 1024; // of K, in a slice
constexpr uint32_t kMostSlices = 16;

// By the size of an image, and not by how many there are: an image has the same bits in any batch.
uint32_t slices_of(const Pass& pass)
{
    if (!pass.variant->constant(protocol::kSlices) || !pass.options.image_rows)
        return 1;
    const uint32_t tiles = divide_up(pass.options.image_rows, kTile) * divide_up(pass.grid.y, kTile);
    if (tiles >= kEnoughTiles)
        return 1;
    const uint32_t most = std::min({kWantedTiles / tiles, pass.options.depth / kLeastColumns, kMostSlices});
    return most ? std::bit_floor(most) : 1;
}

// what its shader reads beside the factors belongs to the epilogue, as does what it writes beside Y
bool is_epilogue(const BindingInfo& b)
{
    return b.name != protocol::kOutput && std::ranges::find(protocol::kFactors, b.name) == std::end(protocol::kFactors);
}

void set_member(Pass& pass, std::string_view binding, std::string_view member, uint32_t value)
{
    pass.set_push(protocol::member_prefix(binding).append(member), value);
}

// the epilogue over the slices' sums
Pass adding_pass(const Pass& whole, const Tensor& sums, uint32_t slices, const DeviceLimits& limits)
{
    Pass pass = whole;
    pass.tensors[*pass.variant->binding(protocol::kInput)] = sums;
    set_member(pass, protocol::kInput, "ld", sums.ld);
    pass.options.flops = 0;
    pass.options.depth_step = 32;
    pass.set_constant(protocol::kSlices, slices);
    pass.set_constant(protocol::kAddSlices, 1);
    pass.set_tile(32, limits);
    pass.options.banded.clear(); // it fits
    return pass;
}

// the product alone, of which each slice writes its own rows of `sums`
void keep_product(Pass& pass, const Tensor& sums, uint32_t slices)
{
    const size_t y = *pass.variant->binding(protocol::kOutput);
    pass.tensors[y] = sums;
    for (size_t b = 0; b < pass.tensors.size(); ++b)
        if (is_epilogue(pass.variant->bindings[b]))
            pass.tensors[b] = pass.variant->bindings[b].access == Access::read
                                  ? pass.tensors[*pass.variant->binding(protocol::kInput)].row_range(0, 1)
                                  : sums.row_range(0, 1);
    set_member(pass, protocol::kOutput, "ld", sums.ld);
    pass.set_constant(protocol::kSlices, slices);
    pass.options.banded.clear();
    pass.grid.z = slices;
}

// Rows of whole images, of as many as the device can bind with the sums of their slices. 0: not of the fewest that
// begin aligned, which says nothing of how many there are.
uint32_t rows_at_once(const Pass& pass, uint64_t row_bytes, const DeviceLimits& limits)
{
    const uint32_t rows = rows_of(pass);
    const uint64_t step = std::lcm<uint64_t>(pass.options.image_rows, aligned_rows(pass, limits));
    uint64_t count = std::min(limits.max_storage_range / row_bytes / step, (rows + step - 1) / step) * step;
    const auto bound = [&](const Pass& band) { return binds(band, limits); };
    while (count && !std::ranges::all_of(bands_of(pass, uint32_t(count), limits), bound))
        count -= step;
    return uint32_t(std::min<uint64_t>(count, rows));
}

void append_sliced(std::vector<Pass>& passes, Pass&& whole, const Tensor& sums, uint32_t slices,
                   const DeviceLimits& limits)
{
    Pass adding = adding_pass(whole, sums, slices, limits);
    keep_product(whole, sums, slices);
    stage::fit_tile(whole, limits);
    for (Pass* pass : {&whole, &adding}) {
        stage::bind(*pass);
        passes.push_back(std::move(*pass));
    }
}

} // namespace

void stage::split(Plan& plan, const DeviceLimits& limits)
{
    std::vector<Pass> passes;
    for (Pass& pass : plan.passes) {
        const uint32_t slices = slices_of(pass), cols = pass.grid.y, ld = round_up(cols, kRowPadding);
        const uint32_t rows = slices > 1 ? rows_at_once(pass, uint64_t(slices) * ld * 4, limits) : 0;
        if (!rows) {
            passes.push_back(std::move(pass));
            continue;
        }
        const Tensor sums{uint32_t(plan.resources.size()), DType::f32, slices * rows, cols, ld, 0};
        plan.resources.push_back({"slices", sums.bytes(), false, {}});
        plan.placements.emplace_back();
        for (Pass& band : bands_of(pass, rows, limits)) {
            const Tensor some = sums.row_range(0, slices * band.grid.x);
            append_sliced(passes, std::move(band), some, slices, limits);
        }
    }
    plan.passes = std::move(passes);
}

} // namespace semrover
