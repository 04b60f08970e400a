// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/camera_path.h"
#include "engine/format/camera_text.h"
#include "runtime/base/json_numbers.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <iterator>
#include <map>

namespace semrover {

namespace {

constexpr uint64_t kMaxColmapBytes = 256u << 20; // points of the pictures fill most of images.txt

struct ColmapModel {
    const char* name;
    CameraModel model;
    uint32_t focals;                   // 1: one focal length for both axes; 0: the image's size again
    std::vector<uint8_t> coefficients; // where each further parameter goes in Intrinsics::distortion
};

// https://colmap.github.io/cameras.html; parameters are f or fx fy, cx cy, then these
const ColmapModel kModels[] = {
    {"SIMPLE_PINHOLE", CameraModel::pinhole, 1, {}},
    {"PINHOLE", CameraModel::pinhole, 2, {}},
    {"SIMPLE_RADIAL", CameraModel::opencv, 1, {0}},
    {"RADIAL", CameraModel::opencv, 1, {0, 1}},
    {"OPENCV", CameraModel::opencv, 2, {0, 1, 2, 3}},
    {"FULL_OPENCV", CameraModel::opencv, 2, {0, 1, 2, 3, 4, 5, 6, 7}},
    {"OPENCV_FISHEYE", CameraModel::fisheye, 2, {0, 1, 2, 3}},
    {"EQUIRECTANGULAR", CameraModel::equirectangular, 0, {}},
};

std::string model_names()
{
    std::string text;
    for (const ColmapModel& m : kModels)
        text += fmt::format("{}{}", text.empty() ? "" : ", ", m.name);
    return text;
}

Result<Intrinsics> intrinsics_of(const ColmapModel& model, const std::vector<double>& v, std::string_view where)
{
    Intrinsics k;
    SR_TRY(k.width, image_side(v[0], fmt::format("{}: width", where)));
    SR_TRY(k.height, image_side(v[1], fmt::format("{}: height", where)));
    const size_t expected = model.focals ? model.focals + 2 + model.coefficients.size() : 2;
    if (v.size() - 2 != expected)
        return fail(ErrorCode::bad_input, "{}: expected {} parameters of {}, found {}", where, expected, model.name,
                    v.size() - 2);
    if (!model.focals) {
        if (v[2] != v[0] || v[3] != v[1])
            return fail(ErrorCode::bad_input, "{}: a panorama of {} x {} in a picture of {} x {}", where, v[2], v[3],
                        v[0], v[1]);
        return whole_sphere(k.width, k.height);
    }
    k.model = model.model;
    k.fx = v[2];
    k.fy = v[1 + model.focals];
    k.cx = v[2 + model.focals];
    k.cy = v[3 + model.focals];
    for (size_t i = 0; i < model.coefficients.size(); ++i)
        k.distortion[model.coefficients[i]] = v[4 + model.focals + i];
    SR_CHECK(check_intrinsics(k, where));
    return simplified(k);
}

// CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]
Result<std::map<std::string, Intrinsics>> read_cameras(const Path& path)
{
    const std::string name = quote_path(path);
    SR_TRY(const std::string text, read_text_file(path, kMaxPathBytes));
    std::map<std::string, Intrinsics> cameras;
    for (TextLines lines(text); lines.next();) {
        const std::string where = fmt::format("{} line {}", name, lines.number());
        std::vector<std::string_view> words = words_of(lines.line(), 20);
        if (words.empty())
            continue;
        if (words.size() < 5)
            return fail(ErrorCode::bad_input, "{}: expected CAMERA_ID MODEL WIDTH HEIGHT PARAMS, found {} words", where,
                        words.size());
        const auto model = std::ranges::find(kModels, words[1], &ColmapModel::name);
        if (model == std::end(kModels))
            return fail(ErrorCode::bad_input, "{}: camera model {} is not supported, expected one of {}", where,
                        quote(words[1], 60), model_names());
        const std::string id(words[0]);
        words.erase(words.begin(), words.begin() + 2);
        SR_TRY(const std::vector<double> values, numbers_of_words(words, where));
        SR_TRY(const Intrinsics intrinsics, intrinsics_of(*model, values, where));
        if (!cameras.emplace(id, intrinsics).second)
            return fail(ErrorCode::bad_input, "{}: a second camera {}", where, quote(id, 40));
    }
    if (cameras.empty())
        return fail(ErrorCode::bad_input, "{}: no cameras, expected lines CAMERA_ID MODEL WIDTH HEIGHT PARAMS", name);
    return cameras;
}

// "front/color/000001.png" and "front/000001.jpg" are pictures of the camera front, "color/000001.png" of none
std::string camera_of_picture(std::string_view picture)
{
    std::vector<std::string_view> folders;
    for (size_t slash; (slash = picture.find('/')) != std::string_view::npos; picture.remove_prefix(slash + 1))
        folders.push_back(picture.substr(0, slash));
    if (!folders.empty() && folders.back() == "color")
        folders.pop_back();
    return folders.size() == 1 && is_camera_name(folders[0]) ? std::string(folders[0]) : std::string();
}

struct NamedFrame {
    std::string picture;
    CameraFrame frame;
};

// IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, world to camera
Result<NamedFrame> read_image(const std::vector<std::string_view>& words,
                              const std::map<std::string, Intrinsics>& cameras, std::string_view where)
{
    if (words.size() != 10)
        return fail(ErrorCode::bad_input,
                    "{}: expected the 10 words IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, found {}", where,
                    words.size() > 10 ? "more" : fmt::format("{}", words.size()));
    SR_TRY(const std::vector<double> v, numbers_of_words({words.begin() + 1, words.begin() + 8}, where));
    NamedFrame named{std::string(words[9]), {}};
    const double norm = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2] + v[3] * v[3]);
    if (norm < 0.9 || norm > 1.1)
        return fail(ErrorCode::bad_input, "{}: expected a quaternion of norm 1, found {:.3g}; the order is w x y z",
                    where, norm);
    SR_TRY(named.frame.pose.world_to_camera,
           rigid_from_quaternion({v[4], v[5], v[6]}, {v[1], v[2], v[3], v[0]}, where));
    const auto camera = cameras.find(std::string(words[8]));
    if (camera == cameras.end())
        return fail(ErrorCode::bad_input, "{}: no camera {} in cameras.txt", where, quote(words[8], 40));
    named.frame.intrinsics = camera->second;
    named.frame.camera = camera_of_picture(named.picture);
    return named;
}

