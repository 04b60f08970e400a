// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// part of stage 3: sums over a long K by several workgroups, where few outputs would leave a large GPU idle (split-K)
#include "runtime/graph/plan.h"

#include "runtime/graph/protocol.h"

#include <algorithm>
#include <bit>

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

size_t index_of(const Pass& pass, std::string_view name)
{
    const auto& bindings = pass.variant->bindings;
    return size_t(std::ranges::find(bindings, name, &BindingInfo::name) - bindings.begin());
}

void set_member(Pass& pass, std::string_view binding, std::string_view member, uint32_t value)
{
    pass.set_push(protocol::member_prefix(binding).append(member), value);
}

// the epilogue over the slices' sums
Pass adding_pass(const Pass& whole, const Tensor& sums, uint32_t slices, const DeviceLimits& limits)
{
    Pass pass = whole;
    pass.tensors[index_of(pass, protocol::kInput)] = sums;
    set_member(pass, protocol::kInput, "ld", sums.ld);
    pass.options.flops = 0;
    pass.options.depth_step = 32;
    pass.options.banded.clear();
    pass.set_constant(protocol::kSlices, slices);
    pass.set_constant(protocol::kAddSlices, 1);
    pass.set_tile(32, limits);
    return pass;
}

// the product alone, of which each slice writes its own rows of `sums`
void keep_product(Pass& pass, const Tensor& sums, uint32_t slices)
{
    const size_t y = index_of(pass, protocol::kOutput);
    pass.tensors[y] = sums;
    for (size_t b = 0; b < pass.tensors.size(); ++b)
        if (is_epilogue(pass.variant->bindings[b]))
            pass.tensors[b] = pass.variant->bindings[b].access == Access::read
                                  ? pass.tensors[index_of(pass, protocol::kInput)].row_range(0, 1)
                                  : sums.row_range(0, 1);
    set_member(pass, protocol::kOutput, "ld", sums.ld);
    pass.set_constant(protocol::kSlices, slices);
    pass.options.banded.clear();
    pass.grid.z = slices;
}

} // namespace

Status stage::split(Plan& plan, const DeviceLimits& limits)
{
    for (size_t i = 0; i < plan.passes.size(); ++i) {
        const uint32_t slices = slices_of(plan.passes[i]);
        const uint32_t rows = plan.passes[i].grid.x, cols = plan.passes[i].grid.y;
        const Tensor sums{uint32_t(plan.resources.size()), DType::f32, slices * rows, cols,
                          round_up(cols, kRowPadding),     0};
        if (slices < 2 || sums.bytes() > limits.max_storage_range)
            continue;
        plan.resources.push_back({"slices", sums.bytes(), false, {}});
        plan.placements.emplace_back();
        Pass adding = adding_pass(plan.passes[i], sums, slices, limits);
        keep_product(plan.passes[i], sums, slices);
        fit_tile(plan.passes[i], limits);
        for (Pass* pass : {&plan.passes[i], &adding})
            bind(*pass);
        plan.passes.insert(plan.passes.begin() + int64_t(++i), std::move(adding));
    }
    return {};
}

} // namespace semrover
