// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/rigid.h"
#include "runtime/base/file.h"

#include <vector>

namespace semrover {

// a turn of a lidar, as sweeps.json has it
struct RecordedSweep {
    int64_t time = 0;           // of its end, microseconds
    Rigid to_world = kIdentity; // of its points
    Path points;                // a file
};

// FOLDER/sweeps.json, and which of FOLDER/points/NNNNNN.npy belongs to each. bad_input, also where a file is not there
Result<std::vector<RecordedSweep>> read_sweeps(const Path& folder);

// x y z (metres, the sensor's axes) intensity (0..1) ring time label instance
using ScanPoint = std::array<float, 8>;
Result<std::vector<ScanPoint>> read_scan(const Path& points);

} // namespace semrover
