// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

// What a shader declares, as reflected into <op>.spv.h by cmake/reflect: the shader is the only place where bindings,
// access, constants and push members are written down.
namespace semrover {

enum class Access : uint8_t { read = 1, write = 2, read_write = 3 };
enum class BindingKind : uint8_t { storage, texel }; // storage buffer; uniform texel buffer (RGBA32_UINT)

struct BindingInfo {
    std::string_view name; // the block's name, or the texel buffer's
    uint32_t binding;
    BindingKind kind;
    Access access;
};

struct ConstantInfo {
    std::string_view name; // kTypeX, ...
    uint32_t id;
    uint32_t value; // default, as 32 bits
};

struct PushMember {
    std::string_view name;
    uint32_t offset; // bytes
};

enum KernelFeatures : uint32_t {
    kFeatureSubgroupArithmetic = 1, // subgroup reductions and scans
    kFeatureSubgroupBallot = 2,
    kFeatureSubgroupShuffle = 4,
    kFeatureFloat16 = 8, // fp16 arithmetic (storage is always packed into 32-bit words and needs nothing)
    kFeatureCooperativeMatrix = 16,
    kFeatureHalfSums = 32, // cooperative matrices with fp16 sums, too
    kFeatureSubgroupVote = 64,
};

struct KernelVariant {
    std::string_view name; // "", "cpu", "simt", ...
    std::span<const uint32_t> code;
    std::span<const BindingInfo> bindings; // in binding order
    std::span<const ConstantInfo> constants;
    std::span<const PushMember> push;
    uint32_t push_bytes;
    uint32_t local_size[3];
    uint32_t (*shared_bytes)(const uint32_t* values); // of shared memory, for values in the order of `constants`
    uint32_t features;                                // KernelFeatures

    const ConstantInfo* constant(std::string_view constant_name) const
    {
        for (const auto& c : constants)
            if (c.name == constant_name)
                return &c;
        return nullptr;
    }
    uint32_t value(std::string_view constant_name) const // the default of one that it has
    {
        return constant(constant_name)->value;
    }
    std::optional<size_t> binding(std::string_view binding_name) const // its index
    {
        for (size_t b = 0; b < bindings.size(); ++b)
            if (bindings[b].name == binding_name)
                return b;
        return std::nullopt;
    }
    const PushMember* push_member(std::string_view member_name) const
    {
        for (const auto& m : push)
            if (m.name == member_name)
                return &m;
        return nullptr;
    }
};

// one op: all its variants take the same bindings (by name and order) and the same push struct
struct Kernel {
    std::string_view name;
    std::span<const KernelVariant> variants;
};

} // namespace semrover
