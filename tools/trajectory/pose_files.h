// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/file.h"

#include <optional>

namespace semrover {

// Files of a 4x4 matrix each, by the numbers in their names: NNN.txt of ScanNet, frame-NNNNNN.pose.txt of 7-Scenes.
// Where names end in .pose.txt, others do not count. Empty where the first of them is no matrix.
std::vector<Path> pose_files_in(const Path& folder);

// the last number in a file's name; none without one, and for one of more than 15 digits
std::optional<uint64_t> number_in_name(const Path& file);

} // namespace semrover
