// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/buffer_folder.h"

#include "engine/format/number_image.h"
#include "engine/format/transforms.h"
#include "engine/scene/palette.h"
#include "runtime/base/hash.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <map>
#include <set>

namespace semrover {

namespace {

constexpr const char* kExtensions[] = {"png", "jpg", "npy"};

// numbers of the pictures in a folder, ascending; other names are not looked at
Result<std::vector<uint32_t>> picture_numbers(const Path& folder)
{
    SR_TRY(const std::vector<Path> files, list_files(folder));
    std::set<uint32_t> numbers;
    for (const Path& path : files) {
        const std::string stem = path.stem().string();
        const bool picture =
            std::ranges::any_of(kExtensions, [&](const char* e) { return path.extension() == std::string(".") + e; });
        if (picture && stem.size() == 6 && std::ranges::all_of(stem, ::isdigit))
            numbers.insert(uint32_t(std::stoul(stem)));
    }
    return std::vector(numbers.begin(), numbers.end());
}

Status check_size(const Path& path, const ImageSize& expected)
{
    SR_TRY(const ImageSize size, read_image_size(path));
    if (size != expected)
        return fail(ErrorCode::bad_input, "{} is {} x {} pixels, the first frame of its camera is {} x {}",
                    quote_path(path), size.width, size.height, expected.width, expected.height);
    return {};
}

Result<BufferCamera> open_camera(const Path& folder, std::string name)
{
    BufferCamera c;
    c.name = std::move(name);
    c.folder = folder;
    SR_TRY(const std::vector<uint32_t> numbers, picture_numbers(folder / "color"));
    if (numbers.empty())
        return fail(ErrorCode::bad_input, "{} holds no pictures 000000.png, 000001.png, ..",
                    quote_path(folder / "color"));
    c.frames = uint32_t(numbers.size());
    for (uint32_t i = 0; i < c.frames; ++i)
        if (numbers[i] != i)
            return fail(ErrorCode::bad_input, "{} is missing: there are frames up to {:06}",
                        quote_path(frame_path(folder, "color", i)), numbers.back());
    for (uint32_t i = 0; i < c.frames; ++i) {
        SR_TRY(const Path color, find_picture(folder, "color", i));
        const Path visible = frame_path(folder, "visible", i);
        if (!is_there(visible))
            return fail(ErrorCode::bad_input, "{} has no {}: a buffer is color/ and visible/", quote_path(color),
                        quote_path(visible));
        if (i == 0) {
            SR_TRY(c.size, read_image_size(color));
        }
        SR_CHECK(check_size(color, c.size));
        SR_CHECK(check_size(visible, c.size));
    }
    return c;
}

} // namespace

Path camera_folder(const Path& folder, const std::string& camera)
{
    return camera.empty() ? folder : folder / camera;
}

Path frame_path(const Path& folder, const char* kind, uint32_t number, std::string_view extension)
{
    return folder / kind / fmt::format("{:06}.{}", number, extension);
}

Result<Path> find_picture(const Path& folder, const char* kind, uint32_t number)
{
    std::vector<Path> found;
    for (const char* extension : kExtensions) {
        Path path = frame_path(folder, kind, number, extension);
        SR_TRY(const FileType type, examine(path));
        if (type == FileType::regular)
            found.push_back(std::move(path));
    }
    if (found.size() > 1)
        return fail(ErrorCode::bad_input, "{} and {} are one picture in two formats: expected one of them",
                    quote_path(found[0]), quote_path(found[1]));
    return found.empty() ? frame_path(folder, kind, number) : found[0];
}

std::string frame_text(const std::string& camera, uint32_t frame)
{
    return camera.empty() ? fmt::format("frame {}", frame) : fmt::format("frame {} of camera {}", frame, quote(camera));
}

Result<std::vector<BufferCamera>> open_buffers(const Path& folder)
{
    SR_TRY(const ShardsOrNone shards, open_if_shards(folder));
    if (!is_folder(folder))
        return fail(ErrorCode::bad_input, "{}: expected a folder of splat buffers or an .sgrid file",
                    quote_path(folder));
    SR_TRY(const double unit, read_depth_unit(folder));
    std::vector<BufferCamera> cameras;
    if (is_there(folder / "color")) {
        SR_TRY(cameras.emplace_back(), open_camera(folder, ""));
    } else {
        SR_TRY(const std::vector<Path> inside, list_folders(folder));
        for (const Path& path : inside)
            if (is_there(path / "color") && is_camera_name(path.filename().string())) {
                SR_TRY(cameras.emplace_back(), open_camera(path, path.filename().string()));
            }
    }
    if (cameras.empty())
        return fail(ErrorCode::bad_input,
                    "{} has no color/ nor folders of cameras with color/: expected a splat "
                    "buffer, or a rig of them",
                    quote_path(folder));
    for (BufferCamera& camera : cameras) {
        camera.shards = shards;
        camera.depth_unit = unit;
    }
    return cameras;
}

std::vector<BufferCamera> path_buffers(const Path& folder, const CameraPath& path, double depth_unit)
{
    std::map<std::string, BufferCamera> cameras;
    for (const CameraFrame& frame : path.frames) {
        BufferCamera& c = cameras[frame.camera];
        c.name = frame.camera;
        c.depth_unit = depth_unit;
        c.folder = frame.camera.empty() ? folder : folder / frame.camera;
        if (c.frames++ == 0)
            c.size = {frame.intrinsics.width, frame.intrinsics.height};
    }
    std::vector<BufferCamera> list;
    for (auto& [name, camera] : cameras)
        list.push_back(std::move(camera));
    return list;
}

Status check_against_path(std::span<const BufferCamera> cameras, const CameraPath& path)
{
    std::map<std::string, uint32_t> counts;
    for (const CameraFrame& frame : path.frames) {
        const auto* camera = std::to_address(std::ranges::find(cameras, frame.camera, &BufferCamera::name));
        if (camera == std::to_address(cameras.end()))
            return fail(ErrorCode::bad_input, "the path has a camera {}, the folder has no pictures of it",
                        quote(frame.camera));
        const uint32_t number = counts[frame.camera]++;
        if (ImageSize{frame.intrinsics.width, frame.intrinsics.height} != camera->size)
            return fail(ErrorCode::bad_input, "{} is {} x {} pixels in the path, others of its camera are {} x {}",
                        frame_text(frame.camera, number), frame.intrinsics.width, frame.intrinsics.height,
                        camera->size.width, camera->size.height);
    }
    for (const BufferCamera& camera : cameras)
        if (counts[camera.name] != camera.frames)
            return fail(ErrorCode::bad_input, "{} has {} frames, the path has {}", quote_path(camera.folder),
                        camera.frames, counts[camera.name]);
    return {};
}

Result<BufferFrame> read_buffer(const BufferCamera& camera, uint32_t frame)
{
    SR_TRY(const Path color_path, find_picture(camera.folder, "color", frame));
    SR_TRY(ImageRgb8 color, read_image_rgb8(color_path));
    SR_TRY(const ImageRgb8 visible, read_png_rgb8(frame_path(camera.folder, "visible", frame)));
    for (const ImageRgb8* image : {&std::as_const(color), &visible})
        if (ImageSize{image->width, image->height} != camera.size)
            return fail(ErrorCode::bad_input, "the pictures of {} in {} changed their size",
                        frame_text(camera.name, frame), quote_path(camera.folder));
    BufferFrame b{std::move(color.pixels), {}};
    b.visible.resize(visible.pixels.size() / 3);
    for (size_t i = 0; i < b.visible.size(); ++i)
        b.visible[i] = visible.pixels[3 * i];
    return b;
}

Result<DepthPicture> read_depth(const BufferCamera& camera, uint32_t frame)
{
    SR_TRY(const Path path, find_picture(camera.folder, "depth", frame));
    SR_TRY(DepthPicture depth, read_depth_picture(path, camera.depth_unit));
    if (ImageSize{depth.width, depth.height} != camera.size)
        return fail(ErrorCode::bad_input, "{} is {} x {} pixels, the frames of its camera are {} x {}",
                    quote_path(path), depth.width, depth.height, camera.size.width, camera.size.height);
    return depth;
}

Result<std::vector<uint8_t>> read_label_picture(const BufferCamera& camera, uint32_t frame)
{
    const Path path = frame_path(camera.folder, "label", frame);
    SR_TRY(const LabelImage labels, read_label_image(path));
    if (labels.size != camera.size)
        return fail(ErrorCode::bad_input, "{} is {} x {} pixels, the frames of its camera are {} x {}",
                    quote_path(path), labels.size.width, labels.size.height, camera.size.width, camera.size.height);
    std::vector<uint8_t> pixels;
    pixels.reserve(3 * labels.numbers.size());
    for (const uint16_t label : labels.numbers) {
        const std::array<uint8_t, 3> color = label < kClassCount ? kPalette[label].color : std::array<uint8_t, 3>{};
        pixels.insert(pixels.end(), color.begin(), color.end());
    }
    return pixels;
}

Result<uint64_t> hash_pictures(const BufferCamera& camera, std::initializer_list<const char*> kinds, uint32_t first,
                               uint32_t last)
{
    Hash hash;
    for (uint32_t i = first; i <= last; ++i)
        for (const char* kind : kinds) {
            SR_TRY(const Path path, find_picture(camera.folder, kind, i));
            SR_CHECK(hash.add_file(path));
        }
    return hash.value();
}

} // namespace semrover
