// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/transforms.h"

#include "engine/camera/ftheta_json.h"
#include "engine/format/image.h"
#include "runtime/base/json_numbers.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <map>
#include <numbers>

namespace semrover {

namespace {

constexpr const char* kDepthUnit = "depth_unit_scale_factor";

// a frame's own value of a key, else the file's
class Settings {
  public:
    Settings(const Json& file, const Json& frame, std::string_view where) : file_(file), frame_(frame), where_(where) {}

    Result<std::optional<double>> number(const char* key) const
    {
        return optional_number(frame_.contains(key) ? frame_ : file_, key, where_);
    }
    // true, or a number other than 0
    Result<bool> flag(const char* key) const
    {
        const Json* value = find(key);
        if (value && !value->is_boolean() && !value->is_number())
            return fail(ErrorCode::bad_input, "{}: {}: expected true or false, found {}", where_, key,
                        value->type_name());
        return value && (value->is_boolean() ? value->get<bool>() : value->get<double>() != 0);
    }

    std::string_view where() const { return where_; }
    const Json* find(const char* key) const
    {
        const Json& owner = frame_.contains(key) ? frame_ : file_;
        const auto entry = owner.find(key);
        return entry == owner.end() ? nullptr : &*entry;
    }
    const Json& frame() const { return frame_; }
    const Json& file() const { return file_; }

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
    {"SIMPLE_RADIAL_FISHEYE", CameraModel::fisheye, {"k1"}},
    {"RADIAL_FISHEYE", CameraModel::fisheye, {"k1", "k2"}},
    {"FISHEYE", CameraModel::fisheye, {}},
    {"SIMPLE_FISHEYE", CameraModel::fisheye, {}},
    // ours, for lenses that nerfstudio has no name for
    {"OPENCV_THIN_PRISM",
     CameraModel::opencv,
     {"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4"}},
    {"FTHETA", CameraModel::ftheta, {}},
};
constexpr size_t kFullOpencv = 5, kOpencvFisheye = 6, kEquirectangular = 7, kThinPrism = 12, kFtheta = 13;

// what other programs write of lenses and cameras that are not read here
constexpr const char* kForeignKeys[] = {
    "ftheta_p0",  "latlong",          "equirectangular", "from_mitsuba",      "K",
    "intrinsics", "intrinsic_matrix", "camera_matrix",   "camera_intrinsics", "distortion_params",
    "distortion", "shift_x",          "shift_y"};

// false, null, 0 and zeros say that there is none
bool says_nothing(const Json& value)
{
    if (value.is_array())
        return std::ranges::all_of(value, says_nothing);
    return value.is_null() || value == false || value == 0;
}

Status refuse_foreign_keys(const Settings& settings)
{
    for (const char* key : kForeignKeys)
        if (const Json* value = settings.find(key); value && !says_nothing(*value))
            return fail(ErrorCode::bad_input,
                        "{}: {} is not supported; expected fl_x, fl_y, cx, cy, camera_model, k1 and so on, and a "
                        "transform_matrix",
                        settings.where(), key);
    return {};
}

Result<const TransformsModel*> read_model(const Settings& settings)
{
    SR_TRY(const bool fisheye, settings.flag("is_fisheye")); // instant-ngp's, which writes no camera_model
    const Json* model = settings.find("camera_model");
    if (!model)
        return &kTransformsModels[fisheye ? kOpencvFisheye : 0];
    const std::string name = model->is_string() ? model->get<std::string>() : model->dump(-1, ' ', true);
    const auto found = std::ranges::find(kTransformsModels, name, &TransformsModel::name);
    if (found != std::end(kTransformsModels) && fisheye && found->model != CameraModel::fisheye)
        return fail(ErrorCode::bad_input, "{}: is_fisheye, and camera_model {}, which is none", settings.where(),
                    found->name);
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
    for (const char* key : {"k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2", "s1", "s2", "s3", "s4"}) {
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

// where a frame's size comes from
struct TransformsSource {
    const std::optional<PathLens>& lens;
    const Path& folder;                              // of the pictures; empty: not to be looked at
    std::map<Path, ImageSize> sizes{};               // of pictures that were looked at
    bool default_size = false, default_view = false; // taken somewhere
};

// Blender's exporters leave the extension out
std::optional<Path> picture_of(const Json& frame, const Path& folder)
{
    const auto name = frame.find("file_path");
    if (folder.empty() || name == frame.end() || !name->is_string() ||
        name->get_ref<const std::string&>().find('\0') != std::string::npos)
        return std::nullopt;
    for (const char* extension : {"", ".png", ".jpg", ".jpeg"})
        if (Path path = folder / (name->get<std::string>() + extension); is_file(path))
            return path;
    return std::nullopt;
}

Result<std::optional<ImageSize>> picture_size(const Json& frame, TransformsSource& source)
{
    const std::optional<Path> path = picture_of(frame, source.folder);
    if (!path)
        return std::optional<ImageSize>();
    const auto [at, added] = source.sizes.try_emplace(*path);
    if (added) {
        SR_TRY(at->second, read_image_size(*path));
    }
    return std::optional(at->second);
}

Result<Intrinsics> read_size(const Settings& settings, TransformsSource& source)
{
    Intrinsics k;
    SR_TRY(const std::optional<double> w, settings.number("w"));
    SR_TRY(const std::optional<double> h, settings.number("h"));
    if (w.has_value() != h.has_value())
        return fail(ErrorCode::bad_input, "{}: {} is missing beside {}", settings.where(), w ? "h" : "w",
                    w ? "w" : "h");
    if (w) {
        SR_TRY(k.width, image_side(*w, fmt::format("{}: w", settings.where())));
        SR_TRY(k.height, image_side(*h, fmt::format("{}: h", settings.where())));
        return k;
    }
    const std::optional<PathLens>& lens = source.lens;
    std::optional<ImageSize> size;
    if (lens && (lens->size_given || !lens->matters)) {
        size = ImageSize{lens->intrinsics.width, lens->intrinsics.height};
    } else {
        SR_TRY(size, picture_size(settings.frame(), source));
    }
    const auto in_pixels = [&](const char* key) { return settings.find(key) != nullptr; };
    if (!size && lens && !in_pixels("fl_x") && !in_pixels("fl_y") && !in_pixels("cx") && !in_pixels("cy")) {
        size = ImageSize{lens->intrinsics.width, lens->intrinsics.height};
        source.default_size = true;
    }
    if (!size)
        return fail(ErrorCode::bad_input,
                    "{}: no image size (w, h), and no picture to take it from; give it with `width` "
                    "and `height`",
                    settings.where());
    k.width = size->width;
    k.height = size->height;
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

// Pixels; none where neither says it. note: a field of view gives the focal length as of a pinhole, of a fisheye, too:
// so do nerfstudio and instant-ngp, whose x_fov is in degrees.
Result<std::optional<double>> focal_length(const Json& owner, char axis, uint32_t side, std::string_view where)
{
    SR_TRY(const std::optional<double> pixels, optional_number(owner, fmt::format("fl_{}", axis).c_str(), where));
    SR_TRY(const std::optional<double> degrees, optional_number(owner, fmt::format("{}_fov", axis).c_str(), where));
    SR_TRY(std::optional<double> angle, optional_number(owner, fmt::format("camera_angle_{}", axis).c_str(), where));
    if (pixels)
        return pixels;
    if (degrees)
        angle = *degrees * std::numbers::pi / 180;
    if (!angle)
        return std::optional<double>();
    if (!(*angle > 0 && *angle < std::numbers::pi))
        return fail(ErrorCode::bad_input, "{}: a field of view of {:.4g} radians along {}, expected less than pi",
                    where, *angle, axis);
    return std::optional(side / 2.0 / std::tan(*angle / 2));
}

// of the frame or, where it says neither, of the file
Result<std::array<std::optional<double>, 2>> focal_lengths(const Settings& settings, const Intrinsics& size)
{
    std::array<std::optional<double>, 2> f;
    for (const Json* owner : {&settings.frame(), &settings.file()}) {
        SR_TRY(f[0], focal_length(*owner, 'x', size.width, settings.where()));
        SR_TRY(f[1], focal_length(*owner, 'y', size.height, settings.where()));
        if (f[0] || f[1])
            break;
    }
    return f;
}

Result<Intrinsics> read_intrinsics(const Settings& settings, TransformsSource& source)
{
    SR_TRY(Intrinsics k, read_size(settings, source));
    SR_TRY(const TransformsModel* model, read_model(settings));
    SR_CHECK(read_lens(settings, *model, k));
    if (k.model == CameraModel::equirectangular)
        return read_panorama(settings, k);
    if (k.model == CameraModel::ftheta) {
        SR_CHECK(read_ftheta(settings.frame().contains("reference_poly") ? settings.frame() : settings.file(), k,
                             settings.where()));
        SR_CHECK(check_intrinsics(k, settings.where()));
        return k;
    }
    SR_TRY(const auto f, focal_lengths(settings, k));
    SR_TRY(const std::optional<double> cx, settings.number("cx"));
    SR_TRY(const std::optional<double> cy, settings.number("cy"));
    const auto& lens = source.lens;
    if (!f[0] && !f[1] && !lens)
        return fail(ErrorCode::bad_input, "{}: no focal length, expected fl_x or camera_angle_x", settings.where());
    if (!f[0] && !f[1])
        source.default_view = source.default_view || !lens->view_given;
    if (!f[0] && !f[1] && lens->intrinsics.model != CameraModel::pinhole && !settings.find("camera_model"))
        return scaled_to(lens->intrinsics, k.width, k.height); // a file of poses
    k.fx = f[0] ? *f[0] : f[1] ? *f[1] : scaled_to(lens->intrinsics, k.width, k.height).fx;
    k.fy = f[1].value_or(k.fx);
    k.cx = cx.value_or(k.width / 2.0);
    k.cy = cy.value_or(k.height / 2.0);
    SR_CHECK(check_intrinsics(k, settings.where()));
    return simplified(k);
}

Result<Pose> read_pose(const Json& json, const char* key, std::string_view where)
{
    const std::string what = fmt::format("{}: {}", where, key);
    SR_TRY(const std::vector<double> values, numbers_of(json[key], what));
    SR_TRY(const Rigid camera_to_world, rigid_from_matrix(values, what));
    return Pose{inverse(compose(camera_to_world, kFlipYZ))};
}

// instant-ngp's: the share of the readout of a position (u, v) of the picture, 0 to 1 each way, is a + b u + c v. Its
// fourth number, of motion blur, has to be 0
constexpr std::array<double, 4> kRollingShutters[] = {{0, 0, 1, 0}, {1, 0, -1, 0}, {0, 1, 0, 0}, {1, -1, 0, 0}};

Result<std::optional<Readout>> read_readout(const Settings& settings)
{
    const Json* shutter = settings.find("rolling_shutter");
    const Json& frame = settings.frame();
    const bool poses = frame.contains("transform_matrix_start") && frame.contains("transform_matrix_end");
    if (!poses && (frame.contains("transform_matrix_start") || frame.contains("transform_matrix_end")))
        return fail(ErrorCode::bad_input, "{}: transform_matrix_start and transform_matrix_end need each other",
                    settings.where());
    if ((!shutter || says_nothing(*shutter)) && !poses)
        return std::optional<Readout>();
    const std::string what = fmt::format("{}: rolling_shutter", settings.where());
    if (!shutter || !poses)
        return fail(ErrorCode::bad_input,
                    "{}: a rolling shutter is three keys: rolling_shutter, "
                    "transform_matrix_start and transform_matrix_end",
                    settings.where());
    SR_TRY(const std::vector<double> numbers, numbers_of(*shutter, what));
    const auto found =
        std::ranges::find_if(kRollingShutters, [&](const auto& known) { return std::ranges::equal(known, numbers); });
    if (found == std::end(kRollingShutters))
        return fail(ErrorCode::bad_input,
                    "{}: [{}] is not supported, expected [0, 0, 1, 0] of rows from the top, [1, 0, -1, 0] from the "
                    "bottom, [0, 1, 0, 0] of columns from the left or [1, -1, 0, 0] from the right",
                    what, fmt::join(numbers, ", "));
    Readout readout{.direction = ShutterDirection(found - std::begin(kRollingShutters))};
    SR_TRY(readout.from, read_pose(frame, "transform_matrix_start", settings.where()));
    SR_TRY(readout.to, read_pose(frame, "transform_matrix_end", settings.where()));
    return std::optional(readout);
}

Result<CameraFrame> read_frame(const Json& file, const Json& json, size_t index, std::string_view where,
                               TransformsSource& source)
{
    if (json.is_object())
        SR_CHECK(refuse_foreign_keys(Settings(file, json, where)));
    if (!json.is_object() || !json.contains("transform_matrix"))
        return fail(ErrorCode::bad_input, "{}: expected an object with a transform_matrix", where);
    CameraFrame frame;
    SR_TRY(frame.pose, read_pose(json, "transform_matrix", where));
    SR_TRY(frame.readout, read_readout(Settings(file, json, where)));
    SR_TRY(frame.intrinsics, read_intrinsics(Settings(file, json, where), source));
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

// nerfstudio moves the world, and scales it: poses and what else is in the folder stay together, a grid that was made
// before does not
bool is_identity(const Json& matrix)
{
    const auto values = numbers_of(matrix, "");
    for (size_t i = 0; values && i < values->size(); ++i)
        if ((*values)[i] != kIdentity[i % 16])
            return false;
    return values.has_value();
}

std::vector<std::string> transforms_warnings(const Json& file, std::string_view name, const TransformsSource& source)
{
    std::vector<std::string> warnings;
    if (const auto m = file.find("applied_transform"); m != file.end() && !is_identity(*m))
        warnings.push_back(fmt::format("{}: its poses are in the world that its applied_transform made; for a grid of "
                                       "the world before, `world` takes the inverse",
                                       name));
    if (const auto scale = file.find("applied_scale"); scale != file.end() && *scale != 1)
        warnings.push_back(fmt::format("{}: its applied_scale is {}: positions are read as metres, and may be others",
                                       name, printable(scale->dump(-1, ' ', true), 40)));
    if (source.default_size)
        warnings.push_back(
            fmt::format("{}: no image size (w, h) and no picture to take it from; the default of {} x {} "
                        "is taken (`width`, `height`)",
                        name, source.lens->intrinsics.width, source.lens->intrinsics.height));
    if (source.default_view && source.lens->matters)
        warnings.push_back(default_view_text(name, source.lens->intrinsics));
    return warnings;
}

const TransformsModel& transforms_model_of(const Intrinsics& k)
{
    switch (k.model) {
    case CameraModel::opencv:
        if (std::ranges::any_of(std::span(k.distortion).subspan(8), [](double v) { return v != 0; }))
            return kTransformsModels[kThinPrism];
        return kTransformsModels[k.distortion[5] != 0 || k.distortion[6] != 0 || k.distortion[7] != 0 ? kFullOpencv
                                                                                                      : 0];
    case CameraModel::fisheye:
        return kTransformsModels[kOpencvFisheye];
    case CameraModel::equirectangular:
        return kTransformsModels[kEquirectangular];
    case CameraModel::ftheta:
        return kTransformsModels[kFtheta];
    case CameraModel::pinhole:
        break;
    }
    return kTransformsModels[0]; // without distortion
}

// the model that all frames have; nullptr: they differ
const TransformsModel* shared_model(const std::vector<CameraFrame>& frames)
{
    const TransformsModel* shared = nullptr;
    for (const CameraFrame& f : frames) {
        const TransformsModel* model = &transforms_model_of(f.intrinsics);
        const bool plane = model->model == CameraModel::opencv;
        if (shared && shared->model != model->model)
            return nullptr;
        if (!shared || (plane && model->coefficients.size() > shared->coefficients.size()))
            shared = model; // the longer one of OpenCV's holds what the shorter one does
    }
    return shared;
}

void put_intrinsics(nlohmann::ordered_json& object, const Intrinsics& k, const TransformsModel& model)
{
    const bool panorama = k.model == CameraModel::equirectangular;
    object["w"] = k.width;
    object["h"] = k.height;
    if (k.model == CameraModel::ftheta) {
        put_ftheta(object, k);
        return;
    }
    object["fl_x"] = panorama ? k.width / 2.0 : k.fx;
    object["fl_y"] = panorama ? double(k.height) : k.fy;
    object["cx"] = k.cx;
    object["cy"] = k.cy;
    for (size_t i = 0; i < model.coefficients.size() && k.model != CameraModel::pinhole; ++i)
        object[model.coefficients[i]] = k.distortion[i];
}

void put_names(nlohmann::ordered_json& entry, const PictureNames& names)
{
    entry["file_path"] = names.color;
    if (!names.depth.empty())
        entry["depth_file_path"] = names.depth;
    if (!names.label.empty())
        entry["label_file_path"] = names.label;
}

void put_pose(nlohmann::ordered_json& entry, const CameraFrame& frame)
{
    if (!frame.camera.empty())
        entry["camera"] = frame.camera;
    entry["time"] = frame.time;
    const auto put = [&](const char* key, const Pose& pose) {
        const Rigid m = compose(pose.camera_to_world(), kFlipYZ);
        for (size_t row = 0; row < 4; ++row)
            entry[key].push_back({m[row * 4], m[row * 4 + 1], m[row * 4 + 2], m[row * 4 + 3]});
    };
    put("transform_matrix", frame.pose);
    if (!frame.readout)
        return;
    entry["rolling_shutter"] = kRollingShutters[size_t(frame.readout->direction)];
    put("transform_matrix_start", frame.readout->from);
    put("transform_matrix_end", frame.readout->to);
}

} // namespace

std::string default_view_text(std::string_view name, const Intrinsics& k)
{
    const double degrees = 2 * std::atan(k.width / 2.0 / k.fx) * 180 / std::numbers::pi;
    return fmt::format("{}: has no intrinsics; the default field of view of {:g} degrees is taken (`fov_x`)", name,
                       std::round(degrees * 100) / 100);
}

Result<CameraPath> read_transforms(const Path& path, const std::optional<PathLens>& lens)
{
    SR_TRY(const Json file, read_json(path));
    return parse_transforms(file, quote_path(path), lens, path.has_parent_path() ? path.parent_path() : Path("."));
}

Result<CameraPath> parse_transforms(const Json& file, std::string_view name, const std::optional<PathLens>& lens,
                                    const Path& folder)
{
    const auto frames = file.is_object() ? file.find("frames") : file.end();
    if (!file.is_object() || frames == file.end() || !frames->is_array())
        return fail(ErrorCode::bad_input, "{}: expected an object with an array of frames", name);
    if (frames->empty())
        return fail(ErrorCode::bad_input, "{}: a trajectory without poses, frames is empty", name);
    CameraPath cameras;
    TransformsSource source{lens, folder};
    for (size_t i = 0; i < frames->size(); ++i) {
        SR_TRY(CameraFrame frame, read_frame(file, (*frames)[i], i, fmt::format("{} frame {}", name, i), source));
        cameras.frames.push_back(std::move(frame));
    }
    cameras.warnings = transforms_warnings(file, name, source);
    return cameras;
}

std::string picture_name(const std::string& camera, std::string_view kind, uint32_t number, std::string_view extension)
{
    return fmt::format("{}{}{}/{:06}.{}", camera, camera.empty() ? "" : "/", kind, number, extension);
}

PictureNames rendered_pictures(const std::string& camera, uint32_t number, const PictureEncoding& encoding)
{
    return {picture_name(camera, "color", number, encoding.color_extension()),
            picture_name(camera, "depth", number, encoding.depth_extension()), picture_name(camera, "label", number)};
}

Result<double> read_depth_unit(const Path& folder)
{
    const Path path = folder / "transforms.json";
    const auto file = read_json(path);
    if (!file || !file->is_object()) // who needs its cameras says what is wrong
        return kMillimetre;
    SR_TRY(const std::optional<double> unit, optional_number(*file, kDepthUnit, quote_path(path)));
    if (unit && !(*unit > 0))
        return fail(ErrorCode::bad_input, "{}: {}: expected metres above 0, found {}", quote_path(path), kDepthUnit,
                    *unit);
    return unit.value_or(kMillimetre);
}

Status write_transforms(const Path& path, const CameraPath& cameras, const TransformsFiles& files)
{
    SR_ASSERT(!cameras.frames.empty(), "a trajectory without frames");
    const auto& frames = cameras.frames;
    const bool one_view =
        std::ranges::all_of(frames, [&](const CameraFrame& f) { return f.intrinsics == frames[0].intrinsics; });
    const TransformsModel* model = shared_model(frames);
    nlohmann::ordered_json file, list = nlohmann::ordered_json::array();
    if (model)
        file["camera_model"] = model->name;
    if (one_view)
        put_intrinsics(file, frames[0].intrinsics, *model);
    std::map<std::string, uint32_t> counts;
    bool depths = false;
    for (const CameraFrame& frame : frames) {
        const uint32_t number = counts[frame.camera]++;
        const PictureNames names = files.pictures ? files.pictures(frame.camera, number)
                                                  : PictureNames{picture_name(frame.camera, "color", number), {}, {}};
        depths |= !names.depth.empty();
        nlohmann::ordered_json entry;
        put_names(entry, names);
        put_pose(entry, frame);
        if (!model)
            entry["camera_model"] = transforms_model_of(frame.intrinsics).name;
        if (!one_view)
            put_intrinsics(entry, frame.intrinsics, model ? *model : transforms_model_of(frame.intrinsics));
        list.push_back(std::move(entry));
    }
    if (depths)
        file[kDepthUnit] = files.depth_unit;
    if (!files.points.empty())
        file["ply_file_path"] = files.points;
    if (!cameras.sensors.empty())
        file["rig"] = rig_json(cameras.sensors);
    file["frames"] = std::move(list);
    return write_file_atomically(path, json_text(file, 1) + "\n");
}

} // namespace semrover