Result<std::vector<NamedFrame>> read_images(const Path& path, const std::map<std::string, Intrinsics>& cameras)
{
    const std::string name = quote_path(path);
    SR_TRY(const std::string text, read_text_file(path, kMaxColmapBytes));
    std::vector<NamedFrame> frames;
    for (TextLines lines(text); lines.next();) {
        const std::vector<std::string_view> words = words_of(lines.line(), 10);
        if (words.empty())
            continue;
        SR_TRY(NamedFrame frame, read_image(words, cameras, fmt::format("{} line {}", name, lines.number())));
        frames.push_back(std::move(frame));
        // the next line is of points in the picture, x y id each, and may be empty
        if (lines.next() && count_words(lines.line()) % 3 != 0)
            return fail(ErrorCode::bad_input,
                        "{} line {}: expected the points of the picture (X Y POINT3D_ID each; the line may be empty)",
                        name, lines.number());
    }
    if (frames.empty())
        return fail(ErrorCode::bad_input, "{}: a camera path without poses, no images", name);
    return frames;
}

const ColmapModel& model_for(const Intrinsics& k)
{
    switch (k.model) {
    case CameraModel::opencv:
        return std::ranges::any_of(k.distortion.begin() + 4, k.distortion.end(), [](double v) { return v != 0; })
                   ? kModels[5]
                   : kModels[4];
    case CameraModel::fisheye:
        return kModels[6];
    case CameraModel::equirectangular:
        return kModels[7];
    case CameraModel::pinhole:
        break;
    }
    return kModels[1];
}

std::string camera_line(const Intrinsics& k, size_t id)
{
    const ColmapModel& model = model_for(k);
    std::string line = fmt::format("{} {} {} {}", id, model.name, k.width, k.height);
    if (model.focals)
        line += fmt::format(" {} {} {} {}", k.fx, k.fy, k.cx, k.cy);
    else
        line += fmt::format(" {} {}", k.width, k.height);
    for (const uint8_t at : model.coefficients)
        line += fmt::format(" {}", k.distortion[at]);
    return line + "\n";
}

} // namespace

Result<CameraPath> read_colmap(const Path& folder)
{
    SR_TRY(const auto cameras, read_cameras(folder / "cameras.txt"));
    SR_TRY(std::vector<NamedFrame> frames, read_images(folder / "images.txt", cameras));
    std::ranges::stable_sort(frames, {}, &NamedFrame::picture);
    std::map<std::string, uint32_t> counts; // there are no times: the pictures of each camera are a second apart
    CameraPath path;
    const bool one_folder = std::ranges::all_of(frames, [&](const NamedFrame& f) {
        return f.frame.camera == frames[0].frame.camera && f.picture.find("/color/") == std::string::npos;
    });
    for (NamedFrame& named : frames) {
        if (one_folder) // "images/000001.jpg": where the pictures are, no camera's name
            named.frame.camera.clear();
        named.frame.time = counts[named.frame.camera]++;
        path.frames.push_back(std::move(named.frame));
    }
    std::ranges::stable_sort(path.frames, {}, &CameraFrame::time);
    return path;
}

Status write_colmap(const Path& folder, const CameraPath& cameras)
{
    SR_ASSERT(!cameras.frames.empty(), "a camera path without frames");
    std::vector<Intrinsics> distinct;
    std::string camera_text = "# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]\n";
    std::string image_text =
        "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME   world to camera\n# points of the image\n";
    std::map<std::string, size_t> counts;
    size_t image = 0;
    for (const CameraFrame& frame : cameras.frames) {
        size_t id = size_t(std::ranges::find(distinct, frame.intrinsics) - distinct.begin()) + 1;
        if (id > distinct.size()) {
            distinct.push_back(frame.intrinsics);
            camera_text += camera_line(frame.intrinsics, id);
        }
        const Quaternion q = quaternion_of(frame.pose.world_to_camera);
        fmt::format_to(std::back_inserter(image_text), "{} {} {} {} {} {}{}color/{:06}.png\n\n", ++image, q[3],
                       fmt::join(std::span(q).first(3), " "),
                       fmt::join(translation_of(frame.pose.world_to_camera), " "), id, frame.camera,
                       frame.camera.empty() ? "" : "/", counts[frame.camera]++);
    }
    std::error_code error;
    const bool made = std::filesystem::create_directories(folder, error);
    std::vector<Path> written;
    for (const auto& [file, text] : {std::pair{"points3D.txt", std::string("# none\n")}, // readers ask for it
                                     {"cameras.txt", camera_text},
                                     {"images.txt", image_text}}) {
        const bool there = std::filesystem::exists(folder / file, error);
        const Status status = write_file_atomically(folder / file, text);
        if (!there && status)
            written.push_back(folder / file);
        if (status)
            continue;
        for (const Path& path : written) // all or nothing
            std::filesystem::remove(path, error);
        if (made)
            std::filesystem::remove(folder, error);
        return status;
    }
    return {};
}

} // namespace semrover
