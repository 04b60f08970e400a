// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/camera/rig.h"

#include "engine/camera/ftheta_json.h"
#include "runtime/base/json_numbers.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <cmath>
#include <set>

namespace semrover {

namespace {

constexpr size_t kMaxSensors = 64;

Status check_keys(const Json& object, std::initializer_list<std::string_view> known, std::string_view where)
{
    for (const auto& entry : object.items())
        if (std::ranges::find(known, entry.key()) == known.end())
            return fail(ErrorCode::bad_input, "{}: unknown key {}, expected one of {}", where, quote(entry.key(), 60),
                        fmt::join(known, ", "));
    return {};
}

Result<double> required_number(const Json& object, const char* key, std::string_view where)
{
    SR_TRY(const std::optional<double> value, optional_number(object, key, where));
    if (!value)
        return fail(ErrorCode::bad_input, "{}: {} is missing", where, key);
    return *value;
}

Result<CameraModel> read_model(const Json& json, std::string_view where)
{
    if (!json.contains("model"))
        return CameraModel::pinhole;
    const Json& model = json["model"];
    const auto found = model.is_string() ? camera_model_of(model.get_ref<const std::string&>()) : std::nullopt;
    if (!found)
        return fail(ErrorCode::bad_input,
                    "{}: model {} is not supported, expected \"pinhole\", \"opencv\", \"fisheye\", "
                    "\"equirectangular\" or \"ftheta\"",
                    where, printable(json_text(model, -1, true), 60));
    return *found;
}

Result<Intrinsics> from_fov(double fov, const Intrinsics& size, std::string_view where)
{
    const bool fisheye = size.model == CameraModel::fisheye;
    if (!(fov > 0 && (fisheye ? fov <= 360 : fov < 180)))
        return fail(ErrorCode::bad_input, "{}: expected a fov above 0 and {} degrees, found {}", where,
                    fisheye ? "at most 360" : "below 180", fov);
    Intrinsics k =
        fisheye ? fisheye_from_fov(fov, size.width, size.height) : pinhole_from_fov(fov, size.width, size.height);
    k.model = size.model;
    return k;
}

Status read_distortion(const Json& json, Intrinsics& k, std::string_view where)
{
    if (!json.contains("distortion"))
        return {};
    const std::string what = fmt::format("{}: distortion", where);
    SR_TRY(const std::vector<double> values, numbers_of(json["distortion"], what));
    const size_t n = values.size();
    const bool fits = k.model == CameraModel::opencv    ? n == 4 || n == 5 || n == 8 || n == 12
                      : k.model == CameraModel::fisheye ? n == 4
                                                        : n == 0;
    if (!fits)
        return fail(ErrorCode::bad_input, "{}: expected {} of model {}, found {}", what,
                    k.model == CameraModel::opencv    ? "4, 5, 8 or 12 numbers"
                    : k.model == CameraModel::fisheye ? "4 numbers"
                                                      : "no numbers",
                    name_of(k.model), n);
    std::ranges::copy(values, k.distortion.begin());
    return {};
}

Result<Intrinsics> read_intrinsics(const Json& json, std::string_view where)
{
    SR_TRY(const double width, required_number(json, "width", where));
    SR_TRY(const double height, required_number(json, "height", where));
    Intrinsics k;
    SR_TRY(k.width, image_side(width, fmt::format("{}: width", where)));
    SR_TRY(k.height, image_side(height, fmt::format("{}: height", where)));
    SR_TRY(k.model, read_model(json, where));
    SR_TRY(const std::optional<double> fov, optional_number(json, "fov", where));
    for (const std::string_view key : kFthetaKeys)
        if (k.model != CameraModel::ftheta && json.contains(key))
            return fail(ErrorCode::bad_input, "{}: {}, which a sensor of model {} has not", where, key,
                        name_of(k.model));
    const bool focal = json.contains("fx") || json.contains("fy") || json.contains("cx") || json.contains("cy");
    if (k.model == CameraModel::equirectangular) {
        if (fov || focal)
            return fail(ErrorCode::bad_input, "{}: an equirectangular sensor sees the whole sphere, without fov or fx",
                        where);
        k = whole_sphere(k.width, k.height);
    } else if (k.model == CameraModel::ftheta) {
        if (fov || focal)
            return fail(ErrorCode::bad_input, "{}: a sensor of model ftheta has a polynomial, without fov or fx",
                        where);
        SR_CHECK(read_ftheta(json, k, where));
    } else if (fov) {
        if (focal)
            return fail(ErrorCode::bad_input, "{}: expected fov or fx, fy, cx, cy, found both", where);
        SR_TRY(k, from_fov(*fov, k, where));
    } else {
        SR_TRY(k.fx, required_number(json, "fx", where));
        SR_TRY(k.fy, required_number(json, "fy", where));
        SR_TRY(k.cx, required_number(json, "cx", where));
        SR_TRY(k.cy, required_number(json, "cy", where));
    }
    SR_CHECK(read_distortion(json, k, where));
    SR_CHECK(check_intrinsics(k, where));
    return simplified(k);
}

Result<Rigid> read_mounting(const Json& json, std::string_view where)
{
    if (!json.is_object()) {
        SR_TRY(const std::vector<double> values, numbers_of(json, where));
        return rigid_from_matrix(values, where);
    }
    SR_CHECK(check_keys(json, {"translation", "rotation"}, where));
    std::vector<double> t(3, 0.0), q;
    if (json.contains("translation")) {
        SR_TRY(t, numbers_of(json["translation"], fmt::format("{}: translation", where)));
    }
    if (!json.contains("rotation"))
        return fail(ErrorCode::bad_input, "{}: rotation is missing", where);
    SR_TRY(q, numbers_of(json["rotation"], fmt::format("{}: rotation", where)));
    if (t.size() != 3 || q.size() != 4)
        return fail(ErrorCode::bad_input,
                    "{}: expected a translation of 3 and a rotation of 4 numbers, found {} and {}", where, t.size(),
                    q.size());
    return rigid_from_quaternion({t[0], t[1], t[2]}, {q[0], q[1], q[2], q[3]}, where);
}

// microseconds, whole ones
Result<int64_t> read_microseconds(const Json& json, const char* key, int64_t low, std::string_view where)
{
    constexpr int64_t kMost = 1'000'000;
    SR_TRY(const double value, required_number(json, key, where));
    if (value != std::floor(value) || value < double(low) || value > kMost)
        return fail(ErrorCode::bad_input, "{}: {}: expected whole microseconds from {} to {}, found {}", where, key,
                    low, kMost, value);
    return int64_t(value);
}

Result<std::optional<Shutter>> read_shutter(const Json& json, std::string_view where)
{
    if (!json.is_object())
        return fail(ErrorCode::bad_input, "{}: expected an object, found {}", where, json.type_name());
    SR_CHECK(check_keys(json, {"direction", "start", "readout", "comment"}, where));
    const Json direction = json.value("direction", Json());
    const auto found =
        direction.is_string() ? shutter_direction_of(direction.get_ref<const std::string&>()) : std::nullopt;
    if (!found)
        return fail(ErrorCode::bad_input, "{}: direction: expected \"down\", \"up\", \"right\" or \"left\", found {}",
                    where, printable(json_text(direction, -1, true), 60));
    Shutter shutter{.direction = *found};
    if (json.contains("start")) {
        SR_TRY(shutter.start, read_microseconds(json, "start", -1'000'000, where));
    }
    SR_TRY(shutter.readout, read_microseconds(json, "readout", 0, where));
    return std::optional(shutter);
}

// alone: in its rig, where it needs no name
Result<std::string> read_name(const Json& json, bool alone, std::string_view where)
{
    const Json name = json.value("name", Json());
    if (!name.is_string() || !(is_camera_name(name.get_ref<const std::string&>()) || (alone && name == "")))
        return fail(ErrorCode::bad_input, "{}: expected a name of letters, digits, '.', '_' and '-'", where);
    if (!json.contains("sensor_to_vehicle"))
        return fail(ErrorCode::bad_input, "{}: sensor_to_vehicle is missing", where);
    return name.get<std::string>();
}

Result<Sensor> read_sensor(const Json& json, bool alone, std::string_view where)
{
    SR_CHECK(check_keys(json,
                        {"name", "model", "width", "height", "fov", "fx", "fy", "cx", "cy", "distortion",
                         "principal_point", "reference_poly", "pixeldist_to_angle_poly", "angle_to_pixeldist_poly",
                         "max_angle", "linear_cde", "shutter", "sensor_to_vehicle", "comment"},
                        where));
    Sensor sensor;
    SR_TRY(sensor.name, read_name(json, alone, where));
    SR_TRY(sensor.intrinsics, read_intrinsics(json, where));
    if (json.contains("shutter")) {
        SR_TRY(sensor.shutter, read_shutter(json["shutter"], fmt::format("{}: shutter", where)));
    }
    SR_TRY(sensor.sensor_to_vehicle,
           read_mounting(json["sensor_to_vehicle"], fmt::format("{}: sensor_to_vehicle", where)));
    return sensor;
}

// folder: of the rig's file
Result<Lidar> read_table(const Json& json, const Path& folder, const std::string& where)
{
    if (json.is_object())
        return parse_lidar(json, where);
    if (!json.is_string())
        return fail(ErrorCode::bad_input, "{}: expected the name of a lidar, a file or a table, found {}", where,
                    json.type_name());
    const std::string& name = json.get_ref<const std::string&>();
    return name.ends_with(".json") ? read_lidar(folder / name) : named_lidar(name);
}

Result<LidarSensor> read_lidar_sensor(const Json& json, const Path& folder, std::string_view where)
{
    SR_CHECK(check_keys(json, {"name", "lidar", "sensor_to_vehicle", "comment"}, where));
    LidarSensor sensor;
    SR_TRY(sensor.name, read_name(json, false, where));
    SR_TRY(Lidar read, read_table(json["lidar"], folder, fmt::format("{}: lidar", where)));
    sensor.lidar = std::make_shared<const Lidar>(std::move(read));
    SR_TRY(sensor.sensor_to_vehicle,
           read_mounting(json["sensor_to_vehicle"], fmt::format("{}: sensor_to_vehicle", where)));
    return sensor;
}

// where the vehicle is at any time
class Course {
  public:
    void add(double time, const Rigid& vehicle_to_world)
    {
        times_.push_back(time);
        poses_.push_back(vehicle_to_world);
    }
    const Rigid& pose(size_t i) const { return poses_[i]; }

