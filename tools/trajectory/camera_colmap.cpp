// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/quote.h"
#include "tools/trajectory/camera_path.h"
#include "tools/trajectory/camera_text.h"
#include "tools/trajectory/colmap_models.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>

namespace semrover {

namespace {

constexpr uint64_t kMaxColmapBytes = 256u << 20; // points of the pictures fill most of images.txt

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
        const ColmapModel* model = colmap_model_of_name(words[1]);
        if (!model)
            return fail(ErrorCode::bad_input, "{}: camera model {} is not supported, expected one of {}", where,
                        quote(words[1], 60), colmap_model_names());
        const std::string id(words[0]);
        words.erase(words.begin(), words.begin() + 2);
        SR_TRY(const std::vector<double> values, numbers_of_words(words, where));
        SR_TRY(const Intrinsics intrinsics, colmap_intrinsics(*model, values, where));
        if (!cameras.emplace(id, intrinsics).second)
            return fail(ErrorCode::bad_input, "{}: a second camera {}", where, quote(id, 40));
    }
    if (cameras.empty())
        return fail(ErrorCode::bad_input, "{}: no cameras, expected lines CAMERA_ID MODEL WIDTH HEIGHT PARAMS", name);
    return cameras;
}

// IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, world to camera; a name may have blanks
Result<ColmapPicture> read_image(std::string_view line, const std::map<std::string, Intrinsics>& cameras,
                                 std::string_view where)
{
    const std::vector<std::string_view> words = cut_words(line, 9);
    if (words.size() != 9 || line.empty())
        return fail(ErrorCode::bad_input,
                    "{}: expected the 10 words IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, found {}", where,
                    words.size());
    SR_TRY(const std::vector<double> v, numbers_of_words({words.begin() + 1, words.begin() + 8}, where));
    const auto camera = cameras.find(std::string(words[8]));
    if (camera == cameras.end())
        return fail(ErrorCode::bad_input, "{}: no camera {} in cameras.txt", where, quote(words[8], 40));
    return colmap_picture({v[0], v[1], v[2], v[3]}, {v[4], v[5], v[6]}, camera->second, std::string(line), where);
}

Result<std::vector<ColmapPicture>> read_images(const Path& path, const std::map<std::string, Intrinsics>& cameras)
{
    const std::string name = quote_path(path);
    SR_TRY(const std::string text, read_text_file(path, kMaxColmapBytes));
    std::vector<ColmapPicture> frames;
    for (TextLines lines(text); lines.next();) {
        if (count_words(lines.line()) == 0)
            continue;
        SR_TRY(ColmapPicture frame, read_image(lines.line(), cameras, fmt::format("{} line {}", name, lines.number())));
        frames.push_back(std::move(frame));
        // the next line is of points in the picture, x y id each, and may be empty
        if (lines.next() && count_words(lines.line()) % 3 != 0)
            return fail(ErrorCode::bad_input,
                        "{} line {}: expected the points of the picture (X Y POINT3D_ID each; the line may be empty)",
                        name, lines.number());
    }
    if (frames.empty())
        return fail(ErrorCode::bad_input, "{}: a trajectory without poses, no images", name);
    return frames;
}

std::string camera_line(const Intrinsics& k, size_t id)
{
    const ColmapModel& model = colmap_model_for(k);
    std::string line = fmt::format("{} {} {} {}", id, model.name, k.width, k.height);
    if (model.focals)
        line += fmt::format(" {} {} {} {}", k.fx, k.fy, k.cx, k.cy);
    else
        line += fmt::format(" {} {}", k.width, k.height);
    for (const uint8_t at : model.coefficients)
        line += fmt::format(" {}", k.distortion[at]);
    return line + "\n";
}

// POINT3D_ID X Y Z R G B ERROR TRACK[], the track of no picture
std::string points_text(const Splats& points)
{
    std::string text = "# POINT3D_ID X Y Z R G B ERROR TRACK[]\n";
    for (size_t i = 0; i < points.position.size(); ++i) {
        std::array<int, 3> color;
        std::ranges::transform(points.color[i], color.begin(),
                               [](float c) { return int(std::lround(std::clamp(c, 0.f, 1.f) * 255)); });
        fmt::format_to(std::back_inserter(text), "{} {} {} 0\n", i + 1, fmt::join(points.position[i], " "),
                       fmt::join(color, " "));
    }
    return text;
}

