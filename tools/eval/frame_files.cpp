// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

#include "engine/format/transforms.h"
#include "runtime/base/quote.h"
#include "tools/eval/sample_files.h"

#include <algorithm>

namespace semrover {

namespace {

Status check_size(const Path& path, ImageSize found, ImageSize expected)
{
    if (expected.width && found != expected)
        return fail(ErrorCode::bad_input, "{} is {} x {} pixels, expected {} x {}", quote_path(path), found.width,
                    found.height, expected.width, expected.height);
    return {};
}

// "front/color/000003.png" of kind color: "front/000003"
std::string name_of(const Path& relative, std::string_view kind)
{
    Path name;
    for (const Path& part : relative.parent_path())
        if (part != kind)
            name /= part;
    return (name / relative.stem()).generic_string();
}

} // namespace

Result<FrameFiles> list_frames(const Path& folder, std::string_view kind)
{
    FrameFiles files;
    SR_TRY(files.shards, open_if_shards(folder));
    Path base = folder;
    if (kind == "color" && is_folder(folder / "frames"))
        base = folder / "frames";
    else if (is_folder(folder / kind))
        base = folder / kind;
    SR_TRY(std::vector<Path> paths, list_all_images(base, kind == "label" || kind == "depth"));
    const auto of_kind = [&](const Path& path) { return path.parent_path().filename() == kind; };
    if (std::ranges::any_of(paths, of_kind))
        std::erase_if(paths, [&](const Path& path) { return !of_kind(path); });
    for (const Path& path : paths) {
        const auto [at, fresh] = files.emplace(name_of(path.lexically_relative(base), kind), path);
        if (!fresh)
            return fail(ErrorCode::bad_input, "{} and {} are one frame: expected one picture of each name",
                        quote_path(at->second), quote_path(path));
    }
    return files;
}

Result<double> depth_unit_of(const Path& folder)
{
    return read_depth_unit(folder.filename() == "depth" ? folder.parent_path() : folder);
}

Status check_names(const FrameFiles& files, const Path& folder, const FrameFiles& other, const Path& other_folder,
                   bool exactly)
{
    for (const auto& [name, path] : files)
        if (!other.contains(name))
            return fail(ErrorCode::bad_input, "{} has no picture {}, which {} has: expected pictures of the same names",
                        quote_path(other_folder), quote(name), quote_path(folder));
    return exactly ? check_names(other, other_folder, files, folder, false) : Status{};
}

Result<std::vector<uint8_t>> read_gray_frame(const Path& path, ImageSize size)
{
    SR_TRY(const ImageRgb8 image, read_color_frame(path, size));
    std::vector<uint8_t> values(image.pixels.size() / 3);
    for (size_t i = 0; i < values.size(); ++i)
        values[i] = image.pixels[3 * i];
    return values;
}

Result<std::vector<uint8_t>> read_label_frame(const Path& path, ImageSize size, PictureClasses& map)
{
    SR_TRY(const LabelImage image, read_label_image(path));
    SR_CHECK(check_size(path, image.size, size));
    map.count(image);
    std::vector<uint8_t> labels;
    labels.reserve(image.numbers.size());
    for (const uint16_t number : image.numbers)
        labels.push_back(map[number] < kClassCount ? map[number] : kNoLabel);
    return labels;
}

Result<std::vector<uint16_t>> read_instance_frame(const Path& path, ImageSize size)
{
    SR_TRY(ImageGray16 image, read_png_gray16(path));
    SR_CHECK(check_size(path, {image.width, image.height}, size));
    return std::move(image.pixels);
}

Result<ImageRgb8> read_color_frame(const Path& path, ImageSize size)
{
    SR_TRY(ImageRgb8 image, read_image_rgb8(path));
    SR_CHECK(check_size(path, {image.width, image.height}, size));
    return image;
}

Result<DepthPicture> read_depth_frame(const Path& path, ImageSize size, double unit)
{
    SR_TRY(DepthPicture image, read_depth_picture(path, unit));
    SR_CHECK(check_size(path, {image.width, image.height}, size));
    return image;
}

} // namespace semrover
