// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// stage 2: a dispatch that says `absorbed_as = kName` moves into the epilogue of the pass that makes its input X, when
// that kernel declares the constant kName. Bindings and push members move by name, so no op is known here. One that
// keeps X only adds an output (statistics of X).
#include "runtime/graph/plan.h"

#include "runtime/graph/protocol.h"

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
    return uint8_t(pass.kernel->variants.front().bindings[binding].access) & uint8_t(Access::write);
}

// could two tensors share bytes? by resource, and two externals by where their memory is
bool may_share(const Plan& plan, const Tensor& a, const Tensor& b)
{
    const Resource &ra = plan.resources[a.resource], &rb = plan.resources[b.resource];
    if (a.resource == b.resource)
        return true;
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
    const std::vector<Tensor>& read = plan.passes[consumer].tensors;
    const Tensor& x = read.front();
    if (plan.resources[x.resource].external ||
        std::any_of(read.begin() + 1, read.end(), [&](const Tensor& t) { return t.resource == x.resource; }))
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
    const Tensor& x = plan.passes[consumer].tensors.front();
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
            for (size_t k = 1; k < c.tensors.size(); ++k)
                if ((writes(*p, b) || writes(c, k)) && may_share(plan, p->tensors[b], c.tensors[k]))
                    return false;
    return true;
}

// does the consumer write what the producer reads? other workgroups of the producer may not have read it yet
bool overwrites_input(const Plan& plan, const Pass& producer, const Pass& c)
{
    for (size_t k = 1; k < c.tensors.size(); ++k)
        for (size_t b = 0; b < producer.tensors.size(); ++b)
            if (writes(c, k) && !writes(producer, b) && may_share(plan, c.tensors[k], producer.tensors[b]))
                return true;
    return false;
}

// push members named after a binding that moves ("gate_ld" of Gate, "y_ld" of Y) move with it
void move_push(const Pass& from, Pass& to)
{
    const KernelVariant &source = from.kernel->variants.front(), &target = to.kernel->variants.front();
    for (size_t b = 1; b < source.bindings.size(); ++b) {
        const std::string prefix = protocol::member_prefix(source.bindings[b].name);
        for (const PushMember& m : source.push)
            if (const PushMember* same_name = target.push_member(m.name); same_name && m.name.starts_with(prefix))
                std::memcpy(&to.push[same_name->offset], &from.push[m.offset], 4);
    }
}

// outputs of epilogues that are off are bound to a row of Y; they follow it, or Y's old memory would stay
void move_unused_outputs(Pass& producer, size_t y, uint32_t old_resource)
{
    for (size_t b = 0; b < producer.tensors.size(); ++b)
        if (b != y && writes(producer, b) && producer.tensors[b].resource == old_resource)
            producer.tensors[b] = producer.tensors[y].row_range(0, 1);
}

// where a producer binds what its consumer does, X aside; empty: not all of it
std::vector<size_t> slots_of(const Pass& consumer, const KernelVariant& taking)
{
    std::vector<size_t> slots(consumer.tensors.size());
    for (size_t b = 1; b < slots.size(); ++b) {
        const std::optional<size_t> slot = taking.binding(consumer.kernel->variants.front().bindings[b].name);
        if (!slot)
            return {};
        slots[b] = *slot;
    }
    return slots;
}

bool absorb(Plan& plan, size_t consumer)
{
    Pass& c = plan.passes[consumer];
    Pass* producer = c.options.keeps_x ? last_writer(plan, consumer) : sole_producer(plan, consumer);
    if (!producer)
        return false;
    const KernelVariant& taking = producer->kernel->variants.front();
    const ConstantInfo* absorbing = taking.constant(c.options.absorbed_as);
    const std::optional<size_t> y = taking.binding(protocol::kOutput);
    if (!absorbing || !y || !same(producer->tensors[*y], c.tensors.front()))
        return false;
    const std::vector<size_t> slots = slots_of(c, taking);
    if (slots.empty())
        return false;
    if (!producer->absorbed.empty() && producer->absorbed.back() >= absorbing->id)
        return false; // the shader applies its epilogues in the order of their ids
    for (size_t b = 1; b < c.tensors.size(); ++b)
        if (slots[b] != *y && std::count(producer->slots.begin(), producer->slots.end(), slots[b]))
            return false; // another epilogue uses that binding
    if (!can_move_up(plan, producer, consumer) || overwrites_input(plan, *producer, c))
        return false;
    const uint32_t old_y = producer->tensors[*y].resource;
    for (size_t b = 1; b < c.tensors.size(); ++b) {
        producer->tensors[slots[b]] = c.tensors[b];
        producer->slots.push_back(slots[b]);
    }
    if (!c.options.keeps_x)
        move_unused_outputs(*producer, *y, old_y);
    producer->absorbed.push_back(absorbing->id);
    move_push(c, *producer);
    producer->options.constants.push_back({c.options.absorbed_as, 1});
    if (!producer->options.banded.empty()) // else its rows cannot be cut, and neither can these
        for (const BandedBinding& band : c.options.banded)
            if (band.name != protocol::kInput && band.name != protocol::kOutput)
                producer->options.banded.push_back(band);
    return true;
}

} // namespace

Status fuse(Plan& plan)
{
    for (size_t i = 0; i < plan.passes.size();) {
        const Pass& pass = plan.passes[i];
        if (!pass.options.absorbed_as.empty() && absorb(plan, i)) {
            plan.passes.erase(plan.passes.begin() + int64_t(i));
            ++plan.fused;
        } else {
            ++i;
        }
    }
    return {};
}

} // namespace semrover::stage
