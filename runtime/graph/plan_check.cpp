// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// stage 1: misuse of the graph, reported with the pass and the tensor before anything else is decided
#include "runtime/graph/plan.h"
#include "runtime/graph/variant.h"

namespace semrover::stage {

namespace {

// byte ranges of one transient that have been written so far, merged and sorted
struct Written {
    std::map<uint64_t, uint64_t> ranges; // begin -> end

    void add(uint64_t begin, uint64_t end)
    {
        auto it = ranges.lower_bound(begin);
        if (it != ranges.begin() && std::prev(it)->second >= begin)
            --it;
        while (it != ranges.end() && it->first <= end) {
            begin = std::min(begin, it->first);
            end = std::max(end, it->second);
            it = ranges.erase(it);
        }
        ranges[begin] = end;
    }
    bool covers(uint64_t begin, uint64_t end) const
    {
        auto it = ranges.upper_bound(begin);
        return it != ranges.begin() && std::prev(it)->second >= end;
    }
};

} // namespace

Status check(Plan& plan)
{
    std::vector<Written> written(plan.resources.size());
    for (size_t i = 0; i < plan.passes.size(); ++i) {
        const Pass& pass = plan.passes[i];
        const auto& declared = pass.variant->bindings;
        for (size_t b = 0; b < declared.size(); ++b) {
            const Tensor& t = pass.tensors[b];
            if (!t.valid())
                continue;
            const Resource& r = plan.resources[t.resource];
            if (t.offset + t.bytes() > r.bytes)
                return fail(ErrorCode::internal, "pass {} ({}): binding {} reaches byte {} of '{}', which has {}", i,
                            pass.kernel->name, declared[b].name, t.offset + t.bytes(), r.name, r.bytes);
            if (!takes(*pass.kernel, *pass.variant, b, t.dtype))
                return fail(ErrorCode::internal, "pass {} ({}): binding {} does not take {}, the type of '{}'", i,
                            pass.kernel->name, declared[b].name, dtype_name(t.dtype), r.name);
            const bool reads = uint8_t(declared[b].access) & uint8_t(Access::read);
            if (reads && !r.external && !written[t.resource].covers(t.offset, t.offset + t.bytes()))
                return fail(ErrorCode::internal, "pass {} ({}): binding {} reads '{}', which nothing has written", i,
                            pass.kernel->name, declared[b].name, r.name);
        }
        for (size_t b = 0; b < declared.size(); ++b)
            if (const Tensor& t = pass.tensors[b]; t.valid() && uint8_t(declared[b].access) & uint8_t(Access::write))
                written[t.resource].add(t.offset, t.offset + t.bytes());
    }
    return {};
}

} // namespace semrover::stage
