// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "protocol.h"

#include "runtime/graph/shader_interface.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

namespace protocol = semrover::shader_interface;

namespace {

template <typename... T>
[[noreturn]] void refuse(const Variant& v, fmt::format_string<T...> format, T&&... values)
{
    const std::string text = fmt::format(format, std::forward<T>(values)...);
    throw std::runtime_error(v.name.empty() ? text : fmt::format("variant {}: {}", v.name, text));
}

template <typename Items>
const auto* find(const Items& items, std::string_view name)
{
    const auto found = std::find_if(items.begin(), items.end(), [&](const auto& item) { return item.name == name; });
    return found == items.end() ? nullptr : &*found;
}

// a binding may be called a, but X and Y keep their meaning: an input that is read, an output that is written
void check_bindings(const Variant& v)
{
    for (const Binding& b : v.module.bindings) {
        if (std::count_if(v.module.bindings.begin(), v.module.bindings.end(),
                          [&](const Binding& other) { return other.name == b.name; }) > 1)
            refuse(v, "two bindings are called {}", b.name);
        if (b.name == protocol::kOutput && !b.writable)
            refuse(v, "binding {} is never written", b.name);
    }
}

void check_constants(const Variant& v)
{
    for (const Constant& c : v.module.constants) {
        if (!c.name.starts_with(protocol::kTypePrefix))
            continue;
        if (!find(v.module.bindings, c.name.substr(protocol::kTypePrefix.size())))
            refuse(v, "constant {} belongs to no binding", c.name);
        if (c.is_bool)
            refuse(v, "constant {} is a bool, and there are more types than two", c.name);
    }
}

void check_push(const Variant& v)
{
    if (find(v.module.push, protocol::kFirstRow) && !find(v.module.push, protocol::kRows))
        refuse(v, "push member {} without {}", protocol::kFirstRow, protocol::kRows);
    for (const Member& m : v.module.push) {
        if (!m.name.ends_with(protocol::kFirstSuffix))
            continue;
        const bool known = std::any_of(v.module.bindings.begin(), v.module.bindings.end(),
                                       [&](const Binding& b) { return protocol::first_member(b.name) == m.name; });
        if (!known)
            refuse(v, "push member {} belongs to no binding", m.name);
    }
}

void check_alike(const Variant& first, const Variant& v)
{
    const Module &a = first.module, &b = v.module;
    if (a.bindings.size() != b.bindings.size())
        refuse(v, "{} bindings, the first variant has {}", b.bindings.size(), a.bindings.size());
    for (size_t i = 0; i < a.bindings.size(); ++i) {
        const Binding &one = a.bindings[i], &other = b.bindings[i];
        if (one.name != other.name)
            refuse(v, "binding {} is called {}, in the first variant {}", i, other.name, one.name);
        if (one.binding != other.binding || one.writable != other.writable || one.readable != other.readable)
            refuse(v, "binding {} has another number or access than in the first variant", other.name);
    }
    if (a.push_bytes != b.push_bytes || a.push.size() != b.push.size())
        refuse(v, "a push struct of {} bytes, in the first variant {}", b.push_bytes, a.push_bytes);
    for (size_t i = 0; i < a.push.size(); ++i)
        if (a.push[i].name != b.push[i].name || a.push[i].offset != b.push[i].offset)
            refuse(v, "push member {} at byte {}, in the first variant {} at byte {}", b.push[i].name, b.push[i].offset,
                   a.push[i].name, a.push[i].offset);
    for (const Constant& c : b.constants)
        if (const Constant* same = find(a.constants, c.name); same && same->id != c.id)
            refuse(v, "constant {} has id {}, in the first variant {}", c.name, c.id, same->id);
}

} // namespace

void check_protocol(const std::vector<Variant>& variants)
{
    for (const Variant& v : variants) {
        check_bindings(v);
        check_constants(v);
        check_push(v);
        check_alike(variants.front(), v);
    }
}
