// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/semrover.h"
#include "engine/splat/rasterizer.h"

// what targets of a draw ask for
namespace semrover::capi {

using PictureFormats = std::array<PictureFormat, 5>; // of color, normal, depth, label and instance

inline std::array<const sr_target*, 5> targets_of(const sr_draw_desc& draw)
{
    return {&draw.color, &draw.normal, &draw.depth, &draw.label, &draw.instance};
}

// none where nobody wants a picture. Errors: usage for formats that the picture cannot have, and what does not go with
// them
Result<PictureFormats> formats_of(const sr_draw_desc& draw);

// of a picture that a rasterizer keeps so
uint64_t picture_bytes(const PictureFormat& format, const DeviceTensor& kept, uint32_t pixels);

} // namespace semrover::capi
