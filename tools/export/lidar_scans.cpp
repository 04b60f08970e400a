// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/export/lidar_scans.h"

#include "engine/annotation/json_lines.h"
#include "engine/format/lidar_points.h"
#include "engine/format/npy.h"
#include "runtime/base/json_numbers.h"
#include "runtime/base/quote.h"

#include <cmath>
#include <cstring>

namespace semrover {

namespace {

constexpr double kSameMount = 1e-6; // of a matrix' numbers

Result<Rigid> end_of(const Json& sweep, std::string_view where)
{
    if (!sweep.is_object() || !sweep.contains("end"))
        return fail(ErrorCode::bad_input, "{}: expected a sweep with its end", where);
    SR_TRY(const std::vector<double> values, numbers_of(sweep["end"], where));
    return rigid_from_matrix(values, where);
}

Status read_sweeps(const Path& folder, const DriveRecord& record, LidarScans& lidar)
{
    const Path path = folder / kSweepsName;
    const std::string name = quote_path(path);
    SR_TRY(const Json file, read_json(path, {.bytes = 256u << 20, .values = 32u << 20, .containers = 4u << 20}));
    if (!file.is_object() || file.value("format", Json()) != kSweepsFormat ||
        !file.value("sweeps", Json()).is_array() || file["sweeps"].size() != record.moments.size())
        return fail(ErrorCode::bad_input, "{}: expected the {} sweeps of the drive's moments", name,
                    record.moments.size());
    for (size_t i = 0; i < record.moments.size(); ++i) {
        const Json& sweep = file["sweeps"][i];
        const std::string where = fmt::format("{} sweep {}", name, i);
        SR_TRY(const Rigid to_world, end_of(sweep, where));
        SR_TRY(const int64_t time, whole_number(sweep, "time", where));
        const Rigid mount = compose(inverse(record.moments[i].vehicle_to_world), to_world);
        for (size_t k = 0; k < mount.size(); ++k)
            if (time != record.moments[i].time || std::abs(mount[k] - lidar.sensor_to_vehicle[k]) > kSameMount)
                return fail(ErrorCode::bad_input, "{}: another time than its moment's, or another place on the vehicle",
                            where);
        lidar.scans.push_back({folder / kSweepPoints / fmt::format("{:06}.npy", i), to_world});
        if (!is_file(lidar.scans.back().points))
            return fail(ErrorCode::bad_input, "{} is missing: points are read from .npy",
                        quote_path(lidar.scans.back().points));
    }
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
    SR_CHECK(read_sweeps(folder / lidar.sensor, record, lidar));
    return lidar;
}

Result<std::vector<ScanPoint>> read_scan(const Path& points)
{
    SR_TRY(const MappedFile file, MappedFile::open(points));
    const std::string name = quote_path(points);
    const std::string_view bytes(reinterpret_cast<const char*>(file.bytes().data()), file.bytes().size());
    SR_TRY(const NpyHeader header, parse_npy_header(bytes.substr(0, kNpyHeaderBytes), name));
    if (header.dtype != DType::f32 || header.big_endian || header.fortran_order || header.shape.size() != 2 ||
        header.shape[1] != ScanPoint().size() || header.bytes + header.data_bytes != bytes.size())
        return fail(ErrorCode::bad_input, "{}: expected float32 [N, {}]", name, ScanPoint().size());
    std::vector<ScanPoint> scan(header.shape[0]);
    if (!scan.empty())
        std::memcpy(scan.data(), bytes.data() + header.bytes, header.data_bytes);
    return scan;
}

} // namespace semrover
