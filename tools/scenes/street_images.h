// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/cli/commands.h"
#include "tools/streets/street.h"
#include "tools/trace/tracer.h"

#include <optional>

namespace semrover {

struct StreetImages {
    uint32_t width = 616, height = 424;
    uint32_t samples = 4, ambient_rays = 2;
    std::optional<double> sun_azimuth, sun_elevation; // degrees, as in Daylight
    std::optional<double> cloud_cover;                // 0..1
};

// pictures of a drive through a street, FOLDER/{color,depth,normal,label,visible}/NNNNNN.png, in daylight of the seed
// where `images` does not say another
Status draw_street(Device& device, const Street& street, const CameraPath& path, uint64_t seed,
                   const StreetImages& images, const Path& folder, const Globals& globals);

} // namespace semrover
