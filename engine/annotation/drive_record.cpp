// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/annotation/drive_record.h"

#include "engine/annotation/json_lines.h"
#include "engine/camera/lens.h"
#include "runtime/base/json_numbers.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <map>

namespace semrover {

namespace {

constexpr const char* kCalibrationFormat = "semrover.calibration";
constexpr double kSamePlace = 1e-6; // of a matrix' numbers, metres among them
constexpr double kLatest = 9e12;    // seconds whose microseconds are an int64

std::string camera_text(std::string_view name)
{
    return name.empty() ? std::string("the camera") : fmt::format("camera {}", quote(name));
}

bool same_place(const Rigid& a, const Rigid& b)
{
    for (size_t i = 0; i < a.size(); ++i)
        if (!(std::abs(a[i] - b[i]) <= kSamePlace))
            return false;
    return true;
}

// Where the first camera of a moment is, looking where it looks, is the vehicle. Takes frame by frame
class Mountings {
  public:
    explicit Mountings(std::span<const Sensor> rig) : sensors_(rig.begin(), rig.end()), given_(!rig.empty()) {}

    // first: of its moment
    Status add(const CameraFrame& frame, const CameraFrame& first)
    {
        auto sensor = std::ranges::find(sensors_, frame.camera, &Sensor::name);
        const Rigid camera_to_world = frame.pose.camera_to_world();
        if (&frame == &first && sensor != sensors_.end())
            vehicle_to_world_ = compose(camera_to_world, inverse(sensor->sensor_to_vehicle));
        else if (&frame == &first)
            vehicle_to_world_ = compose(camera_to_world, inverse(kForwardCamera));
        const Rigid here = compose(inverse(vehicle_to_world_), camera_to_world);
        if (sensor == sensors_.end() && !given_)
            sensor = sensors_.insert(sensors_.end(), {frame.camera, frame.intrinsics, here});
        if (sensor == sensors_.end())
            return fail(ErrorCode::bad_input, "{} is not one of its rig's", camera_text(frame.camera));
        if (sensor->intrinsics != frame.intrinsics)
            return fail(ErrorCode::bad_input, "{} changes its lens on the way", camera_text(frame.camera));
        if (!same_place(here, sensor->sensor_to_vehicle))
            return fail(ErrorCode::bad_input, "{} changes its place on the vehicle", camera_text(frame.camera));
        return {};
    }
    const Rigid& vehicle_to_world() const { return vehicle_to_world_; }
    std::vector<Sensor> take() { return std::move(sensors_); }

