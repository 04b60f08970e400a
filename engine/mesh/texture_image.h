// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/image.h"

namespace semrover {

// Reads an image file of a mesh's texture: PNG, JPEG, BMP or Radiance HDR, told by its first bytes, or TGA, which has
// no such bytes and is told by its name. Alpha is dropped. HDR holds linear light: it is clamped to 0..1 and becomes
// sRGB. Untrusted input: at most 1 GiB and kMaxImageSide, nothing is allocated that the file is too short to fill, and
// a file that is cut is refused.
Result<ImageRgb8> read_texture_rgb8(const Path& path);

} // namespace semrover
