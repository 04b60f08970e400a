// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/export/lidar_scans.h"

#include "engine/format/lidar_points.h"
#include "runtime/base/quote.h"

#include <cmath>

namespace semrover {

namespace {

constexpr double kSameMount = 1e-6; // of a matrix' numbers

Status add_scans(const Path& folder, const DriveRecord& record, LidarScans& lidar)
{
    const std::string name = quote_path(folder / kSweepsName);
    SR_TRY(std::vector<RecordedSweep> sweeps, read_sweeps(folder));
    if (sweeps.size() != record.moments.size())
        return fail(ErrorCode::bad_input, "{}: expected the {} sweeps of the drive's moments", name,
                    record.moments.size());
    for (size_t i = 0; i < sweeps.size(); ++i) {
        const Rigid mount = compose(inverse(record.moments[i].vehicle_to_world), sweeps[i].to_world);
        for (size_t k = 0; k < mount.size(); ++k)
            if (sweeps[i].time != record.moments[i].time ||
                std::abs(mount[k] - lidar.sensor_to_vehicle[k]) > kSameMount)
                return fail(ErrorCode::bad_input,
                            "{} sweep {}: another time than its moment's, or another place on the vehicle", name, i);
    }
    lidar.scans = std::move(sweeps);
    return {};
}

} // namespace

Result<LidarScans> read_lidar_scans(const Path& folder, const DriveRecord& record)
{
    LidarScans lidar;
    if (record.lidars.empty())
        return lidar;
    lidar.sensor = record.lidars.front().name;
    lidar.sensor_to_vehicle = record.lidars.front().sensor_to_vehicle;
    SR_CHECK(add_scans(folder / lidar.sensor, record, lidar));
    return lidar;
}

} // namespace semrover
