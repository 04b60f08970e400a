// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/dtype.h"

#include <iterator>
#include <optional>
#include <string>
#include <string_view>

// The names by which a shader and the planner understand each other. A shader that uses one of them wrongly does not
// build (cmake/reflect/protocol.cpp); the planner reads no other names of bindings, constants and push members. What
// ops name themselves (tiles, constants of epilogues) is theirs.
//
// clang-format off
// | where       | name         | meaning                                                                             |
// |-------------|--------------|-------------------------------------------------------------------------------------|
// | binding     | X            | input of an op that can be fused into the epilogue of the pass that makes it        |
// | binding     | Y            | output of a pass; a fused epilogue writes here                                      |
// | constant    | kType<B>     | type of the elements of the tensor bound to B, a uint of lib/pack.glsl; its default |
// |             |              | is the last type that the shader takes. A variant without it, where another has it, |
// |             |              | takes fp16                                                                          |
// | push member | rows         | rows of the output in this pass; a pass that may be cut into bands has it           |
// | push member | first_row    | which row of the whole output comes first                                           |
// | push member | <b>_first    | which row of B comes first, where a band reads rows around it                       |
// | push member | <b>_<what>   | belongs to binding B (`x_ld`) and moves with it into another pass                   |
// clang-format on
namespace semrover::shader_interface {

inline constexpr std::string_view kInput = "X", kOutput = "Y";
inline constexpr std::string_view kTypePrefix = "kType";
inline constexpr std::string_view kRows = "rows", kFirstRow = "first_row";
inline constexpr std::string_view kFirstSuffix = "_first";

// "kTypeX" of X
inline std::string type_constant(std::string_view binding)
{
    return std::string(kTypePrefix).append(binding);
}

// what kType<B> is of a tensor's type; none: no shader takes it where it has a choice
inline std::optional<uint32_t> type_number(DType t)
{
    static constexpr DType kTypes[] = {DType::f32, DType::f16, DType::q8_0};
    for (uint32_t i = 0; i < std::size(kTypes); ++i)
        if (kTypes[i] == t)
            return i;
    return std::nullopt;
}

// "x_" of X: what push members that belong to a binding begin with
inline std::string member_prefix(std::string_view binding)
{
    std::string name(binding);
    if (name[0] >= 'A' && name[0] <= 'Z')
        name[0] = char(name[0] - 'A' + 'a');
    return name + '_';
}

// "x_first" of X
inline std::string first_member(std::string_view binding)
{
    return member_prefix(binding) + "first";
}

} // namespace semrover::shader_interface
