// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/ply_header.h"
#include "runtime/base/file.h"

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace semrover {

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

    const PlyElement* find(std::string_view element) const;
};

// A PLY file of any element and property order: ascii, binary little and big endian. Untrusted input: nothing is
// allocated that the file is too short to fill, and no more than five times its size (an ascii double of a digit and
// a blank takes 8 bytes, a list a byte long 4). Lists of one property hold less than 2^32 values. bad_input names the
// line or row.
Result<PlyFile> read_ply(const Path& path);

} // namespace semrover