  private:
    std::vector<Sensor> sensors_;
    bool given_;
    Rigid vehicle_to_world_ = kIdentity;
};

Json along_rays(const DriveRecord& record)
{
    Json names = Json::array();
    for (const Sensor& s : record.sensors)
        if (Lens(s.intrinsics).radial_depth())
            names.push_back(s.name);
    return names;
}

Json calibration_json(const DriveRecord& record)
{
    Json rig = rig_json(record.sensors, record.lidars);
    rig["path_axes"] = "vehicle";
    return {{"format", kCalibrationFormat},
            {"version", 1},
            {"units", {{"length", "metre"}, {"time", "microsecond"}, {"angle", "radian"}, {"image", "pixel"}}},
            {"axes",
             {{"world", "right-handed, z up"},
              {"vehicle", "x forward, y left, z up"},
              {"camera", "x right, y down, z forward"},
              {"image", "x right, y down; the centre of the first pixel is (0.5, 0.5)"},
              {"quaternion", "x, y, z, w"}}},
            {"depth", {{"unit", record.depth_unit}, {"along_rays", along_rays(record)}}},
            {"rig", std::move(rig)}};
}

Status read_calibration(const Path& path, DriveRecord& record)
{
    const std::string where = quote_path(path);
    SR_TRY(const Json file, read_json(path));
    if (!file.is_object() || file.value("format", Json()) != kCalibrationFormat || file.value("version", Json()) != 1)
        return fail(ErrorCode::bad_input, "{}: expected an object with \"format\": \"{}\" and \"version\": 1", where,
                    kCalibrationFormat);
    constexpr std::string_view kKeys[] = {"format", "version", "units", "axes", "depth", "rig", "comment"};
    SR_CHECK(check_keys(file, kKeys, where));
    const Json depth = file.value("depth", Json());
    const auto unit = depth.is_object() ? depth.find("unit") : depth.end();
    if (!depth.is_object() || unit == depth.end() || !unit->is_number() || !(unit->get<double>() > 0))
        return fail(ErrorCode::bad_input, "{}: depth: expected a unit in metres above 0", where);
    record.depth_unit = unit->get<double>();
    SR_TRY(Rig rig, parse_rig(file.value("rig", Json()), where + ": rig"));
    record.sensors = std::move(rig.sensors);
    record.lidars = std::move(rig.lidars);
    return {};
}

Status read_moments(const Path& path, DriveRecord& record)
{
    constexpr std::string_view kKeys[] = {"time", "position", "rotation", "comment"};
    return read_json_lines(path, kKeys, [&](const Json& line, const std::string& where) -> Status {
        SR_TRY(const int64_t time, whole_number(line, "time", where));
        SR_TRY(const Point3 position, numbers_at<3>(line, "position", where));
        SR_TRY(const Quaternion rotation, numbers_at<4>(line, "rotation", where));
        SR_TRY(const Rigid pose, rigid_from_quaternion(position, rotation, where));
        if (!record.moments.empty() && time <= record.moments.back().time)
            return fail(ErrorCode::bad_input, "{}: time: expected more than {}, found {}", where,
                        record.moments.back().time, time);
        record.moments.push_back({time, pose});
        return {};
    });
}

Status read_pictures(const Path& path, DriveRecord& record)
{
    constexpr std::string_view kKeys[] = {"time", "camera", "number", "comment"};
    std::map<std::string, DriveRecord::Picture> last;
    return read_json_lines(path, kKeys, [&](const Json& line, const std::string& where) -> Status {
        DriveRecord::Picture p;
        SR_TRY(p.time, whole_number(line, "time", where));
        SR_TRY(p.camera, text_of(line, "camera", where));
        SR_TRY(const int64_t number, whole_number(line, "number", where));
        if (!record.sensor(p.camera) || !record.moment(p.time) || number < 0 || number > 999999)
            return fail(ErrorCode::bad_input,
                        "{}: expected a camera of calibration.json, a time of ego_pose.jsonl and "
                        "a number from 0 to 999999",
                        where);
        p.number = uint32_t(number);
        const auto [before, first] = last.try_emplace(p.camera, p);
        if (!first && (p.time <= before->second.time || p.number <= before->second.number))
            return fail(ErrorCode::bad_input, "{}: times and numbers of a camera must ascend", where);
        before->second = p;
        record.pictures.push_back(std::move(p));
        return {};
    });
}

} // namespace

const Sensor* DriveRecord::sensor(std::string_view name) const
{
    const auto found = std::ranges::find(sensors, name, &Sensor::name);
    return found == sensors.end() ? nullptr : &*found;
}

const DriveRecord::Moment* DriveRecord::moment(int64_t time) const
{
    const auto found = std::ranges::lower_bound(moments, time, {}, &Moment::time);
    return found == moments.end() || found->time != time ? nullptr : &*found;
}

Result<DriveRecord> drive_record_of(const CameraPath& path, double depth_unit)
{
    DriveRecord record;
    record.depth_unit = depth_unit;
    Mountings mountings(path.sensors);
    std::map<std::string, uint32_t> counts;
    std::map<std::string, int64_t> last; // time of each camera
    const CameraFrame* first = nullptr;
    for (const CameraFrame& frame : path.frames) {
        if (!(std::abs(frame.time) <= kLatest))
            return fail(ErrorCode::bad_input, "{} s are no microseconds of 64 bits", frame.time);
        const int64_t time = microseconds_of(frame.time);
        const bool begins = record.moments.empty() || time != record.moments.back().time;
        const auto [before, none] = last.try_emplace(frame.camera, time);
        if ((begins && !record.moments.empty() && time < record.moments.back().time) ||
            (!none && time <= before->second))
            return fail(ErrorCode::bad_input, "times do not ascend: {} us of {} come after {}", time,
                        camera_text(frame.camera), record.moments.back().time);
        before->second = time;
        if (begins)
            first = &frame;
        SR_CHECK(mountings.add(frame, *first));
        if (begins)
            record.moments.push_back({time, mountings.vehicle_to_world()});
        record.pictures.push_back({time, frame.camera, counts[frame.camera]++});
    }
    record.sensors = mountings.take();
    record.lidars = path.lidars;
    return record;
}

Status write_drive_record(const Path& folder, const DriveRecord& record)
{
    std::string poses, times;
    for (const DriveRecord::Moment& m : record.moments)
        poses += json_text(nlohmann::ordered_json{{"time", m.time},
                                                  {"position", translation_of(m.vehicle_to_world)},
                                                  {"rotation", quaternion_of(m.vehicle_to_world)}}) +
                 "\n";
    for (const DriveRecord::Picture& p : record.pictures)
        times += json_text(nlohmann::ordered_json{{"time", p.time}, {"camera", p.camera}, {"number", p.number}}) + "\n";
    SR_CHECK(write_file_atomically(folder / kDriveRecordFiles[0], json_text(calibration_json(record), 1) + "\n"));
    SR_CHECK(write_file_atomically(folder / kDriveRecordFiles[1], poses));
    return write_file_atomically(folder / kDriveRecordFiles[2], times);
}

Result<DriveRecord> read_drive_record(const Path& folder)
{
    DriveRecord record;
    SR_CHECK(read_calibration(folder / kDriveRecordFiles[0], record));
    SR_CHECK(read_moments(folder / kDriveRecordFiles[1], record));
    SR_CHECK(read_pictures(folder / kDriveRecordFiles[2], record));
    if (record.pictures.empty())
        return fail(ErrorCode::bad_input, "{}: no pictures", quote_path(folder / kDriveRecordFiles[2]));
    return record;
}

CameraPath path_of(const DriveRecord& record)
{
    CameraPath path;
    if (record.sensors.size() > 1 || !record.sensors[0].name.empty())
        path.sensors = record.sensors;
    for (const DriveRecord::Picture& p : record.pictures) {
        const Sensor& s = *record.sensor(p.camera);
        const Rigid camera_to_world = compose(record.moment(p.time)->vehicle_to_world, s.sensor_to_vehicle);
        path.frames.push_back({double(p.time) * 1e-6, p.camera, {inverse(camera_to_world)}, s.intrinsics});
    }
    return path;
}

} // namespace semrover
