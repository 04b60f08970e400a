// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/file.h"
#include "runtime/base/result.h"

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace semrover {

// one property of all rows of an element, whatever its type in the file
struct PlyProperty {
    std::string name;
    bool is_float = false;        // float or double in the file, else an integer
    bool is_list = false;         // then row r is values[starts[r]] .. values[starts[r + 1] - 1]
    std::vector<double> values;   // [rows], or all lists one after the other
    std::vector<uint64_t> starts; // [rows + 1] of a list
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
// allocated that the file is too short to fill. bad_input names the line or row.
Result<PlyFile> read_ply(const Path& path);

} // namespace semrover
