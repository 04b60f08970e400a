// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/palette.h"
#include "runtime/base/file.h"

#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace semrover {

constexpr uint8_t kLeftOut = 254; // a source label whose cells stay empty
constexpr uint8_t kEmpty = 255;   // free space in the source

// what a format calls its classes
struct SourceLabel {
    uint32_t number;
    std::string_view name;
    uint8_t target; // a class, kLeftOut or kEmpty
};

constexpr std::string_view kMapAdvice = "--map FILE says what they are";

// Maps source label numbers to classes, and counts the lookups of each.
class LabelMap {
  public:
    LabelMap() = default;
    explicit LabelMap(std::span<const SourceLabel> labels);
    static LabelMap identity(); // 0..19 are the classes themselves

    void set(uint32_t source, std::string name, std::optional<uint8_t> target); // none: known by name only

    // Reads JSON: an object of source label (number, or name in the format's table) to class (name or number), or null
    // to leave it out. The file's entries override the others. bad_input names the entry.
    Status apply(const Path& file);

    // a class, kLeftOut (also for an unknown label) or kEmpty
    uint8_t operator()(uint32_t source, uint64_t count = 1);

    // bad_input if unknown labels were looked up: one line with their counts, `advice` at its end
    Status check(std::string_view where, std::string_view things, std::string_view advice = kMapAdvice) const;
    // "4 of label 99 (other-object)", a line for each source label that was left out
    std::vector<std::string> left_out(std::string_view things) const;
    uint64_t dropped() const; // how many were left out

  private:
    struct Entry {
        std::string name;
        std::optional<uint8_t> target; // none: unknown
        uint64_t count = 0;
    };
    std::map<uint32_t, Entry> entries_;
};

} // namespace semrover
