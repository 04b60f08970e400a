// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/rigid.h"
#include "runtime/base/file.h"

namespace semrover {

// a rigid motion as 12 or 16 numbers, row-major (rigid_from_matrix): text with blanks, commas or line ends between
// them and `#` comments; JSON, an array or an array of rows; a .npy of float32 or float64. bad_input
Result<Rigid> parse_rigid(std::string_view text, std::string_view where);
Result<Rigid> read_rigid(const Path& path);

// From the lidar to the rectified camera 0: Tr of odometry, or R0_rect and Tr_velo_to_cam of objects (of tracking:
// R_rect and Tr_velo_cam). bad_input: neither is there
Result<Rigid> read_kitti_lidar(const Path& path);

} // namespace semrover
