// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/result.h"

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace semrover {

// how the rows of a PLY file lie in it. Source: Greg Turk, "The PLY Polygon File Format", 1994; the sized names
// (uint8, float32, ...) are those that later programs write.
enum class PlyFormat : uint8_t { ascii, little_endian, big_endian };
enum class PlyType : uint8_t { i8, u8, i16, u16, i32, u32, f32, f64 };

struct PlyColumn {
    PlyType type = PlyType::f32;
    std::optional<PlyType> count; // of a list: the type of its length, an integer
};

struct PlyLayout {
    std::string name;
    uint64_t rows = 0;
    std::vector<std::string> names; // of the columns, each once
    std::vector<PlyColumn> columns;
};

struct PlyHeader {
    PlyFormat format = PlyFormat::ascii;
    std::vector<std::string> comments;
    std::vector<PlyLayout> elements;
    size_t bytes = 0;   // where the rows begin
    uint64_t lines = 0; // of the header
};

size_t size_of(PlyType type); // bytes
bool is_float(PlyType type);
std::string_view name_of(PlyType type);
std::pair<double, double> range_of(PlyType type); // of an integer type

// bad_input names the line; a header of more than 1 MiB, an element with rows and without properties, and names that
// are given twice are refused
Result<PlyHeader> parse_ply_header(std::string_view bytes, std::string_view where);

} // namespace semrover
