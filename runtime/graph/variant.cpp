// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// which variant of a kernel a device runs
#include "runtime/graph/variant.h"

#include "runtime/graph/shader_interface.h"

#include <algorithm>

namespace semrover {

namespace {

bool runs_on(const KernelVariant& v, const DeviceLimits& limits, std::span<const ConstantValue> constants)
{
    const auto buffers = std::ranges::count(v.bindings, BindingKind::storage, &BindingInfo::kind);
    const uint32_t group_threads = v.local_size[0] * v.local_size[1] * v.local_size[2];
    return shared_bytes(v, constants) <= limits.max_shared_bytes && group_threads <= limits.max_group_threads &&
           (v.features & ~limits.features) == 0 && v.push_bytes <= limits.max_push_bytes &&
           uint64_t(buffers) <= limits.max_storage_buffers;
}

// those for cooperative matrices are passed over for their types, as there are others; others say what they do not take
bool suits(const Kernel& kernel, const KernelVariant& v, std::span<const Tensor> tensors)
{
    if (!(v.features & kFeatureCooperativeMatrix))
        return true;
    for (size_t b = 0; b < std::min(tensors.size(), v.bindings.size()); ++b)
        if (tensors[b].valid() && !takes(kernel, v, b, tensors[b].dtype))
            return false;
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

} // namespace

uint32_t shared_bytes(const KernelVariant& variant, std::span<const ConstantValue> constants)
{
    std::vector<uint32_t> values;
    for (const ConstantInfo& c : variant.constants) {
        const auto given = std::ranges::find(constants, c.name, &ConstantValue::name);
        values.push_back(given == constants.end() ? c.value : given->value);
    }
    return variant.shared_bytes(values.data());
}

bool takes(const Kernel& kernel, const KernelVariant& variant, size_t binding, DType type)
{
    const std::string name = shader_interface::type_constant(variant.bindings[binding].name);
    const std::optional<uint32_t> number = shader_interface::type_number(type);
    if (const ConstantInfo* last = variant.constant(name))
        return number && *number <= last->value;
    if (std::ranges::any_of(kernel.variants, [&](const KernelVariant& v) { return v.constant(name); }))
        return type == DType::f16;
    return type == DType::f32 || type == DType::u32 || type == DType::i32;
}

const KernelVariant* choose_variant(const Kernel& kernel, const DeviceLimits& limits,
                                    std::span<const ConstantValue> constants, std::span<const Tensor> tensors,
                                    uint32_t excluded)
{
    const KernelVariant* best = nullptr;
    for (const KernelVariant& v : kernel.variants)
        if (!(v.features & excluded) && runs_on(v, limits, constants) && suits(kernel, v, tensors) &&
            (!best || preference(v.name, limits) < preference(best->name, limits)))
            best = &v;
    return best;
}

} // namespace semrover
