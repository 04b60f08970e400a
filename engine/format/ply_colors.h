// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/color_scale.h"
#include "engine/format/ply_reader.h"

#include <array>

namespace semrover {

// the columns red, green and blue of an element, by the names that programs give them
class PlyColors {
  public:
    // none unless all three are there; they must outlive the result. Errors and warnings: ColorScale::decide
    static Result<std::optional<PlyColors>> find(const PlyElement& element, std::string_view where,
                                                 std::vector<std::string>& warnings);

    std::array<uint8_t, 3> bytes(size_t row) const;
    std::array<double, 3> fractions(size_t row) const; // 0 to 1

  private:
    using Channels = std::array<const PlyProperty*, 3>;
    PlyColors(const Channels& channels, ColorScale scale) : channels_(channels), scale_(scale) {}

    Channels channels_;
    ColorScale scale_;
};

} // namespace semrover
