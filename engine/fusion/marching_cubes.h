// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/fusion/tsdf_volume.h"

namespace semrover {

// where the distance is 0: closed but for borders where something was not observed; every other edge has two faces
struct FusedSurface {
    std::vector<std::array<float, 3>> positions; // [V] metres, world
    std::vector<std::array<uint8_t, 3>> colors;  // [V] sRGB
    std::vector<uint8_t> labels;                 // [V] class or kNoLabel
    std::vector<uint8_t> views;                  // [V] frames that saw it; 7: or more
    std::vector<std::array<uint32_t, 3>> faces;  // [F] counter-clockwise seen from outside
};

// Errors: out_of_memory, device_lost
Result<FusedSurface> extract_surface(Device& device, const TsdfVolume& volume);

} // namespace semrover
