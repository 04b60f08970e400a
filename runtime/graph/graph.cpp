// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/graph/graph.h"

#include "runtime/graph/shader_interface.h"
#include "runtime/graph/variant.h"

namespace semrover {

Tensor Graph::matrix(uint32_t rows, uint32_t cols, DType dtype, std::string_view name)
{
    SR_ASSERT(rows > 0 && cols > 0, "tensor '{}' is empty: {} x {}", name, rows, cols);
    Tensor t{uint32_t(resources_.size()), dtype, rows, cols, round_up(cols, kRowPadding), 0};
    resources_.push_back({std::string(name), t.bytes(), false, {}});
    return t;
}

Tensor Graph::array(uint32_t count, DType dtype, std::string_view name, uint32_t width)
{
    SR_ASSERT(count > 0 && width > 0, "array '{}' is empty", name);
    Tensor t{uint32_t(resources_.size()), dtype, count, width, width, 0};
    resources_.push_back({std::string(name), t.bytes(), false, {}});
    return t;
}

Tensor Graph::external(const BufferSlice& memory, uint32_t rows, uint32_t cols, DType dtype, std::string_view name,
                       uint32_t ld)
{
    Tensor t{uint32_t(resources_.size()), dtype, rows, cols, ld ? ld : round_up(cols, kRowPadding), 0};
    SR_ASSERT(t.bytes() <= memory.bytes, "tensor '{}' of {} bytes in {} bytes of memory", name, t.bytes(),
              memory.bytes);
    resources_.push_back({std::string(name), t.bytes(), true, memory});
    return t;
}

uint32_t Graph::resource_of(const void* owner, uint32_t item, const BufferSlice& memory, std::string_view name)
{
    const auto [at, fresh] = owned_.try_emplace({owner, item}, uint32_t(resources_.size()));
    if (fresh)
        resources_.push_back({std::string(name), memory.bytes, true, memory});
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
    if (!a.valid() || !b.valid())
        return false;
    const Resource &ra = resources_[a.resource], &rb = resources_[b.resource];
    if (a.resource != b.resource && !(ra.memory.buffer && ra.memory.buffer == rb.memory.buffer))
        return false;
    const uint64_t at_a = ra.memory.offset + a.offset, at_b = rb.memory.offset + b.offset;
    return at_a < at_b + b.bytes() && at_b < at_a + a.bytes();
}

void Graph::check_keep(const Tensor& made, const Tensor& memory) const
{
    SR_ASSERT(made.resource < resources_.size() && memory.resource < resources_.size(),
              "keep: a tensor of another graph, or none");
    const Resource &from = resources_[made.resource], &to = resources_[memory.resource];
    const auto before = kept_.find(made.resource);
    SR_ASSERT(before == kept_.end(), "'{}' is kept in '{}' already", from.name,
              resources_[before->second.resource].name);
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
                  resources_[resource].name);
    bool begun = false; // what comes before the pass that makes it may use the memory
    for (const Pass& pass : passes_) {
        for (const Tensor& t : pass.tensors)
            begun = begun || t.resource == made.resource;
        for (const Tensor& t : pass.tensors)
            SR_ASSERT(!begun || !share_bytes(t, memory), "'{}' is kept in '{}', which {} uses after it is made",
                      from.name, to.name, pass.kernel->name);
    }
}

Tensor Graph::keep(Tensor made, Tensor memory)
{
    check_keep(made, memory);
    kept_[made.resource] = memory;
    for (Pass& pass : passes_)
        for (Tensor& t : pass.tensors)
            t = placed(t);
    return memory;
}

const KernelVariant& Graph::variant(const Kernel& kernel, std::span<const ConstantValue> constants,
                                    std::span<const Tensor> tensors, uint32_t excluded)
{
    if (const KernelVariant* chosen = choose_variant(kernel, limits_, constants, tensors, excluded))
        return *chosen;
    if (status_)
        status_ = fail(ErrorCode::no_device,
                       "no variant of kernel '{}' runs on this device ({} bytes of shared memory, {} threads a group, "
                       "{} storage buffers a shader)",
                       kernel.name, limits_.max_shared_bytes, limits_.max_group_threads, limits_.max_storage_buffers);
    return kernel.variants.front();
}

std::vector<Tensor> Graph::by_binding(const Kernel& kernel, const std::vector<NamedTensor>& tensors) const
{
    const KernelVariant& any = kernel.variants.front(); // all have the same bindings
    std::vector<Tensor> bound(any.bindings.size());
    for (const NamedTensor& t : tensors) {
        const std::optional<size_t> b = any.binding(t.binding);
        SR_ASSERT(b, "{}: no binding {}", kernel.name, t.binding);
        if (!t.tensor.valid())
            continue;
        SR_ASSERT(t.tensor.resource < resources_.size(), "{}: a tensor of another graph at {}", kernel.name, t.binding);
        bound[*b] = placed(t.tensor);
    }
    return bound;
}

void Graph::add(const Kernel& kernel, const std::vector<NamedTensor>& tensors, std::vector<uint8_t> push, Grid grid,
                DispatchOptions options)
{
    Pass pass;
    pass.kernel = &kernel;
    pass.tensors = by_binding(kernel, tensors);
    pass.variant = options.variant ? options.variant : &variant(kernel, options.constants, pass.tensors);
    const KernelVariant& v = *pass.variant;
    SR_ASSERT(push.size() == v.push_bytes, "{}: push struct of {} bytes, the shader declares {}", kernel.name,
              push.size(), v.push_bytes);
    SR_ASSERT(options.banded.empty() || v.push_member(shader_interface::kRows),
              "{}: cut into bands without push member {}", kernel.name, shader_interface::kRows);
    for (const BandedBinding& band : options.banded) {
        SR_ASSERT(v.binding(band.name), "{}: no binding {} to cut into bands", kernel.name, band.name);
        SR_ASSERT(!band.window.out_width || v.push_member(shader_interface::first_member(band.name)),
                  "{}: no push member {}", kernel.name, shader_interface::first_member(band.name));
    }
    pass.push = std::move(push);
    pass.grid = grid;
    pass.options = std::move(options);
    for (const ConstantValue& c : pass.options.constants)
        pass.set_constant(c.name, c.value);
    if (!pass.options.alternatives.empty())
        pass.take(0);
    passes_.push_back(std::move(pass));
}

} // namespace semrover
