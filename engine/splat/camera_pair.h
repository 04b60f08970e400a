// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/splat/rasterizer.h"

namespace semrover {

// Two frames of one camera, as kernels that compare them take them: what pixels of one show in the other
struct CameraPair {
    CameraModel model = CameraModel::pinhole; // of both: a pinhole that moves while it is read out is an opencv lens
    bool moving = false;                      // one of them does
    std::vector<float> rows; // [2, kLensCameraFloats]: the world is the first one's own (still) frame, where numbers
                             // are small and fp32 is enough
};
// both of one lens model
CameraPair pair_of(CameraFrame first, CameraFrame second);

} // namespace semrover
