// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/graph/graph.h"

#include "runtime/graph/protocol.h"

#include <algorithm>

namespace semrover {

std::pair<uint64_t, uint64_t> RowWindow::input_rows(uint64_t first, uint64_t count) const
{
    const auto row_of = [&](uint64_t row) { // of the image; its padding belongs to the last one
        return int64_t(std::min<uint64_t>(row % out_image_rows / out_width, out_height - 1)) * stride -
               int64_t(padding);
    };
    const auto input_row = [&](uint64_t row, int64_t y) {
        const uint64_t clamped = uint64_t(std::clamp<int64_t>(y, 0, in_height - 1));
        return row / out_image_rows * in_image_rows + (clamped >> shift) * in_width;
    };
    const uint64_t last = first + count - 1;
    return {input_row(first, row_of(first)), input_row(last, row_of(last) + kernel - 1) + in_width};
}

Tensor Graph::matrix(uint32_t rows, uint32_t cols, DType dtype, std::string_view name)
{
    SR_ASSERT(rows > 0 && cols > 0, "tensor '{}' is empty: {} x {}", name, rows, cols);
    Tensor t{uint32_t(desc_.resources.size()), dtype, rows, cols, round_up(cols, kRowPadding), 0};
    desc_.resources.push_back({std::string(name), t.bytes(), false, {}});
    return t;
}

Tensor Graph::array(uint32_t count, DType dtype, std::string_view name, uint32_t width)
{
    SR_ASSERT(count > 0 && width > 0, "array '{}' is empty", name);
    Tensor t{uint32_t(desc_.resources.size()), dtype, count, width, width, 0};
    desc_.resources.push_back({std::string(name), t.bytes(), false, {}});
    return t;
}

Tensor Graph::external(const BufferSlice& memory, uint32_t rows, uint32_t cols, DType dtype, std::string_view name,
                       uint32_t ld)
{
    Tensor t{uint32_t(desc_.resources.size()), dtype, rows, cols, ld ? ld : round_up(cols, kRowPadding), 0};
    SR_ASSERT(t.bytes() <= memory.bytes, "tensor '{}' of {} bytes in {} bytes of memory", name, t.bytes(),
              memory.bytes);
    desc_.resources.push_back({std::string(name), t.bytes(), true, memory});
    return t;
}

uint32_t Graph::outside(const void* owner, uint32_t item, const BufferSlice& memory, std::string_view name)
{
    const auto [at, fresh] = owned_.try_emplace({owner, item}, uint32_t(desc_.resources.size()));
    if (fresh)
        desc_.resources.push_back({std::string(name), memory.bytes, true, memory});
    return at->second;
}

Tensor Graph::placed(Tensor t) const
{
    const auto at = kept_.find(t.resource);
    if (at == kept_.end())
        return t;
    t.resource = at->second.resource;
    t.offset += at->second.offset;
    return t;
}

// do two tensors lie in the same bytes? Before memory is allocated, only resources show it.
bool Graph::share_bytes(const Tensor& a, const Tensor& b) const
{
    const Resource &ra = desc_.resources[a.resource], &rb = desc_.resources[b.resource];
    if (a.resource != b.resource && !(ra.memory.buffer && ra.memory.buffer == rb.memory.buffer))
        return false;
    const uint64_t at_a = ra.memory.offset + a.offset, at_b = rb.memory.offset + b.offset;
    return at_a < at_b + b.bytes() && at_b < at_a + a.bytes();
}

void Graph::check_keep(const Tensor& made, const Tensor& memory) const
{
    SR_ASSERT(made.resource < desc_.resources.size() && memory.resource < desc_.resources.size(),
              "keep: a tensor of another graph, or none");
    const Resource &from = desc_.resources[made.resource], &to = desc_.resources[memory.resource];
    const auto before = kept_.find(made.resource);
    SR_ASSERT(before == kept_.end(), "'{}' is kept in '{}' already", from.name,
              desc_.resources[before->second.resource].name);
    SR_ASSERT(!from.external, "'{}' is kept, but lies outside the graph already", from.name);
    SR_ASSERT(to.external, "'{}' is kept in '{}', which is memory of the graph", from.name, to.name);
    SR_ASSERT(made.offset == 0 && made.bytes() == from.bytes, "a part of '{}' is kept, not all of it", from.name);
    SR_ASSERT(made.rows == memory.rows && made.cols == memory.cols && made.ld == memory.ld &&
                  made.dtype == memory.dtype,
              "'{}', [{}, {}] {} with rows {} apart, is kept in '{}', [{}, {}] {} with rows {} apart", from.name,
              made.rows, made.cols, dtype_name(made.dtype), made.ld, to.name, memory.rows, memory.cols,
              dtype_name(memory.dtype), memory.ld);
    for (const auto& [resource, other] : kept_)
        SR_ASSERT(!share_bytes(other, memory), "'{}' is kept in '{}', and so is '{}'", from.name, to.name,
                  desc_.resources[resource].name);
    bool begun = false; // what comes before the pass that makes it may use the memory
    for (const Node& node : desc_.nodes) {
        for (const Tensor& t : node.tensors)
            begun = begun || t.resource == made.resource;
        for (const Tensor& t : node.tensors)
            SR_ASSERT(!begun || !share_bytes(t, memory), "'{}' is kept in '{}', which {} uses after it is made",
                      from.name, to.name, node.kernel->name);
    }
}

Tensor Graph::keep(Tensor made, Tensor memory)
{
    check_keep(made, memory);
    kept_[made.resource] = memory;
    for (Node& node : desc_.nodes)
        for (Tensor& t : node.tensors)
            t = placed(t);
    return memory;
}

void Graph::add(const Kernel& kernel, std::initializer_list<Tensor> tensors, std::vector<uint8_t> push, Grid grid,
                DispatchOptions options)
{
    const KernelVariant& any = kernel.variants.front();
    SR_ASSERT(tensors.size() == any.bindings.size(), "{}: {} tensors for {} bindings", kernel.name, tensors.size(),
              any.bindings.size());
    SR_ASSERT(push.size() == any.push_bytes, "{}: push struct of {} bytes, the shader declares {}", kernel.name,
              push.size(), any.push_bytes);
    SR_ASSERT(options.banded.empty() || any.push_member(protocol::kRows), "{}: cut into bands without push member {}",
              kernel.name, protocol::kRows);
    for (const BandedBinding& band : options.banded) {
        SR_ASSERT(std::ranges::any_of(any.bindings, [&](const BindingInfo& b) { return b.name == band.name; }),
                  "{}: no binding {} to cut into bands", kernel.name, band.name);
        SR_ASSERT(!band.window.out_width || any.push_member(protocol::first_member(band.name)), "{}: no push member {}",
                  kernel.name, protocol::first_member(band.name));
    }
    std::vector<Tensor> where;
    for (const Tensor& t : tensors) {
        SR_ASSERT(t.resource < desc_.resources.size(), "{}: a tensor of another graph, or none", kernel.name);
        where.push_back(placed(t));
    }
    desc_.nodes.push_back({&kernel, std::move(where), std::move(push), grid, std::move(options)});
}

} // namespace semrover
