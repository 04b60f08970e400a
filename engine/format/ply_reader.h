// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/file.h"
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

// Numbers of one type, kept as a binary file has them: small types take small memory.
class PlyValues {
  public:
    explicit PlyValues(PlyType type) : type_(type) {}

    PlyType type() const { return type_; }
    size_t size() const { return bytes_.size() / size_of(type_); }
    double operator[](size_t i) const;
    void reserve(size_t count) { bytes_.reserve(count * size_of(type_)); }
    void append(double value); // of the type's range
    void append(const char* bytes, bool big_endian);

  private:
    PlyType type_;
    std::vector<char> bytes_; // in the machine's order
};

// one property of all rows of an element
struct PlyProperty {
    std::string name;
    bool is_float = false;        // float or double in the file, else an integer
    bool is_list = false;         // then row r is values[starts[r]] .. values[starts[r + 1] - 1]
    PlyValues values;             // [rows], or all lists one after the other
    std::vector<uint32_t> starts; // [rows + 1] of a list
};

struct PlyElement {
    std::string name;
    uint64_t rows = 0;
    std::vector<PlyProperty> properties;

    const PlyProperty* find(std::string_view property) const; // null if there is none
};

struct PlyFile {
    std::vector<std::string> comments;
    std::vector<PlyElement> elements;
    uint64_t file_bytes = 0;

    const PlyElement* find(std::string_view element) const;
};

// A PLY file of any element and property order: ascii, binary little and big endian. Untrusted input: nothing is
// allocated that the file is too short to fill, and no more than five times its size (an ascii double of a digit and
// a blank takes 8 bytes, a list a byte long 4). Lists of one property hold less than 2^32 values. bad_input names the
// line or row.
Result<PlyFile> read_ply(const Path& path);

} // namespace semrover
