// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/json_numbers.h"
#include "runtime/base/quote.h"
#include "tools/trajectory/camera_path.h"

#include <algorithm>
#include <numbers>

namespace semrover {

namespace {

constexpr double kDegree = std::numbers::pi / 180;

Result<CameraModel> read_type(const Json& file, std::string_view where)
{
    const auto type = file.find("camera_type");
    if (type == file.end() || *type == "perspective")
        return CameraModel::pinhole;
    if (*type == "fisheye")
        return CameraModel::fisheye;
    if (*type == "equirectangular")
        return CameraModel::equirectangular;
    return fail(ErrorCode::bad_input, "{}: camera_type: expected perspective, fisheye or equirectangular, found {}",
                where, quote(type->dump(-1, ' ', true), 60));
}

Result<uint32_t> read_side(const Json& file, const char* key, std::string_view where)
{
    SR_TRY(const std::optional<double> value, optional_number(file, key, where));
    if (!value)
        return fail(ErrorCode::bad_input, "{}: {} is missing", where, key);
    return image_side(*value, fmt::format("{}: {}", where, key));
}

// nerfstudio takes the focal length of a fisheye from the tangent too
Result<Intrinsics> read_intrinsics(const Json& json, const Intrinsics& size, std::string_view where)
{
    if (size.model == CameraModel::equirectangular)
        return whole_sphere(size.width, size.height);
    SR_TRY(const std::optional<double> fov, optional_number(json, "fov", where));
    if (!fov)
        return fail(ErrorCode::bad_input, "{}: fov is missing", where);
    if (!(*fov > 0 && *fov < 180))
        return fail(ErrorCode::bad_input, "{}: expected a fov above 0 and below 180 degrees, found {}", where, *fov);
    Intrinsics k = size;
    k.fx = k.fy = k.height / 2.0 / std::tan(*fov / 2 * kDegree);
    k.cx = k.width / 2.0;
    k.cy = k.height / 2.0;
    SR_CHECK(check_intrinsics(k, where));
    return k;
}

Result<CameraFrame> read_frame(const Json& json, const Intrinsics& size, std::string_view where)
{
    if (!json.is_object() || !json.contains("camera_to_world"))
        return fail(ErrorCode::bad_input, "{}: expected an object with a camera_to_world", where);
    const std::string what = fmt::format("{}: camera_to_world", where);
    SR_TRY(const std::vector<double> values, numbers_of(json["camera_to_world"], what));
    SR_TRY(const Rigid camera_to_world, rigid_from_matrix(values, what));
    CameraFrame frame;
    frame.pose.world_to_camera = inverse(compose(camera_to_world, kFlipYZ));
    SR_TRY(frame.intrinsics, read_intrinsics(json, size, where));
    return frame;
}

// render_time where every frame has one, as nerfstudio does; else frames a second apart, or as fps says
Status read_times(const Json& file, const Json& frames, CameraPath& cameras, std::string_view name)
{
    SR_TRY(const std::optional<double> fps, optional_number(file, "fps", name));
    if (fps && !(*fps > 0))
        return fail(ErrorCode::bad_input, "{}: expected fps above 0, found {}", name, *fps);
    const bool timed = std::ranges::all_of(frames, [](const Json& f) { return f.contains("render_time"); });
    for (size_t i = 0; i < frames.size(); ++i) {
        cameras.frames[i].time = double(i) / fps.value_or(1);
        if (timed) {
            SR_TRY(const std::optional<double> time,
                   optional_number(frames[i], "render_time", fmt::format("{} frame {}", name, i)));
            cameras.frames[i].time = *time;
        }
    }
    return {};
}

// what the file has no place for
Status check_writable(const CameraPath& cameras, std::string_view where)
{
    const Intrinsics& first = cameras.frames[0].intrinsics;
    for (size_t i = 0; i < cameras.frames.size(); ++i) {
        const Intrinsics& k = cameras.frames[i].intrinsics;
        const std::string frame = fmt::format("{}: frame {}", where, i);
        if (k.model != first.model || k.width != first.width || k.height != first.height)
            return fail(ErrorCode::bad_input,
                        "{} has another camera model or size than the first, and a "
                        "camera_path.json has one",
                        frame);
        if (k.model == CameraModel::equirectangular)
            continue;
        if (k.model == CameraModel::opencv || k.distortion != Distortion{})
            return fail(ErrorCode::bad_input, "{} has lens distortion, and a camera_path.json has none", frame);
        if (std::abs(k.fx - k.fy) > 1e-6 * k.fx || std::abs(k.cx - k.width / 2.0) > 1e-6 * k.width ||
            std::abs(k.cy - k.height / 2.0) > 1e-6 * k.height)
            return fail(ErrorCode::bad_input,
                        "{} has focal lengths {:.6g} and {:.6g} and its centre at ({:.6g}, {:.6g}); a camera_path.json "
                        "has a field of view, with square pixels and the centre in the middle",
                        frame, k.fx, k.fy, k.cx, k.cy);
    }
    return {};
}

} // namespace

Result<CameraPath> parse_camera_path_json(const Json& file, std::string_view name)
{
    const auto frames = file.is_object() ? file.find("camera_path") : file.end();
    if (!file.is_object() || frames == file.end() || !frames->is_array())
        return fail(ErrorCode::bad_input, "{}: expected an object with an array camera_path", name);
    if (frames->empty())
        return fail(ErrorCode::bad_input, "{}: a trajectory without poses, camera_path is empty", name);
    Intrinsics size;
    SR_TRY(size.model, read_type(file, name));
    SR_TRY(size.width, read_side(file, "render_width", name));
    SR_TRY(size.height, read_side(file, "render_height", name));
    CameraPath cameras;
    for (size_t i = 0; i < frames->size(); ++i) {
        SR_TRY(CameraFrame frame, read_frame((*frames)[i], size, fmt::format("{} frame {}", name, i)));
        cameras.frames.push_back(std::move(frame));
    }
    SR_CHECK(read_times(file, *frames, cameras, name));
    return cameras;
}

Result<CameraPath> read_camera_path_json(const Path& path)
{
    SR_TRY(const Json file, read_json(path));
    return parse_camera_path_json(file, quote_path(path));
}

Status write_camera_path_json(const Path& path, const CameraPath& cameras)
{
    SR_ASSERT(!cameras.frames.empty(), "a trajectory without frames");
    SR_CHECK(check_writable(cameras, quote_path(path)));
    const Intrinsics& first = cameras.frames[0].intrinsics;
    const size_t count = cameras.frames.size();
    const double span = cameras.frames.back().time - cameras.frames[0].time;
    const double fps = count > 1 && span > 0 ? double(count - 1) / span : 1;
    nlohmann::ordered_json file;
    file["camera_type"] = first.model == CameraModel::pinhole ? "perspective" : name_of(first.model);
    file["render_width"] = first.width;
    file["render_height"] = first.height;
    file["fps"] = fps;
    file["seconds"] = double(count) / fps;
    file["is_cycle"] = false;
    file["smoothness_value"] = 0;
    file["keyframes"] = nlohmann::ordered_json::array();
    for (const CameraFrame& frame : cameras.frames) {
        SR_ASSERT(frame.camera == cameras.frames[0].camera, "a camera_path.json of cameras {} and {}",
                  cameras.frames[0].camera, frame.camera);
        nlohmann::ordered_json entry;
        entry["camera_to_world"] = compose(frame.pose.camera_to_world(), kFlipYZ);
        const Intrinsics& k = frame.intrinsics;
        entry["fov"] = k.model == CameraModel::equirectangular ? 90.0 : 2 * std::atan(k.height / 2.0 / k.fy) / kDegree;
        entry["aspect"] = double(k.width) / k.height;
        entry["render_time"] = frame.time;
        file["camera_path"].push_back(std::move(entry));
    }
    return write_file_atomically(path, json_text(file, 1) + "\n");
}

} // namespace semrover
