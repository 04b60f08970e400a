// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/export/drive_input.h"

namespace semrover {

// Where pictures of a drive show road, lane markings or sidewalk, seen from above
struct MapMask {
    double left = 0, bottom = 0; // of the picture's lower left corner in the world, metres: whole tens
    uint32_t width = 0, height = 0;
    std::vector<uint8_t> pixels; // [height, width], 255: there is some; rows from high y to low y
    bool known = false;          // there are pictures of labels and depths
};

// metres_per_pixel: a pixel is set where a pixel of a picture lies in it, of every second one. It covers the vehicle's
// way and 60 m around it, and is at most kMaxImageSide wide and high; bad_input for longer drives, and as readers say
Result<MapMask> map_mask_of(const DriveInput& drive, double metres_per_pixel);

} // namespace semrover
