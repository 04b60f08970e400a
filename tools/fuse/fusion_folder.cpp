// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/fuse/fusion_folder.h"

#include "engine/format/number_image.h"
#include "engine/fusion/depth_frames.h"
#include "engine/mesh/mesh.h"
#include "runtime/base/json_numbers.h"
#include "runtime/base/quote.h"
#include "tools/fuse/frame_pictures.h"
#include "tools/trajectory/camera_path.h"

#include <algorithm>
#include <limits>

namespace semrover {

namespace {

// a focal length that no camera has: a path that says none of its own comes back with it
constexpr double kNotSaid = std::numeric_limits<double>::min();

std::string text_of(ImageSize size)
{
    return fmt::format("{} x {}", size.width, size.height);
}

bool is_jpeg(const Path& path)
{
    return path.extension() == ".jpg" || path.extension() == ".jpeg";
}

Status check_view(const Path& path, ImageSize size, ImageSize depth)
{
    if (!same_view(size, depth))
        return fail(ErrorCode::bad_input,
                    "{} is {} pixels, the depth of its frame has {}: expected the same view, of any number of pixels",
                    quote_path(path), text_of(size), text_of(depth));
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
    return check_intrinsics(k, "`fx`, `fy`, `cx`, `cy`");
}

// the first picture below a folder of one of these names; empty: none
Result<Path> first_picture(const Path& folder, std::initializer_list<const char*> kinds)
{
    SR_TRY(const std::vector<Path> files, list_tree(folder));
    for (const Path& path : files) {
        const Path relative = path.parent_path().lexically_relative(folder);
        const bool picture = std::ranges::find(kPictureEndings, path.extension().string()) != std::end(kPictureEndings);
        if (picture && std::ranges::any_of(kinds, [&](const char* kind) {
                return std::ranges::find(relative, Path(kind)) != relative.end();
            }))
            return path;
    }
    return Path();
}

Result<ImageSize> first_depth_size(const Path& folder)
{
    SR_TRY(Path picture, first_picture(folder, {"depth"}));
    if (picture.empty() && is_there(folder / kDepthMaps)) {
        SR_TRY(const std::vector<Path> maps, list_tree(folder / kDepthMaps));
        const auto map = std::ranges::find(maps, Path(".bin"), &Path::extension);
        picture = map == maps.end() ? Path() : *map;
    }
    if (picture.empty())
        return fail(ErrorCode::bad_input, "{}: no depth/*.png or depth/*.npy, expected 16-bit gray pictures there",
                    quote_path(folder));
    return number_image_size(picture);
}

// of the pictures that a path without sizes means: the colours, where there are some
Result<ImageSize> first_color_size(const Path& folder, ImageSize depth)
{
    SR_TRY(const Path picture, first_picture(folder, {"color", "rgb", "images"}));
    if (picture.empty())
        return depth;
    SR_TRY(const ImageRgb8 image, read_image_rgb8(picture));
    return ImageSize{image.width, image.height};
}

// --poses, transforms.json, or what TUM RGB-D calls them
Result<Path> poses_of(const Path& folder, const Path& given)
{
    if (!given.empty())
        return given;
    for (const char* name : {"transforms.json", "groundtruth.txt"})
        if (is_file(folder / name))
            return folder / name;
    return fail(ErrorCode::bad_input, "{} is missing; another trajectory may be given with `poses`",
                quote_path(folder / "transforms.json"));
}

} // namespace

Result<FusionFolder> FusionFolder::open(const Path& folder, const FusionFolderOptions& options)
{
    FusionFolder f;
    SR_TRY(f.shards_, open_if_shards(folder));
    if (!is_folder(folder))
        return fail(ErrorCode::bad_input, "{}: expected a folder of depth/, poses and pictures", quote_path(folder));
    SR_TRY(const Path poses, poses_of(folder, options.poses));
    f.folder_ = folder;
    f.encoding_ = options.depth;
    SR_TRY(f.encoding_.usual_unit, read_depth_unit(folder));
    SR_TRY(f.classes_, PictureClasses::create(options.map));
    SR_CHECK(f.read_poses(poses, options));
    SR_CHECK(f.find_frames(poses, options));
    if (std::ranges::none_of(f.pictures_, [](const FramePictures& p) { return is_file(p.depth); })) {
        SR_TRY(f.lidar_, find_lidar(folder));
    }
    SR_CHECK(f.check_pictures());
    if (f.lidar_) {
        SR_TRY(SweepFrames sweeps, SweepFrames::open(*f.lidar_, f.placed_, f.cameras_));
        f.seen_ = sweeps.frames();
        f.sweeps_ = std::make_shared<SweepFrames>(std::move(sweeps));
        return f;
    }
    SR_CHECK(f.note_encoding());
    f.find_views();
    return f;
}

Status FusionFolder::read_poses(const Path& poses, const FusionFolderOptions& o)
{
    const auto size = first_depth_size(folder_);
    const bool json = poses.extension() == ".json";
    if (!size && (!json || o.fx || o.fov_x))
        return tl::unexpected(size.error());
    Intrinsics fallback{kNotSaid, kNotSaid, 0, 0, 1, 1};
    if (o.fx || o.fov_x) {
        fallback = pinhole_from_fov(o.fov_x.value_or(90), size->width, size->height);
        SR_CHECK(apply_options(o, fallback));
    } else if (is_file(folder_ / "intrinsics.json")) {
        SR_TRY(fallback, read_intrinsics_file(folder_ / "intrinsics.json"));
    } else if (size) {
        SR_TRY(const ImageSize color, first_color_size(folder_, *size));
        fallback.width = color.width;
        fallback.height = color.height;
    }
    SR_TRY(const std::optional<FoundPath> found, find_path(poses));
    CameraPath path;
    if (size || !found || found->format != PathFormat::transforms) {
        SR_TRY(path, read_camera_path(poses, fallback));
    } else {
        SR_TRY(path, read_transforms(found->path));
    }
    const Rigid before = path.frames[0].pose.world_to_camera;
    SR_CHECK(place_path(path, o.placement, quote_path(poses)));
    placed_ = compose(path.frames[0].pose.camera_to_world(), before);
    warnings_ = std::move(path.warnings);
    if (path.body)
        warnings_.push_back(body_text(quote_path(poses), *path.body));
    cameras_ = std::move(path.frames);
    for (size_t i = 0; i < cameras_.size(); ++i) {
        Intrinsics& k = cameras_[i].intrinsics;
        if (k.fx == kNotSaid)
            return fail(ErrorCode::bad_input,
                        "{} has no intrinsics: expected {}, or `fx` (and `fy`, `cx`, `cy`), or `fov_x`",
                        quote_path(poses), quote_path(folder_ / "intrinsics.json"));
        SR_CHECK(apply_options(o, k));
    }
    return {};
}

// by time, where the folder's pictures are named so and the path's are not
Status FusionFolder::find_frames(const Path& poses, const FusionFolderOptions& o)
{
    const bool named = poses.extension() == ".json" || !cameras_[0].picture.empty();
    SR_TRY(const bool by_time, named ? Result<bool>(false) : has_timed_pictures(folder_));
    if (!by_time) {
        SR_TRY(pictures_, find_pictures(folder_, poses, cameras_));
        return {};
    }
    SR_TRY(TimedFrames timed, find_timed_pictures(folder_, poses, cameras_));
    cameras_ = std::move(timed.cameras);
    pictures_ = std::move(timed.pictures);
    if (cameras_.size() < timed.depths)
        warnings_.push_back(fmt::format("{} of {} depth pictures have no pose, colour or label within {} s and are "
                                        "left out",
                                        timed.depths - cameras_.size(), timed.depths, kSameMoment));
    if (poses.filename() == "groundtruth.txt" && !o.depth.unit && pictures_[0].depth.extension() == ".png")
        warnings_.push_back("depth is read as millimetres; TUM RGB-D's own pictures have 5000 units a metre: "
                            "`depth.unit` 0.0002");
    return {};
}

std::string FusionFolder::name_of(size_t frame) const
{
    const std::string& camera = cameras_[frame].camera;
    return camera.empty() ? fmt::format("frame {}", frame) : fmt::format("frame {} ({})", frame, printable(camera));
}

Status FusionFolder::check_pictures()
{
    for (size_t i = 0; i < cameras_.size(); ++i) {
        FramePictures& p = pictures_[i];
        if (lidar_)
            p.depth.clear();
        for (const Path* path : {&p.depth, &p.label, &p.color, &p.used})
            if (!path->empty() && !is_file(*path))
                return fail(ErrorCode::bad_input, "{}: {} is missing", name_of(i), quote_path(*path));
        if (!lidar_)
            SR_CHECK(fit_intrinsics(i));
        const ImageSize depth = depth_size(i);
        for (const Path* path : {&p.label, &p.color, &p.used}) {
            if (path->empty() || is_jpeg(*path))
                continue;
            SR_TRY(const ImageSize size, number_image_size(*path));
            SR_CHECK(check_view(*path, size, depth));
        }
    }
    return {};
}

// intrinsics are of pictures of their own size, maybe of the colours: depth of another size has the same view
Status FusionFolder::fit_intrinsics(size_t frame)
{
    const Path& path = pictures_[frame].depth;
    Intrinsics& k = cameras_[frame].intrinsics;
    SR_TRY(const ImageSize size, number_image_size(path));
    const ImageSize said{k.width, k.height};
    if (size == said)
        return {};
    if (!same_view(size, said))
        return fail(ErrorCode::bad_input,
                    "{} is {} pixels, the camera has {}: expected the same view, of any number of pixels",
                    quote_path(path), text_of(size), text_of(said));
    if (!scaled_)
        warnings_.push_back(fmt::format("{}: intrinsics are of {} pixels, depth has {}: they are scaled to depth",
                                        name_of(frame), text_of(said), text_of(size)));
    scaled_ = true;
    k = scaled_to(k, size.width, size.height);
    return {};
}

// what is taken for granted about depth is said
Status FusionFolder::note_encoding()
{
    SR_TRY(const DepthImage depth, read_depth_image(pictures_[0].depth, encoding_));
    if (depth.kind == DepthKind::carla && !encoding_.kind)
        warnings_.push_back(fmt::format("{} is in 8-bit colour: read as CARLA's depth, R + 256 G + 65536 B of 1000 m / "
                                        "(2^24 - 1) (`depth.kind` carla)",
                                        quote_path(pictures_[0].depth)));
    return {};
}

// frames of equal lenses share what is known of these
void FusionFolder::find_views()
{
    std::vector<std::shared_ptr<const LensViews>> lenses;
    for (size_t i = 0; i < cameras_.size(); ++i) {
        const CameraFrame& camera = cameras_[i];
        if (camera.intrinsics.model == CameraModel::pinhole) {
            views_.push_back({i, nullptr});
            seen_.push_back(camera);
            continue;
        }
        auto lens = std::ranges::find_if(lenses, [&](const auto& l) { return l->lens() == camera.intrinsics; });
        if (lens == lenses.end())
            lens = lenses.insert(lens, std::make_shared<LensViews>(camera.intrinsics));
        for (const PinholeView& view : (*lens)->views()) {
            views_.push_back({i, *lens, size_t(&view - (*lens)->views().data())});
            seen_.push_back(camera);
            seen_.back().pose.world_to_camera = compose(view.from_sensor, camera.pose.world_to_camera);
            seen_.back().intrinsics = view.intrinsics;
        }
    }
}

ImageSize FusionFolder::depth_size(size_t frame) const
{
    return {cameras_[frame].intrinsics.width, cameras_[frame].intrinsics.height};
}

Status FusionFolder::check_labels()
{
    for (const FramePictures& p : pictures_)
        if (!p.label.empty()) {
            SR_TRY(const LabelImage labels, read_label_image(p.label));
            classes_.count(labels);
        }
    return classes_.check(quote_path(folder_));
}

size_t FusionFolder::labelled() const
{
    return size_t(std::ranges::count_if(pictures_, [](const FramePictures& p) { return !p.label.empty(); }));
}

size_t FusionFolder::colored() const
{
    return size_t(std::ranges::count_if(pictures_, [](const FramePictures& p) { return !p.color.empty(); }));
}

// the numbers of a picture beside a frame's depth, at its size
Result<std::vector<uint16_t>> FusionFolder::numbers_of(const Path& path, size_t frame) const
{
    SR_TRY(LabelImage image, read_label_image(path));
    SR_CHECK(check_view(path, image.size, depth_size(frame)));
    if (image.size != depth_size(frame))
        image.numbers = nearest_pixels(image.numbers, image.size, depth_size(frame));
    return std::move(image.numbers);
}

Status FusionFolder::load_labels(size_t frame, DepthImages& images) const
{
    SR_TRY(const std::vector<uint16_t> numbers, numbers_of(pictures_[frame].label, frame));
    images.labels.resize(numbers.size());
    for (size_t i = 0; i < images.labels.size(); ++i) {
        const uint8_t target = classes_[numbers[i]];
        if (target == kLeftOut)
            images.depth[i] = 0;
        images.labels[i] = target < kClassCount ? target : kNoLabel;
    }
    return {};
}

Status FusionFolder::load_colors(size_t frame, DepthImages& images) const
{
    const Path& path = pictures_[frame].color;
    SR_TRY(ImageRgb8 color, read_image_rgb8(path));
    const ImageSize size{color.width, color.height};
    SR_CHECK(check_view(path, size, depth_size(frame)));
    if (size != depth_size(frame))
        color = resampled(color, depth_size(frame));
    images.colors = std::move(color.pixels);
    return {};
}

Status FusionFolder::load_depth(size_t frame, Loaded& loaded) const
{
    const Path& path = pictures_[frame].depth;
    SR_TRY(DepthImage depth, read_depth_image(path, encoding_));
    if (depth.size != depth_size(frame))
        return fail(ErrorCode::bad_input, "{} changed its size", quote_path(path));
    const Intrinsics& k = cameras_[frame].intrinsics;
    loaded.radial = depth.kind == DepthKind::ray || Lens(k).radial_depth();
    if (loaded.radial && k.model == CameraModel::pinhole)
        make_axial(depth, k);
    loaded.images.depth = std::move(depth.metres);
    return {};
}

// depth becomes 0 where a pixel is not used
Status FusionFolder::mask_depth(size_t frame, DepthImages& images) const
{
    SR_TRY(const std::vector<uint16_t> used, numbers_of(pictures_[frame].used, frame));
    for (size_t i = 0; i < used.size(); ++i)
        images.depth[i] = used[i] ? images.depth[i] : 0;
    return {};
}

// colours and labels of a picture; depth becomes 0 where a pixel is left out
Status FusionFolder::load_picture(size_t frame, DepthImages& images) const
{
    if (!pictures_[frame].label.empty() && classes_.counted())
        SR_CHECK(load_labels(frame, images));
    if (!pictures_[frame].color.empty())
        SR_CHECK(load_colors(frame, images));
    return pictures_[frame].used.empty() ? Status() : mask_depth(frame, images);
}

Result<DepthImages> FusionFolder::load_view(const View& view) const
{
    Loaded& loaded = *loaded_;
    if (loaded.frame != view.frame) {
        loaded = {};
        SR_CHECK(load_depth(view.frame, loaded));
        SR_CHECK(load_picture(view.frame, loaded.images));
        loaded.frame = view.frame;
    }
    return view.lens ? view.lens->seen_by(view.number, loaded.images, loaded.radial) : loaded.images;
}

DepthFrames FusionFolder::frames() const
{
    if (!sweeps_)
        return {seen_, [this](size_t frame) { return load_view(views_[frame]); }};
    return {seen_, [this](size_t frame) {
                return sweeps_->load(frame, cameras_, [this](size_t picture) -> Result<DepthImages> {
                    const ImageSize size = depth_size(picture);
                    DepthImages images{std::vector(size_t(size.width) * size.height, 1.f), {}, {}};
                    SR_CHECK(load_picture(picture, images));
                    return images;
                });
            }};
}

} // namespace semrover
