// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/annotation/drive_record.h"
#include "tools/dataset/lidar_sweeps.h"

namespace semrover {

// The sweeps of a drive's first lidar: LIDAR/sweeps.json and LIDAR/points/NNNNNN.npy of 8 columns
struct LidarScans {
    std::string sensor; // its folder; empty: there is none
    Rigid sensor_to_vehicle = kIdentity;
    std::vector<RecordedSweep> scans; // one a moment of the record

    bool there() const { return !scans.empty(); }
};

// bad_input for sweeps that are not at the moments of the record, and for a lidar that is not where the record has it
// on the vehicle
Result<LidarScans> read_lidar_scans(const Path& folder, const DriveRecord& record);

} // namespace semrover
