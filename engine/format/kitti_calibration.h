// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/rigid.h"
#include "runtime/base/file.h"

namespace semrover {

// From the lidar to the rectified camera 0: Tr of odometry, or R0_rect and Tr_velo_to_cam of objects (of tracking:
// R_rect and Tr_velo_cam). bad_input: neither is there
Result<Rigid> read_kitti_lidar(const Path& path);

} // namespace semrover
