// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/camera.h"

#include <functional>

namespace semrover {

// pictures of one frame, [height, width], top row first
struct DepthImages {
    std::vector<float> depth;    // metres along the optical axis; 0: nothing
    std::vector<uint8_t> labels; // class or kNoLabel; empty: no labels
    std::vector<uint8_t> colors; // [.., 3] sRGB; empty: gray
};

// The input of fusion: cameras, and a function that loads a frame's pictures. It is called more than once for a frame.
struct DepthFrames {
    std::vector<CameraFrame> cameras;
    std::function<Result<DepthImages>(size_t)> load;
};

} // namespace semrover
