// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/label_map.h"
#include "engine/format/number_image.h"

namespace semrover {

// What the numbers of label pictures mean: 0 to 19 are our classes, unless --map says others, and 255 and 65535 are
// nothing, unless it knows them
class PictureClasses {
  public:
    static Result<PictureClasses> create(const Path& map); // empty: none. Errors: those of LabelMap::apply

    void count(const LabelImage& image); // before its numbers are asked for

    // bad_input where some numbers are unknown: LabelMap::check
    Status check(std::string_view where) const;

    bool counted() const { return !classes_.empty(); }
    uint8_t operator[](uint16_t number) const { return classes_[number]; } // a class, kLeftOut or kEmpty

  private:
    LabelMap map_;
    std::vector<uint8_t> classes_;
};

} // namespace semrover
