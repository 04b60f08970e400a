// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/ply_reader.h"
#include "runtime/base/result.h"

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace semrover {

// What the numbers of a file's colours are counted in: the one rule of points, meshes and splats, known by their type
// and by the largest of all three channels.
//   bytes            0 to 255
//   larger integers  0 to 255 where none is more (with a warning for 16 bits, whose white is 65535), else 0 to 65535,
//                    which is 257 times a byte, as LAS and PDAL have it
//   floats           0 to 1 where none is more, else 0 to 255 (with a warning where that makes them almost black)
enum class ColorType : uint8_t { byte, word, integer, real };

class ColorScale {
  public:
    explicit ColorScale(ColorType type) : type_(type) {}

    void see(double value, size_t row); // each number of the file
    // bad_input, with `where` in front, for negative numbers, for those that are not finite, and for larger ones
    Status decide(std::string_view where, std::vector<std::string>& warnings);

    // after decide()
    double level_of(double value) const; // 0 to 255
    uint8_t byte_of(double value) const;

  private:
    ColorType type_;
    double least_ = 0, most_ = 0, factor_ = 1;
    std::optional<size_t> odd_row_; // the first that has a number which is not finite
};

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
