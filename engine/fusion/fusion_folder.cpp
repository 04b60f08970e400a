// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/fusion/fusion_folder.h"

#include "engine/format/camera_path.h"
#include "engine/format/image.h"
#include "engine/mesh/mesh.h"
#include "runtime/base/json_numbers.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <map>

namespace semrover {

namespace {

namespace fs = std::filesystem;

// a path of a file, kept inside the folder
Result<Path> inside(const Path& folder, const Json& name, std::string_view where)
{
    if (!name.is_string())
        return fail(ErrorCode::bad_input, "{}: expected a text, found {}", where, name.type_name());
    const std::string& text = name.get_ref<const std::string&>();
    const Path relative = Path(text).lexically_normal();
    if (text.empty() || text.find('\0') != std::string::npos || relative.is_absolute() || *relative.begin() == "..")
        return fail(ErrorCode::bad_input, "{}: expected a path inside the folder, found {}", where, quote(text));
    return folder / relative;
}

// what a picture is called in the folder `kind` beside its own; of one that lies in no folder, in the folder itself
Path sibling(const Path& folder, const Path& picture, const char* kind)
{
    const Path parent = picture.parent_path();
    return (parent == folder ? folder : parent.parent_path()) / kind / (picture.stem().string() + ".png");
}

// the picture, whichever of the extensions it has; the name itself where there is none
Path with_extension(Path picture)
{
    if (is_file(picture))
        return picture;
    for (const char* extension : {".png", ".jpg", ".jpeg"})
        if (Path other = picture; is_file(other.replace_extension(extension)))
            return other;
    return picture;
}

bool is_jpeg(const Path& path)
{
    return path.extension() == ".jpg" || path.extension() == ".jpeg";
}

// pictures of a kind that a camera's folder has; none of a kind that has no folder
Path optional_picture(const Path& picture)
{
    return is_folder(picture.parent_path()) ? with_extension(picture) : Path();
}

Status check_size(const Path& path, uint32_t width, uint32_t height, const Intrinsics& k)
{
    if (width != k.width || height != k.height)
        return fail(ErrorCode::bad_input, "{} is {} x {} pixels, the camera has {} x {}", quote_path(path), width,
                    height, k.width, k.height);
    return {};
}

Result<Intrinsics> read_intrinsics_file(const Path& path)
{
    const std::string name = quote_path(path);
    SR_TRY(const Json file, read_json(path));
    if (!file.is_object())
        return fail(ErrorCode::bad_input, "{}: expected an object, found {}", name, file.type_name());
    std::array<double, 6> values{};
    const char* keys[] = {"fx", "fy", "cx", "cy", "width", "height"};
    for (size_t i = 0; i < 6; ++i) {
        SR_TRY(const std::optional<double> value, optional_number(file, keys[i], name));
        if (!value)
            return fail(ErrorCode::bad_input, "{}: {} is missing, expected fx, fy, cx, cy, width and height", name,
                        keys[i]);
        values[i] = *value;
    }
    Intrinsics k{values[0], values[1], values[2], values[3]};
    SR_TRY(k.width, image_side(values[4], name + ": width"));
    SR_TRY(k.height, image_side(values[5], name + ": height"));
    SR_CHECK(check_intrinsics(k, name));
    return k;
}

// what options say replaces what files say
Status apply_options(const FusionFolderOptions& o, Intrinsics& k)
{
    if (o.fov_x)
        k = pinhole_from_fov(*o.fov_x, k.width, k.height);
    k.fx = o.fx.value_or(k.fx);
    k.fy = o.fy ? *o.fy : o.fx.value_or(k.fy);
    k.cx = o.cx.value_or(k.cx);
    k.cy = o.cy.value_or(k.cy);
    return check_intrinsics(k, "--fx, --fy, --cx, --cy");
}

// the size of the first depth picture that there is
Result<ImageSize> first_depth_size(const Path& folder)
{
    std::vector<Path> found;
    std::error_code error;
    for (const auto& entry : fs::recursive_directory_iterator(folder, error))
        if (entry.path().parent_path().filename() == "depth" && entry.path().extension() == ".png")
            found.push_back(entry.path());
    if (found.empty())
        return fail(ErrorCode::bad_input, "{}: no depth/*.png, expected 16-bit gray pictures there",
                    quote_path(folder));
    return read_png_size(*std::ranges::min_element(found));
}

} // namespace

Result<FusionFolder> FusionFolder::open(const Path& folder, const FusionFolderOptions& options)
{
    if (!is_folder(folder))
        return fail(ErrorCode::bad_input, "{}: expected a folder of depth/, poses and pictures", quote_path(folder));
    const Path poses = options.poses.empty() ? folder / "transforms.json" : options.poses;
    if (options.poses.empty() && !is_file(poses))
        return fail(ErrorCode::bad_input, "{} is missing; another camera path may be given with --poses",
                    quote_path(poses));
    FusionFolder f;
    f.folder_ = folder;
    f.map_ = LabelMap::identity();
    if (!options.map.empty())
        SR_CHECK(f.map_.apply(options.map));
    if (!f.map_.knows(kNoLabel))
        f.map_.set(kNoLabel, "nothing", kEmpty);
    SR_CHECK(f.read_poses(poses, options));
    SR_CHECK(f.find_pictures(poses));
    SR_CHECK(f.check_count(poses));
    SR_CHECK(f.check_pictures());
    LabelMap lookup = f.map_; // asking counts
    for (size_t i = 0; i < f.classes_.size(); ++i)
        f.classes_[i] = lookup(uint32_t(i));
    return f;
}

Status FusionFolder::read_poses(const Path& poses, const FusionFolderOptions& o)
{
    std::optional<Intrinsics> fallback;
    if (o.fx || o.fov_x) {
        SR_TRY(const ImageSize size, first_depth_size(folder_));
        fallback = pinhole_from_fov(o.fov_x.value_or(90), size.width, size.height);
        SR_CHECK(apply_options(o, *fallback));
    } else if (is_file(folder_ / "intrinsics.json")) {
        SR_TRY(fallback, read_intrinsics_file(folder_ / "intrinsics.json"));
    }
    const std::optional<FoundPath> found = find_path(poses);
    CameraPath path;
    if (fallback || !found || found->format == PathFormat::colmap || found->format == PathFormat::camera_path) {
        SR_TRY(path, read_camera_path(poses, fallback.value_or(pinhole_from_fov(90, 1, 1)), o.placement));
    } else if (found->format == PathFormat::transforms) {
        SR_TRY(path, read_transforms(found->path));
        SR_CHECK(place_path(path, o.placement, quote_path(poses)));
    } else {
        return fail(ErrorCode::bad_input,
                    "{} has no intrinsics: expected {}, or --fx (and --fy, --cx, --cy), or --fov-x", quote_path(poses),
                    quote_path(folder_ / "intrinsics.json"));
    }
    warnings_ = std::move(path.warnings);
    if (path.body)
        warnings_.push_back(body_text(quote_path(poses), *path.body));
    cameras_ = std::move(path.frames);
    for (size_t i = 0; i < cameras_.size(); ++i) {
        SR_CHECK(apply_options(o, cameras_[i].intrinsics));
        if (cameras_[i].intrinsics.model != CameraModel::pinhole)
            return fail(ErrorCode::bad_input,
                        "{}: {} has a lens with distortion, expected a pinhole: undistort its "
                        "pictures first",
                        quote_path(poses), name_of(i));
    }
    return {};
}

Status FusionFolder::find_pictures(const Path& poses)
{
    Json frames;
    if (poses.extension() == ".json") {
        SR_TRY(const Json file, read_json(poses));
        frames = file.is_object() ? file.value("frames", Json()) : Json();
    }
    std::map<std::string, uint32_t> counts;
    for (size_t i = 0; i < cameras_.size(); ++i) {
        const std::string& camera = cameras_[i].camera;
        const Path base = camera.empty() ? folder_ : folder_ / camera;
        Path picture = base / "color" / fmt::format("{:06}.png", counts[camera]++);
        const Json* frame = frames.is_array() && i < frames.size() && frames[i].is_object() ? &frames[i] : nullptr;
        const auto named = [&](const char* key, Path& path) -> Status {
            if (frame && frame->contains(key)) {
                SR_TRY(path, inside(folder_, (*frame)[key], fmt::format("{} frame {}: {}", quote_path(poses), i, key)));
            }
            return {};
        };
        SR_CHECK(named("file_path", picture));
        Pictures p{sibling(folder_, picture, "depth"), {}, optional_picture(picture)};
        Path label = sibling(folder_, picture, "label");
        SR_CHECK(named("depth_file_path", p.depth));
        SR_CHECK(named("label_file_path", label));
        p.label = optional_picture(label);
        pictures_.push_back(std::move(p));
    }
    return {};
}

std::string FusionFolder::name_of(size_t frame) const
{
    const std::string& camera = cameras_[frame].camera;
    return camera.empty() ? fmt::format("frame {}", frame) : fmt::format("frame {} ({})", frame, printable(camera));
}

// pictures that are numbered must be as many as poses, else they were paired wrongly
Status FusionFolder::check_count(const Path& poses) const
{
    std::map<Path, size_t> used;
    for (const Pictures& p : pictures_)
        if (p.depth.stem().string().size() == 6)
            ++used[p.depth.parent_path()];
    for (const auto& [folder, frames] : used) {
        size_t found = 0;
        std::error_code error;
        for (const auto& entry : fs::directory_iterator(folder, error))
            found += entry.path().extension() == ".png";
        if (found > frames && poses.extension() != ".json")
            return fail(ErrorCode::bad_input, "{} holds {} pictures, {} has {} poses", quote_path(folder), found,
                        quote_path(poses), frames);
    }
    return {};
}

Status FusionFolder::check_pictures() const
{
    for (size_t i = 0; i < cameras_.size(); ++i) {
        const Pictures& p = pictures_[i];
        const Intrinsics& k = cameras_[i].intrinsics;
        for (const Path* path : {&p.depth, &p.label, &p.color})
            if (!path->empty() && !is_file(*path))
                return fail(ErrorCode::bad_input, "{}: {} is missing", name_of(i), quote_path(*path));
        for (const Path* path : {&p.depth, &p.label, &p.color}) {
            if (path->empty() || is_jpeg(*path))
                continue;
            SR_TRY(const ImageSize size, read_png_size(*path));
            SR_CHECK(check_size(*path, size.width, size.height, k));
        }
    }
    return {};
}

Result<std::vector<uint8_t>> FusionFolder::read_labels(size_t frame) const
{
    const Path& path = pictures_[frame].label;
    SR_TRY(const ImageRgb8 image, read_png_rgb8(path));
    SR_CHECK(check_size(path, image.width, image.height, cameras_[frame].intrinsics));
    std::vector<uint8_t> labels(image.pixels.size() / 3);
    for (size_t i = 0; i < labels.size(); ++i) {
        const uint8_t* rgb = &image.pixels[3 * i];
        if (rgb[0] != rgb[1] || rgb[0] != rgb[2])
            return fail(ErrorCode::bad_input,
                        "{}: expected class numbers in gray, found the colour ({}, {}, {}) at column {}, row {}",
                        quote_path(path), rgb[0], rgb[1], rgb[2], i % image.width, i / image.width);
        labels[i] = rgb[0];
    }
    return labels;
}

Status FusionFolder::check_labels()
{
    for (size_t i = 0; i < cameras_.size(); ++i) {
        if (pictures_[i].label.empty())
            continue;
        SR_TRY(const std::vector<uint8_t> labels, read_labels(i));
        std::array<uint64_t, 256> counts{};
        for (const uint8_t label : labels)
            ++counts[label];
        for (size_t label = 0; label < counts.size(); ++label)
            if (counts[label])
                map_(uint32_t(label), counts[label]);
    }
    return map_.check(quote_path(folder_), "pixels");
}

size_t FusionFolder::labelled() const
{
    return size_t(std::ranges::count_if(pictures_, [](const Pictures& p) { return !p.label.empty(); }));
}

size_t FusionFolder::colored() const
{
    return size_t(std::ranges::count_if(pictures_, [](const Pictures& p) { return !p.color.empty(); }));
}

Result<DepthImages> FusionFolder::load(size_t frame) const
{
    const Pictures& p = pictures_[frame];
    const Intrinsics& k = cameras_[frame].intrinsics;
    DepthImages images;
    SR_TRY(ImageGray16 depth, read_png_gray16(p.depth));
    SR_CHECK(check_size(p.depth, depth.width, depth.height, k));
    images.depth = std::move(depth.pixels);
    if (!p.label.empty()) {
        SR_TRY(images.labels, read_labels(frame));
        for (size_t i = 0; i < images.labels.size(); ++i) {
            const uint8_t label = classes_[images.labels[i]];
            if (label == kLeftOut)
                images.depth[i] = 0;
            images.labels[i] = label < kClassCount ? label : kNoLabel;
        }
    }
    if (!p.color.empty()) {
        SR_TRY(ImageRgb8 color, is_jpeg(p.color) ? read_jpeg_rgb8(p.color) : read_png_rgb8(p.color));
        SR_CHECK(check_size(p.color, color.width, color.height, k));
        images.colors = std::move(color.pixels);
    }
    return images;
}

DepthFrames FusionFolder::frames() const
{
    return {cameras_, [this](size_t frame) { return load(frame); }};
}

} // namespace semrover
