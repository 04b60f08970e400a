// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/graph/pass.h"

#include "runtime/base/result.h"
#include "runtime/graph/shader_interface.h"

#include <algorithm>
#include <cstring>

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

std::string Pass::name() const
{
    return variant->name.empty() ? std::string(kernel->name) : fmt::format("{}.{}", kernel->name, variant->name);
}

void Pass::set_constant(std::string_view name, uint32_t value)
{
    const ConstantInfo* c = variant->constant(name);
    if (c && c->value != value)
        constants[c->id] = value;
    else if (c)
        constants.erase(c->id);
}

void Pass::set_push(std::string_view name, uint32_t value)
{
    const PushMember* m = variant->push_member(name);
    SR_ASSERT(m, "{}.{}: no push member {}", kernel->name, variant->name, name);
    std::memcpy(&push[m->offset], &value, 4);
}

void Pass::take(uint32_t index)
{
    const Alternative& a = options.alternatives.at(index);
    alternative = index;
    grid.tile = a.tile;
    for (const ConstantValue& c : a.constants)
        set_constant(c.name, c.value);
}

void Pass::bind()
{
    const auto& declared = variant->bindings;
    bindings.clear();
    for (size_t b = 0; b < declared.size(); ++b) {
        const Tensor& t = tensors[b];
        if (const auto type = shader_interface::type_number(t.dtype); t.valid() && type)
            set_constant(shader_interface::type_constant(declared[b].name), *type);
        bindings.push_back({t.resource, t.offset, t.bytes(), declared[b].access, declared[b].kind, declared[b].name});
    }
}

} // namespace semrover
