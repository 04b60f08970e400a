// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// poses in the JSON of data sets of drives: PandaSet's poses.json, nuScenes' ego_pose.json
#include "runtime/base/quote.h"
#include "tools/trajectory/camera_path.h"
#include "tools/trajectory/json_tables.h"

#include <algorithm>
#include <set>

namespace semrover {

namespace {

constexpr size_t kMostPoses = 4u << 20;
constexpr double kSceneGap = 5; // seconds between two scenes; key frames of one are half a second apart

// right is x, down is -z, forward is y
const PathBody kPandasetLidar{"a lidar (x right, y forward, z up)", {1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1}};
// right is -y, down is -z, forward is x
const PathBody kVehicle{"a vehicle (x forward, y left, z up)", {0, 0, 1, 0, -1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 0, 1}};

Result<double> member(const Json& json, const char* object, const char* key, std::string_view where)
{
    const auto entry = json.find(object);
    if (entry == json.end() || !entry->is_object() || !entry->contains(key))
        return fail(ErrorCode::bad_input, "{}: expected {} with x, y and z, and of a heading w", where, object);
    return finite_number((*entry)[key], fmt::format("{}: {}.{}", where, object, key));
}

Result<Rigid> pandaset_pose(const Json& json, std::string_view where)
{
    if (!json.is_object())
        return fail(ErrorCode::bad_input, "{}: expected an object with position and heading", where);
    Point3 place{};
    Quaternion q{};
    const char* keys[] = {"x", "y", "z", "w"};
    for (size_t i = 0; i < 4; ++i) {
        if (i < 3) {
            SR_TRY(place[i], member(json, "position", keys[i], where));
        }
        SR_TRY(q[i], member(json, "heading", keys[i], where));
    }
    return rigid_from_quaternion(place, q, where);
}

Result<std::vector<double>> pandaset_times(const Path& path, size_t frames)
{
    SR_TRY(const Json json, read_json(path));
    SR_TRY(std::vector<double> times, numbers_of(json, quote_path(path)));
    if (times.size() != frames)
        return fail(ErrorCode::bad_input, "{}: expected a time for each of {} poses, found {}", quote_path(path),
                    frames, times.size());
    return times;
}

// fx, fy, cx, cy, which count from the centre of the first pixel; the pictures' size is the one given, or where none
// is, the data set's
Result<Intrinsics> pandaset_lens(const Path& path, const PathLens& lens)
{
    SR_TRY(const Json json, read_json(path));
    const std::string where = quote_path(path);
    if (!json.is_object())
        return fail(ErrorCode::bad_input, "{}: expected an object with fx, fy, cx and cy", where);
    Intrinsics k;
    k.width = lens.size_given ? lens.intrinsics.width : 1920;
    k.height = lens.size_given ? lens.intrinsics.height : 1080;
    for (const auto& [key, value] : {std::pair{"fx", &k.fx}, {"fy", &k.fy}, {"cx", &k.cx}, {"cy", &k.cy}}) {
        SR_TRY(const std::optional<double> found, optional_number(json, key, where));
        if (!found)
            return fail(ErrorCode::bad_input, "{}: {} is missing", where, key);
        *value = *found;
    }
    k.cx += 0.5;
    k.cy += 0.5;
    SR_CHECK(check_intrinsics(k, where));
    return k;
}

struct EgoPose {
    double time;
    Rigid pose;
};

// tokens of the poses at which the lidar on the roof has its key frames
Result<std::set<std::string>> key_poses(const Path& sample_data)
{
    std::set<std::string> tokens;
    const Status read = for_each_record(sample_data, [&](const Json& json, std::string_view where) -> Status {
        const auto key = json.find("is_key_frame");
        if (key == json.end() || *key != true)
            return {};
        SR_TRY(const std::string file, text_at(json, "filename", where));
        if (file.find("LIDAR_TOP") == std::string::npos)
            return {};
        SR_TRY(std::string token, text_at(json, "ego_pose_token", where));
        tokens.insert(std::move(token));
        return {};
    });
    SR_CHECK(read);
    return tokens;
}

Result<std::vector<EgoPose>> read_ego_poses(const Path& path, const std::optional<std::set<std::string>>& wanted)
{
    std::vector<EgoPose> poses;
    const Status read = for_each_record(path, [&](const Json& json, std::string_view where) -> Status {
        if (wanted) {
            SR_TRY(const std::string token, text_at(json, "token", where));
            if (!wanted->contains(token))
                return {};
        }
        SR_TRY(const std::optional<double> microseconds, optional_number(json, "timestamp", where));
        SR_TRY(const Point3 place, numbers_at<3>(json, "translation", where));
        SR_TRY(const auto q, numbers_at<4>(json, "rotation", where)); // w first
        SR_TRY(const Rigid pose, rigid_from_quaternion(place, {q[1], q[2], q[3], q[0]}, where));
        if (poses.size() == kMostPoses)
            return fail(ErrorCode::bad_input, "{}: expected at most {} poses, found more", where, kMostPoses);
        poses.push_back({microseconds.value_or(double(poses.size()) * 1e6) * 1e-6, pose});
        return {};
    });
    SR_CHECK(read);
    if (poses.empty())
        return fail(ErrorCode::bad_input, "{}: a trajectory without poses", quote_path(path));
    std::ranges::stable_sort(poses, {}, &EgoPose::time);
    return poses;
}

} // namespace

Result<CameraPath> read_pandaset(const Path& path, const PathLens& lens)
{
    const std::string name = quote_path(path);
    SR_TRY(const Json file, read_json(path));
    if (!file.is_array())
        return fail(ErrorCode::bad_input, "{}: expected an array of poses, found {}", name, file.type_name());
    const Path folder = path.parent_path();
    const bool calibrated = is_file(folder / "intrinsics.json"), lidar = folder.filename() == "lidar";
    CameraPath cameras;
    if (lidar)
        cameras.body = kPandasetLidar;
    else if (!calibrated)
        cameras.warnings.push_back(fmt::format(
            "{}: neither in a folder lidar/ nor beside an intrinsics.json: read as a camera's poses", name));
    Intrinsics k = lens.intrinsics;
    if (calibrated && lens.matters) {
        SR_TRY(k, pandaset_lens(folder / "intrinsics.json", lens));
    }
    for (size_t i = 0; i < file.size(); ++i) {
        SR_TRY(Rigid pose, pandaset_pose(file[i], fmt::format("{} frame {}", name, i)));
        if (lidar)
            pose = compose(pose, kPandasetLidar.forward_camera_to_body);
        cameras.frames.push_back({double(i), "", {inverse(pose)}, k});
    }
    if (cameras.frames.empty())
        return fail(ErrorCode::bad_input, "{}: a trajectory without poses", name);
    if (is_file(folder / "timestamps.json")) {
        SR_TRY(const std::vector<double> times, pandaset_times(folder / "timestamps.json", cameras.frames.size()));
        for (size_t i = 0; i < times.size(); ++i)
            cameras.frames[i].time = times[i];
    }
    return cameras;
}

Result<CameraPath> read_nuscenes_poses(const Path& path, const Intrinsics& lens)
{
    std::optional<std::set<std::string>> wanted;
    if (const Path table = path.parent_path() / "sample_data.json"; is_file(table)) {
        SR_TRY(wanted, key_poses(table));
    }
    SR_TRY(const std::vector<EgoPose> poses, read_ego_poses(path, wanted));
    CameraPath cameras;
    cameras.body = kVehicle;
    std::string scenes = "0";
    for (const EgoPose& p : poses) {
        const size_t at = cameras.frames.size();
        if (at > 0 && p.time - cameras.frames.back().time > kSceneGap && scenes.size() < 60)
            scenes += fmt::format(", {}", at);
        cameras.frames.push_back({p.time, "", {inverse(compose(p.pose, kVehicle.forward_camera_to_body))}, lens});
    }
    if (scenes.size() > 1)
        cameras.warnings.push_back(fmt::format(
            "{}: {} poses of several scenes; after gaps of more than {:g} seconds they begin anew at frames {}",
            quote_path(path), poses.size(), kSceneGap, scenes));
    return cameras;
}

} // namespace semrover
