// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/dataset/lidar_sweeps.h"

#include "engine/annotation/json_lines.h"
#include "engine/format/lidar_points.h"
#include "engine/format/npy.h"
#include "runtime/base/json_numbers.h"
#include "runtime/base/quote.h"

#include <cstring>

namespace semrover {

namespace {

Result<RecordedSweep> parse_sweep(const Json& sweep, std::string_view where)
{
    if (!sweep.is_object() || !sweep.contains("end"))
        return fail(ErrorCode::bad_input, "{}: expected a sweep with its end", where);
    RecordedSweep recorded;
    SR_TRY(const std::vector<double> values, numbers_of(sweep["end"], where));
    SR_TRY(recorded.to_world, rigid_from_matrix(values, where));
    SR_TRY(recorded.time, whole_number(sweep, "time", where));
    return recorded;
}

} // namespace

Result<std::vector<RecordedSweep>> read_sweeps(const Path& folder)
{
    const Path path = folder / kSweepsName;
    const std::string name = quote_path(path);
    SR_TRY(const Json file, read_json(path, {.bytes = 256u << 20, .values = 32u << 20, .containers = 4u << 20}));
    if (!file.is_object() || file.value("format", Json()) != kSweepsFormat || !file.value("sweeps", Json()).is_array())
        return fail(ErrorCode::bad_input, "{}: expected an object with format {} and sweeps", name, kSweepsFormat);
    std::vector<RecordedSweep> sweeps;
    for (const Json& sweep : file["sweeps"]) {
        SR_TRY(RecordedSweep recorded, parse_sweep(sweep, fmt::format("{} sweep {}", name, sweeps.size())));
        recorded.points = folder / kSweepPoints / fmt::format("{:06}.npy", sweeps.size());
        if (!is_file(recorded.points))
            return fail(ErrorCode::bad_input, "{} is missing: points are read from .npy", quote_path(recorded.points));
        sweeps.push_back(std::move(recorded));
    }
    return sweeps;
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
