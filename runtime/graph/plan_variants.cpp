// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// stage 3: which shader runs each pass on this device, with which constants
#include "runtime/graph/plan.h"

#include "runtime/graph/protocol.h"

#include <algorithm>
#include <cstring>

namespace semrover {

namespace {

// what the op gives; what the planner sets (kHalf*, tiles) sizes no shared memory here
std::map<uint32_t, uint32_t> by_id(const KernelVariant& v, std::span<const ConstantValue> given)
{
    std::map<uint32_t, uint32_t> values;
    for (const ConstantValue& c : given)
        if (const ConstantInfo* info = v.constant(c.name))
            values[info->id] = c.value;
    return values;
}

bool runs_on(const KernelVariant& v, const DeviceLimits& limits, std::span<const ConstantValue> constants)
{
    const auto buffers = std::ranges::count(v.bindings, BindingKind::storage, &BindingInfo::kind);
    const uint32_t group_threads = v.local_size[0] * v.local_size[1] * v.local_size[2];
    return shared_bytes(v, by_id(v, constants)) <= limits.max_shared_bytes &&
           group_threads <= limits.max_group_threads && (v.needs & ~limits.needs_supported) == 0 &&
           v.push_bytes <= limits.max_push_bytes && uint64_t(buffers) <= limits.max_storage_buffers;
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

} // namespace

uint32_t shared_bytes(const KernelVariant& variant, const std::map<uint32_t, uint32_t>& constants)
{
    std::vector<uint32_t> values;
    for (const ConstantInfo& c : variant.constants) {
        const auto set = constants.find(c.id);
        values.push_back(set == constants.end() ? c.value : set->second);
    }
    return variant.shared_bytes(values.data());
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

void stage::bind(Pass& pass)
{
    const auto& declared = pass.variant->bindings;
    pass.bindings.clear();
    for (size_t b = 0; b < declared.size(); ++b) {
        const Tensor& t = pass.tensors[b];
        pass.bindings.push_back(
            {t.resource, t.offset, t.bytes(), declared[b].access, declared[b].kind, declared[b].name});
        pass.set_constant(protocol::half_constant(declared[b].name), t.dtype == DType::f16);
    }
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
            pass.set_constant(c.name, c.value);
        fit_tile(pass, limits);
        bind(pass);
    }
    return {};
}

} // namespace semrover
