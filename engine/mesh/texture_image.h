// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/image.h"

#include <algorithm>

namespace semrover {

// What the textures of a mesh may have together, so that files of a few bytes do not fill memory: 2^26 pixels, and 32
// more for each byte of their files (a JPEG of a photograph has 1 to 16); 2^30 at most.
class TextureBudget {
  public:
    // of the next image, whose file has so many bytes
    uint64_t pixels_left(uint64_t file_bytes)
    {
        bytes_ += file_bytes;
        return std::min(uint64_t(1) << 30, (uint64_t(1) << 26) + 32 * bytes_) - pixels_;
    }
    void take(const ImageRgb8& image) { pixels_ += uint64_t(image.width) * image.height; }

  private:
    uint64_t bytes_ = 0, pixels_ = 0;
};

// Reads an image file of a mesh's texture: PNG, JPEG, BMP or Radiance HDR, known by its first bytes, or TGA, which has
// no such bytes and is known by its name. HDR holds linear light: it is clamped to 0..1 and becomes
// sRGB. Untrusted input: at most 1 GiB and kMaxImageSide, nothing is allocated that the file is too short to fill, and
// a file that is cut is refused, like one that exceeds the budget.
Result<ImageWithAlpha> read_texture(const Path& path, TextureBudget& budget);

// The numbers of a label texture in a PNG whose colours are not its numbers: a palette in other than the classes'
// colours says its indices; gray of 1, 2, 4 or 16 bits, and gray beside alpha (0: none), says its values. [height,
// width]; empty for other pictures. bad_input; the file's colours were read before.
Result<std::vector<uint16_t>> texture_numbers(std::span<const std::byte> file, std::string_view where);

} // namespace semrover
