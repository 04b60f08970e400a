// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// stage 2: a dispatch that says `epilogue = kName` moves into the epilogue of the pass that makes its input X, when
// that kernel declares the constant kName. Bindings and push members move by name, so no op is known here. One that
// keeps X only adds an output (statistics of X).
#include "runtime/graph/plan.h"

#include "runtime/graph/shader_interface.h"

#include <algorithm>
#include <cstring>

namespace semrover::stage {

namespace {

bool same(const Tensor& a, const Tensor& b)
{
    return a.resource == b.resource && a.offset == b.offset && a.rows == b.rows && a.cols == b.cols && a.ld == b.ld;
}

bool writes(const Pass& pass, size_t binding)
{
    return pass.tensors[binding].valid() && uint8_t(pass.variant->bindings[binding].access) & uint8_t(Access::write);
}

// the input that an epilogue gets from its producer; null: its shader has none, so it cannot be fused
const Tensor* input_of(const Pass& pass)
{
    const std::optional<size_t> x = pass.variant->binding(shader_interface::kInput);
    return x && pass.tensors[*x].valid() ? &pass.tensors[*x] : nullptr;
}

bool is_input(const Pass& pass, size_t binding)
{
    return pass.variant->bindings[binding].name == shader_interface::kInput;
}

// could two tensors share bytes? by resource, and two externals by where their memory is
bool may_share(const Plan& plan, const Tensor& a, const Tensor& b)
{
    if (!a.valid() || !b.valid())
        return false;
    if (a.resource == b.resource)
        return true;
    const Resource &ra = plan.resources[a.resource], &rb = plan.resources[b.resource];
    return ra.external && rb.external && ra.memory.buffer && ra.memory.buffer == rb.memory.buffer &&
           ra.memory.offset < rb.memory.offset + rb.bytes && rb.memory.offset < ra.memory.offset + ra.bytes;
}

bool touches(const Pass& pass, uint32_t resource)
{
    for (const Tensor& t : pass.tensors)
        if (t.resource == resource)
            return true;
    return false;
}

// the only pass that writes consumer's X, if consumer is also its only reader, and reads it once
Pass* sole_producer(Plan& plan, size_t consumer)
{
    const Tensor& x = *input_of(plan.passes[consumer]);
    if (plan.resources[x.resource].external ||
        std::ranges::count(plan.passes[consumer].tensors, x.resource, &Tensor::resource) > 1)
        return nullptr;
    Pass* producer = nullptr;
    for (size_t i = 0; i < plan.passes.size(); ++i) {
        if (i == consumer || !touches(plan.passes[i], x.resource))
            continue;
        if (producer || i > consumer)
            return nullptr;
        producer = &plan.passes[i];
    }
    return producer;
}

// the pass that last wrote consumer's X, all of it; others may read it
Pass* last_writer(Plan& plan, size_t consumer)
{
    const Tensor& x = *input_of(plan.passes[consumer]);
    for (size_t i = consumer; i-- > 0;) {
        bool whole = false, part = false;
        for (size_t b = 0; b < plan.passes[i].tensors.size(); ++b)
            if (writes(plan.passes[i], b)) {
                whole = whole || same(plan.passes[i].tensors[b], x);
                part = part || may_share(plan, plan.passes[i].tensors[b], x);
            }
        if (whole || part)
            return whole ? &plan.passes[i] : nullptr;
    }
    return nullptr;
}

// what the consumer reads besides X must exist before the producer runs, and what it writes must not be used between
bool can_move_up(const Plan& plan, const Pass* producer, size_t consumer)
{
    const Pass& c = plan.passes[consumer];
    for (const Pass* p = producer + 1; p != &c; ++p)
        for (size_t b = 0; b < p->tensors.size(); ++b)
            for (size_t k = 0; k < c.tensors.size(); ++k)
                if (!is_input(c, k) && (writes(*p, b) || writes(c, k)) && may_share(plan, p->tensors[b], c.tensors[k]))
                    return false;
    return true;
}

// does the consumer write what the producer reads? other workgroups of the producer may not have read it yet
bool overwrites_input(const Plan& plan, const Pass& producer, const Pass& c)
{
    for (size_t k = 0; k < c.tensors.size(); ++k)
        for (size_t b = 0; b < producer.tensors.size(); ++b)
            if (!is_input(c, k) && writes(c, k) && !writes(producer, b) &&
                may_share(plan, c.tensors[k], producer.tensors[b]))
                return true;
    return false;
}

// push members named after a binding that moves ("gate_ld" of Gate, "y_ld" of Y) move with it
Status move_push(const Pass& from, Pass& to)
{
    for (const BindingInfo& b : from.variant->bindings) {
        if (b.name == shader_interface::kInput)
            continue;
        const std::string prefix = shader_interface::member_prefix(b.name);
        for (const PushMember& m : from.variant->push) {
            if (!m.name.starts_with(prefix))
                continue;
            const PushMember* same_name = to.variant->push_member(m.name);
            if (!same_name)
                return fail(ErrorCode::internal, "{} cannot take over {}: it has no push member {}", to.kernel->name,
                            from.kernel->name, m.name);
            std::memcpy(&to.push[same_name->offset], &from.push[m.offset], 4);
        }
    }
    return {};
}

// the producer's binding of the same name; b is not X, which a fused epilogue has in registers
std::optional<size_t> producer_binding(const Pass& consumer, size_t b, const Pass& producer)
{
    return producer.variant->binding(consumer.variant->bindings[b].name);
}

// does the producer have all of the consumer's bindings, free of other epilogues?
bool has_epilogue_bindings(const Pass& consumer, const Pass& producer)
{
    for (size_t b = 0; b < consumer.tensors.size(); ++b) {
        if (is_input(consumer, b))
            continue;
        const std::optional<size_t> binding = producer_binding(consumer, b, producer);
        if (!binding || (consumer.variant->bindings[b].name != shader_interface::kOutput &&
                         std::ranges::count(producer.epilogue_bindings, *binding)))
            return false;
    }
    return true;
}

// the pass into whose epilogue a consumer can go
Pass* find_producer(Plan& plan, size_t consumer)
{
    const Pass& c = plan.passes[consumer];
    if (c.options.epilogue.empty() || !input_of(c))
        return nullptr;
    Pass* producer = c.options.keeps_x ? last_writer(plan, consumer) : sole_producer(plan, consumer);
    if (!producer)
        return nullptr;
    const ConstantInfo* absorbing = producer->variant->constant(c.options.epilogue);
    const std::optional<size_t> y = producer->variant->binding(shader_interface::kOutput);
    const bool takes = absorbing && y && same(producer->tensors[*y], *input_of(c)) &&
                       has_epilogue_bindings(c, *producer) &&
                       // the shader applies its epilogues in the order of their ids
                       (producer->epilogues.empty() || producer->epilogues.back() < absorbing->id) &&
                       can_move_up(plan, producer, consumer) && !overwrites_input(plan, *producer, c);
    return takes ? producer : nullptr;
}

Status absorb(const Pass& c, Pass& producer)
{
    for (size_t b = 0; b < c.tensors.size(); ++b) {
        if (is_input(c, b))
            continue;
        const size_t binding = *producer_binding(c, b, producer);
        producer.tensors[binding] = c.tensors[b];
        producer.epilogue_bindings.push_back(binding);
    }
    producer.epilogues.push_back(producer.variant->constant(c.options.epilogue)->id);
    producer.set_constant(c.options.epilogue, 1);
    if (!producer.options.banded.empty()) // else its rows cannot be cut, and neither can these
        for (const BandedBinding& band : c.options.banded)
            if (band.name != shader_interface::kInput && band.name != shader_interface::kOutput)
                producer.options.banded.push_back(band);
    return move_push(c, producer);
}

} // namespace

Status fuse(Plan& plan)
{
    for (size_t i = 0; i < plan.passes.size();) {
        Pass* producer = find_producer(plan, i);
        if (!producer) {
            ++i;
            continue;
        }
        SR_CHECK(absorb(plan.passes[i], *producer));
        plan.passes.erase(plan.passes.begin() + int64_t(i));
        ++plan.fused;
    }
    return {};
}

} // namespace semrover::stage
