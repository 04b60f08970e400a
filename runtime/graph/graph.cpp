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

void Graph::replace(uint32_t from, uint32_t to)
{
    SR_ASSERT(desc_.resources[to].bytes >= desc_.resources[from].bytes, "'{}' does not fit into '{}'",
              desc_.resources[from].name, desc_.resources[to].name);
    for (Node& node : desc_.nodes)
        for (Tensor& t : node.tensors)
            if (t.resource == from)
                t.resource = to;
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
    for (const Tensor& t : tensors)
        SR_ASSERT(t.resource < desc_.resources.size(), "{}: a tensor of another graph, or none", kernel.name);
    desc_.nodes.push_back({&kernel, tensors, std::move(push), grid, std::move(options)});
}

} // namespace semrover