    // bad_input unless times rise
    Status check() const
    {
        for (size_t i = 1; i < times_.size(); ++i)
            if (!(times_[i] > times_[i - 1]))
                return fail(
                    ErrorCode::bad_input,
                    "rolling shutters and lidars need poses at times that rise: pose {} is at {} s, the one before at "
                    "{} s",
                    i, times_[i], times_[i - 1]);
        return {};
    }

    Rigid at(double time) const
    {
        if (poses_.size() == 1)
            return poses_[0];
        const auto after = std::upper_bound(times_.begin() + 1, times_.end() - 1, time) - times_.begin();
        const double since = time - times_[after - 1], between = times_[after] - times_[after - 1];
        return interpolate(poses_[after - 1], poses_[after], since / between);
    }

  private:
    std::vector<double> times_;
    std::vector<Rigid> poses_;
};

// of a frame at pose i of the vehicle
Readout readout_of(const Sensor& sensor, const CameraFrame& frame, const Course& course, size_t i)
{
    const auto pose_at = [&](int64_t microseconds) {
        const Rigid vehicle = course.at(frame.time + double(microseconds) * 1e-6);
        if (vehicle == course.pose(i)) // to the bit, as without a shutter
            return frame.pose;
        return Pose{compose(inverse(sensor.sensor_to_vehicle), inverse(vehicle))};
    };
    const Shutter& s = *sensor.shutter;
    const int64_t end = s.start + s.readout;
    return {s.direction, pose_at(s.start), pose_at(end), double(s.start) * 1e-6, double(end) * 1e-6};
}

// of a lens with distortion, those that it needs
size_t coefficients_of(const Intrinsics& k)
{
    const bool prism = std::ranges::any_of(std::span(k.distortion).subspan(8), [](double v) { return v != 0; });
    return k.model == CameraModel::fisheye ? 4 : prism ? 12 : 8;
}

Result<PathAxes> read_path_axes(const Json& file, std::string_view where)
{
    if (!file.contains("path_axes") || file["path_axes"] == "camera")
        return PathAxes::camera;
    if (file["path_axes"] == "vehicle")
        return PathAxes::vehicle;
    return fail(ErrorCode::bad_input, "{}: path_axes: expected \"camera\" or \"vehicle\", found {}", where,
                printable(json_text(file["path_axes"], -1, true), 60));
}

} // namespace

Result<Rig> read_rig(const Path& path)
{
    SR_TRY(const Json file, read_json(path));
    return parse_rig(file, quote_path(path), path.parent_path());
}

Result<Rig> parse_rig(const Json& file, std::string_view name, const Path& folder)
{
    if (!file.is_object() || !file.contains("sensors") || !file["sensors"].is_array())
        return fail(ErrorCode::bad_input, "{}: expected an object with an array of sensors", name);
    SR_CHECK(check_keys(file, {"path_axes", "sensors", "comment"}, name));
    const Json& sensors = file["sensors"];
    if (sensors.empty() || sensors.size() > kMaxSensors)
        return fail(ErrorCode::bad_input, "{}: expected 1 to {} sensors, found {}", name, kMaxSensors, sensors.size());
    Rig rig;
    std::set<std::string> names;
    SR_TRY(rig.path_axes, read_path_axes(file, name));
    for (size_t i = 0; i < sensors.size(); ++i) {
        const std::string where = fmt::format("{} sensor {}", name, i);
        if (!sensors[i].is_object())
            return fail(ErrorCode::bad_input, "{}: expected an object, found {}", where, sensors[i].type_name());
        if (sensors[i].contains("lidar")) {
            SR_TRY(LidarSensor sensor, read_lidar_sensor(sensors[i], folder, where));
            rig.lidars.push_back(std::move(sensor));
        } else {
            SR_TRY(Sensor sensor, read_sensor(sensors[i], sensors.size() == 1, where));
            rig.sensors.push_back(std::move(sensor));
        }
        const std::string called = sensors[i]["name"].get<std::string>();
        if (!names.insert(called).second)
            return fail(ErrorCode::bad_input, "{}: two sensors are called {}", name, quote(called));
    }
    return rig;
}

Json matrix_json(const Rigid& pose)
{
    Json rows = Json::array();
    for (size_t row = 0; row < 4; ++row)
        rows.push_back(std::span(pose).subspan(4 * row, 4));
    return rows;
}

Json rig_json(std::span<const Sensor> sensors, std::span<const LidarSensor> lidars)
{
    Json list = Json::array();
    for (const Sensor& s : sensors) {
        const Intrinsics& k = s.intrinsics;
        Json sensor{
            {"name", s.name}, {"model", std::string(name_of(k.model))}, {"width", k.width}, {"height", k.height}};
        if (k.model == CameraModel::ftheta)
            put_ftheta(sensor, k);
        else if (k.model != CameraModel::equirectangular)
            sensor.update({{"fx", k.fx}, {"fy", k.fy}, {"cx", k.cx}, {"cy", k.cy}});
        if (k.model == CameraModel::opencv || k.model == CameraModel::fisheye)
            sensor["distortion"] = std::span(k.distortion).first(coefficients_of(k));
        if (s.shutter)
            sensor["shutter"] = {{"direction", std::string(name_of(s.shutter->direction))},
                                 {"start", s.shutter->start},
                                 {"readout", s.shutter->readout}};
        sensor["sensor_to_vehicle"] = matrix_json(s.sensor_to_vehicle);
        list.push_back(std::move(sensor));
    }
    for (const LidarSensor& s : lidars)
        list.push_back(
            {{"name", s.name}, {"lidar", s.lidar->table}, {"sensor_to_vehicle", matrix_json(s.sensor_to_vehicle)}});
    return {{"sensors", list}};
}

Result<CameraPath> expand_rig(const Rig& rig, const CameraPath& vehicle)
{
    CameraPath cameras{.frames = {},
                       .sensors = rig.sensors,
                       .lidars = rig.lidars,
                       .numbered = vehicle.numbered,
                       .warnings = vehicle.warnings};
    Course course;
    for (size_t i = 0; i < vehicle.frames.size(); ++i) {
        const CameraFrame& pose = vehicle.frames[i];
        const Rigid world_to_vehicle = rig.path_axes == PathAxes::camera
                                           ? compose(kForwardCamera, pose.pose.world_to_camera)
                                           : inverse(vehicle.file_pose(i));
        course.add(pose.time, inverse(world_to_vehicle));
        for (const Sensor& sensor : rig.sensors)
            cameras.frames.push_back({pose.time,
                                      sensor.name,
                                      {compose(inverse(sensor.sensor_to_vehicle), world_to_vehicle)},
                                      sensor.intrinsics});
        for (const LidarSensor& sensor : rig.lidars) {
            const Rigid to_world = compose(inverse(world_to_vehicle), sensor.sensor_to_vehicle);
            cameras.sweeps.push_back({pose.time, sensor.name, sensor.lidar, to_world, to_world});
        }
    }
    const bool shutters = std::ranges::any_of(rig.sensors, [](const Sensor& s) { return s.shutter.has_value(); });
    if (!shutters && rig.lidars.empty())
        return cameras;
    if (vehicle.numbered && shutters)
        return fail(ErrorCode::bad_input, "a rolling shutter needs poses with times; these have numbers");
    if (vehicle.numbered) {
        cameras.warnings.push_back("the poses have numbers in place of times: lidars stand during their sweeps");
        return cameras;
    }
    SR_CHECK(course.check());
    for (size_t i = 0; i < cameras.frames.size(); ++i) {
        const Sensor& sensor = rig.sensors[i % rig.sensors.size()];
        if (sensor.shutter)
            cameras.frames[i].readout = readout_of(sensor, cameras.frames[i], course, i / rig.sensors.size());
    }
    for (size_t i = 0; i < cameras.sweeps.size(); ++i) {
        LidarSweep& sweep = cameras.sweeps[i];
        const Rigid vehicle_then = course.at(sweep.time - sweep.lidar->sweep_seconds());
        if (vehicle_then != course.pose(i / rig.lidars.size())) // to the bit, as if it stood
            sweep.begin = compose(vehicle_then, rig.lidars[i % rig.lidars.size()].sensor_to_vehicle);
    }
    return cameras;
}

} // namespace semrover
