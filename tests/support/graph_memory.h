// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/network.h"
#include "runtime/graph/plan.h"

#include <cctype>
#include <cstring>
#include <gtest/gtest.h>

// what graph tests need when there is no device: limits, and external memory that nobody dereferences
namespace semrover {

// of a GPU without a watchdog; every kernel has a variant that runs on it
inline DeviceLimits test_limits()
{
    DeviceLimits limits;
    limits.type = DeviceType::discrete;
    limits.submit_seconds = 0;
    return limits;
}

inline BufferSlice fake_memory(uint64_t bytes)
{
    static uint64_t next = 0x1000;
    const uint64_t address = next += 0x1000; // one buffer each
    return {reinterpret_cast<const Buffer*>(address), 0, bytes};
}

inline Tensor fake_external(Graph& g, uint32_t rows, uint32_t cols, DType dtype = DType::f32,
                            std::string_view name = "input")
{
    return g.external(fake_memory(rows * row_bytes_of(dtype, round_up(cols, kRowPadding))), rows, cols, dtype, name);
}

inline Tensor fake_array(Graph& g, uint32_t count, std::string_view name = "array")
{
    return g.external(fake_memory(uint64_t(count) * 4), count, 1, DType::u32, name, 1);
}

inline Plan planned(const Graph& g)
{
    auto plan = make_plan(g);
    EXPECT_TRUE(plan) << plan.error().message;
    return plan ? *plan : Plan{};
}

// a member of what a pass pushes
inline uint32_t pushed(const Pass& pass, std::string_view member)
{
    uint32_t value = 0;
    std::memcpy(&value, &pass.push.at(pass.variant->push_member(member)->offset), 4);
    return value;
}

// the kernel of a pass, or which function an activation is
inline std::string op_name(const Pass& pass)
{
    if (pass.kernel->name != "activation")
        return std::string(pass.kernel->name);
    std::string function(pass.options.epilogue.substr(1)); // "kGelu"
    function[0] = char(std::tolower(function[0]));
    return function;
}

// ops in the order they run, with a bar for every barrier: "gelu silu | add"
inline std::string levels_text(const Plan& plan)
{
    std::string out;
    for (size_t i = 0; i < plan.passes.size(); ++i) {
        if (i)
            out += plan.passes[i].level == plan.passes[i - 1].level ? " " : " | ";
        out += op_name(plan.passes[i]);
    }
    return out;
}

} // namespace semrover
