// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/camera_path.h"
#include "runtime/base/json_numbers.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <map>

namespace semrover {

namespace {

// a frame's own value of a key, else the file's
class Settings {
  public:
    Settings(const Json& file, const Json& frame, std::string_view where) : file_(file), frame_(frame), where_(where) {}

    Result<std::optional<double>> number(const char* key) const
    {
        return optional_number(frame_.contains(key) ? frame_ : file_, key, where_);
    }

    std::string_view where() const { return where_; }
    const Json* find(const char* key) const
    {
        const Json& owner = frame_.contains(key) ? frame_ : file_;
        const auto entry = owner.find(key);
        return entry == owner.end() ? nullptr : &*entry;
    }

  private:
    const Json& file_;
    const Json& frame_;
    std::string_view where_;
};

struct TransformsModel {
    const char* name;
    CameraModel model;
    std::vector<const char*> coefficients; // in the order of Intrinsics::distortion; nullptr: none
};

// nerfstudio's names; its OPENCV has a k4 of r^8, which no OpenCV lens has. FULL_OPENCV is COLMAP's name.
const TransformsModel kTransformsModels[] = {
    {"OPENCV", CameraModel::opencv, {"k1", "k2", "p1", "p2", "k3"}},
    {"PINHOLE", CameraModel::pinhole, {}},
    {"SIMPLE_PINHOLE", CameraModel::pinhole, {}},
    {"SIMPLE_RADIAL", CameraModel::opencv, {"k1"}},
    {"RADIAL", CameraModel::opencv, {"k1", "k2"}},
    {"FULL_OPENCV", CameraModel::opencv, {"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"}},
    {"OPENCV_FISHEYE", CameraModel::fisheye, {"k1", "k2", "k3", "k4"}},
    {"EQUIRECTANGULAR", CameraModel::equirectangular, {}},
};

Result<const TransformsModel*> read_model(const Settings& settings)
{
    const Json* model = settings.find("camera_model");
    if (!model)
        return &kTransformsModels[0];
    const std::string name = model->is_string() ? model->get<std::string>() : model->dump(-1, ' ', true);
    const auto found = std::ranges::find(kTransformsModels, name, &TransformsModel::name);
    if (found != std::end(kTransformsModels))
        return found;
    std::vector<const char*> names;
    for (const TransformsModel& m : kTransformsModels)
        names.push_back(m.name);
    return fail(ErrorCode::bad_input, "{}: camera_model {} is not supported, expected one of {}", settings.where(),
                quote(name, 60), fmt::join(names, ", "));
}

Status read_lens(const Settings& settings, const TransformsModel& model, Intrinsics& k)
{
    k.model = model.model;
    for (const char* key : {"k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2"}) {
        SR_TRY(const std::optional<double> value, settings.number(key));
        const auto at = std::ranges::find(model.coefficients, std::string_view(key));
        if (at != model.coefficients.end())
            k.distortion[size_t(at - model.coefficients.begin())] = value.value_or(0);
        else if (value.value_or(0) != 0)
            return fail(ErrorCode::bad_input, "{}: lens distortion {} = {} is not one of camera_model {}",
                        settings.where(), key, *value, model.name);
    }
    return {};
}

Result<Intrinsics> read_size(const Settings& settings, const std::optional<Intrinsics>& fallback)
{
    Intrinsics k;
    SR_TRY(const std::optional<double> w, settings.number("w"));
    SR_TRY(const std::optional<double> h, settings.number("h"));
    if (w && h) {
        SR_TRY(k.width, image_side(*w, fmt::format("{}: w", settings.where())));
        SR_TRY(k.height, image_side(*h, fmt::format("{}: h", settings.where())));
    } else if (fallback) {
        k.width = fallback->width;
        k.height = fallback->height;
    } else {
        return fail(ErrorCode::bad_input, "{}: no image size (w, h); give one with -W and -H", settings.where());
    }
    return k;
}

// nerfstudio's focal lengths of a panorama are w / 2 and h, and its centre is the picture's
Result<Intrinsics> read_panorama(const Settings& settings, const Intrinsics& size)
{
    const std::pair<const char*, double> whole[] = {
        {"fl_x", size.width / 2.0}, {"fl_y", double(size.height)}, {"cx", size.width / 2.0}, {"cy", size.height / 2.0}};
    for (const auto& [key, expected] : whole) {
        SR_TRY(const std::optional<double> value, settings.number(key));
        if (value && std::abs(*value - expected) > 1e-6 * expected)
            return fail(ErrorCode::bad_input, "{}: {}: expected {} of a panorama of the whole sphere, found {}",
                        settings.where(), key, expected, *value);
    }
    return whole_sphere(size.width, size.height);
}

Result<Intrinsics> read_intrinsics(const Settings& settings, const std::optional<Intrinsics>& fallback)
{
    SR_TRY(Intrinsics k, read_size(settings, fallback));
    SR_TRY(const TransformsModel* model, read_model(settings));
    SR_CHECK(read_lens(settings, *model, k));
    if (k.model == CameraModel::equirectangular)
        return read_panorama(settings, k);
    SR_TRY(const std::optional<double> fl_x, settings.number("fl_x"));
    SR_TRY(const std::optional<double> fl_y, settings.number("fl_y"));
    SR_TRY(const std::optional<double> angle_x, settings.number("camera_angle_x"));
    SR_TRY(const std::optional<double> cx, settings.number("cx"));
    SR_TRY(const std::optional<double> cy, settings.number("cy"));
    if (!fl_x && !angle_x && fallback && fallback->model != CameraModel::pinhole && !settings.find("camera_model"))
        return scaled_to(*fallback, k.width, k.height); // a file of poses
    if (fl_x)
        k.fx = *fl_x;
    else if (angle_x) // radians across the width
        k.fx = k.model == CameraModel::fisheye ? k.width / *angle_x : k.width / 2.0 / std::tan(*angle_x / 2);
    else if (fallback)
        k.fx = scaled_to(*fallback, k.width, k.height).fx;
    else
        return fail(ErrorCode::bad_input, "{}: no focal length, expected fl_x or camera_angle_x", settings.where());
    k.fy = fl_y.value_or(k.fx);
    k.cx = cx.value_or(k.width / 2.0);
    k.cy = cy.value_or(k.height / 2.0);
    SR_CHECK(check_intrinsics(k, settings.where()));
    return simplified(k);
}

Result<CameraFrame> read_frame(const Json& file, const Json& json, size_t index, std::string_view where,
                               const std::optional<Intrinsics>& fallback)
{
    if (!json.is_object() || !json.contains("transform_matrix"))
        return fail(ErrorCode::bad_input, "{}: expected an object with a transform_matrix", where);
    CameraFrame frame;
    const std::string what = fmt::format("{}: transform_matrix", where);
    SR_TRY(const std::vector<double> values, numbers_of(json["transform_matrix"], what));
    SR_TRY(const Rigid camera_to_world, rigid_from_matrix(values, what));
    frame.pose.world_to_camera = inverse(compose(camera_to_world, kFlipYZ));
    SR_TRY(frame.intrinsics, read_intrinsics(Settings(file, json, where), fallback));
    SR_TRY(const std::optional<double> time, optional_number(json, "time", where));
    frame.time = time.value_or(static_cast<double>(index));
    if (const auto camera = json.find("camera"); camera != json.end()) {
        if (!camera->is_string() || !is_camera_name(camera->get_ref<const std::string&>()))
            return fail(ErrorCode::bad_input,
                        "{}: camera: expected a name of letters, digits, '.', '_' and '-', found {}", where,
                        quote(camera->dump(-1, ' ', true), 80));
        frame.camera = camera->get<std::string>();
    }
    return frame;
}

const TransformsModel& transforms_model_of(const Intrinsics& k)
{
    switch (k.model) {
    case CameraModel::opencv:
        return k.distortion[5] != 0 || k.distortion[6] != 0 || k.distortion[7] != 0 ? kTransformsModels[5]
                                                                                    : kTransformsModels[0];
    case CameraModel::fisheye:
        return kTransformsModels[6];
    case CameraModel::equirectangular:
        return kTransformsModels[7];
    case CameraModel::pinhole:
        break;
    }
    return kTransformsModels[0]; // without distortion
}

// with all coefficients, so that a frame's hide the file's
void put_intrinsics(nlohmann::ordered_json& object, const Intrinsics& k, bool with_lens)
{
    const bool panorama = k.model == CameraModel::equirectangular;
    object["w"] = k.width;
    object["h"] = k.height;
    object["fl_x"] = panorama ? k.width / 2.0 : k.fx;
    object["fl_y"] = panorama ? double(k.height) : k.fy;
    object["cx"] = k.cx;
    object["cy"] = k.cy;
    if (!with_lens)
        return;
    const TransformsModel& model = transforms_model_of(k);
    object["camera_model"] = model.name;
    for (const char* key : {"k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2"}) {
        const auto at = std::ranges::find(model.coefficients, std::string_view(key));
        object[key] = at == model.coefficients.end() ? 0.0 : k.distortion[size_t(at - model.coefficients.begin())];
    }
}

} // namespace

Result<CameraPath> read_transforms(const Path& path, const std::optional<Intrinsics>& fallback)
{
    SR_TRY(const Json file, read_json(path));
    return parse_transforms(file, quote_path(path), fallback);
}

Result<CameraPath> parse_transforms(const Json& file, std::string_view name, const std::optional<Intrinsics>& fallback)
{
    const auto frames = file.is_object() ? file.find("frames") : file.end();
    if (!file.is_object() || frames == file.end() || !frames->is_array())
        return fail(ErrorCode::bad_input, "{}: expected an object with an array of frames", name);
    if (frames->empty())
        return fail(ErrorCode::bad_input, "{}: a camera path without poses, frames is empty", name);
    CameraPath cameras;
    for (size_t i = 0; i < frames->size(); ++i) {
        SR_TRY(CameraFrame frame, read_frame(file, (*frames)[i], i, fmt::format("{} frame {}", name, i), fallback));
        cameras.frames.push_back(std::move(frame));
    }
    return cameras;
}

Status write_transforms(const Path& path, const CameraPath& cameras)
{
    SR_ASSERT(!cameras.frames.empty(), "a camera path without frames");
    nlohmann::ordered_json file;
    const Intrinsics& shared = cameras.frames[0].intrinsics;
    const bool lenses = std::ranges::any_of(
        cameras.frames, [](const CameraFrame& f) { return f.intrinsics.model != CameraModel::pinhole; });
    if (!lenses)
        file["camera_model"] = "OPENCV";
    put_intrinsics(file, shared, lenses);
    file["frames"] = nlohmann::ordered_json::array();
    std::map<std::string, size_t> counts;
    for (const CameraFrame& frame : cameras.frames) {
        nlohmann::ordered_json entry;
        entry["file_path"] =
            fmt::format("{}{}color/{:06}.png", frame.camera, frame.camera.empty() ? "" : "/", counts[frame.camera]++);
        if (!frame.camera.empty())
            entry["camera"] = frame.camera;
        entry["time"] = frame.time;
        if (frame.intrinsics != shared)
            put_intrinsics(entry, frame.intrinsics, lenses);
        const Rigid m = compose(frame.pose.camera_to_world(), kFlipYZ);
        for (size_t row = 0; row < 4; ++row)
            entry["transform_matrix"].push_back({m[row * 4], m[row * 4 + 1], m[row * 4 + 2], m[row * 4 + 3]});
        file["frames"].push_back(std::move(entry));
    }
    return write_file_atomically(path, file.dump(1) + "\n");
}

} // namespace semrover