Result<std::vector<ColmapPicture>> read_colmap_text(const Path& folder)
{
    SR_TRY(const auto cameras, read_cameras(folder / "cameras.txt"));
    return read_images(folder / "images.txt", cameras);
}

} // namespace

Result<CameraPath> read_colmap(const Path& folder)
{
    SR_TRY(std::vector<ColmapPicture> frames,
           is_there(folder / "cameras.bin") ? read_colmap_binary(folder) : read_colmap_text(folder));
    std::ranges::stable_sort(frames, natural_less, &ColmapPicture::name);
    std::map<std::string, uint32_t> counts; // there are no times: the pictures of each camera are a second apart
    CameraPath path;
    const bool one_folder = std::ranges::all_of(frames, [&](const ColmapPicture& f) {
        return f.frame.camera == frames[0].frame.camera && f.name.find("/color/") == std::string::npos;
    });
    for (ColmapPicture& named : frames) {
        if (one_folder) // "images/000001.jpg": where the pictures are, no camera's name
            named.frame.camera.clear();
        named.frame.time = counts[named.frame.camera]++;
        named.frame.picture = std::move(named.name);
        path.frames.push_back(std::move(named.frame));
    }
    std::ranges::stable_sort(path.frames, {}, &CameraFrame::time);
    return path;
}

std::string colmap_picture_name(const std::string& camera, uint32_t number, size_t cameras, std::string_view extension)
{
    return cameras > 1 ? fmt::format("{0}/{0}_{1:06}.{2}", camera, number, extension)
                       : picture_name(camera, "color", number, extension);
}

Status write_colmap(const Path& folder, const CameraPath& cameras, const Splats& points, std::string_view extension)
{
    SR_ASSERT(!cameras.frames.empty(), "a trajectory without frames");
    if (is_there(folder / "cameras.bin"))
        return fail(ErrorCode::bad_input, "{}: holds a binary model, which programs would read instead of the text",
                    quote_path(folder));
    std::vector<Intrinsics> distinct;
    std::string camera_text = "# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]\n";
    std::string image_text =
        "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME   world to camera\n# points of the image\n";
    std::map<std::string, uint32_t> counts;
    for (const CameraFrame& frame : cameras.frames)
        counts[frame.camera] = 0;
    size_t image = 0;
    for (const CameraFrame& frame : cameras.frames) {
        const Intrinsics& k = frame.intrinsics;
        if (k.model == CameraModel::ftheta ||
            std::ranges::any_of(std::span(k.distortion).subspan(8), [](double v) { return v != 0; }))
            return fail(ErrorCode::bad_input, "{}: COLMAP has no model of {} lenses", quote_path(folder),
                        k.model == CameraModel::ftheta ? "ftheta" : "opencv thin prism");
        size_t id = size_t(std::ranges::find(distinct, frame.intrinsics) - distinct.begin()) + 1;
        if (id > distinct.size()) {
            distinct.push_back(frame.intrinsics);
            camera_text += camera_line(frame.intrinsics, id);
        }
        const Quaternion q = quaternion_of(frame.pose.world_to_camera);
        fmt::format_to(std::back_inserter(image_text), "{} {} {} {} {} {}\n\n", ++image, q[3],
                       fmt::join(std::span(q).first(3), " "),
                       fmt::join(translation_of(frame.pose.world_to_camera), " "), id,
                       colmap_picture_name(frame.camera, counts[frame.camera]++, counts.size(), extension));
    }
    std::error_code error;
    const bool made = !is_there(folder);
    SR_CHECK(make_folder(folder));
    std::vector<Path> written;
    for (const auto& [file, text] : {std::pair{"points3D.txt", points_text(points)}, // readers ask for it
                                     {"cameras.txt", camera_text},
                                     {"images.txt", image_text}}) {
        const bool there = is_there(folder / file);
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
