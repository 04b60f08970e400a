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

} // namespace semrover
