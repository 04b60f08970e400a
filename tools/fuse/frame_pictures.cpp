// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/fuse/frame_pictures.h"

#include "runtime/base/inner_path.h"
#include "runtime/base/json.h"
#include "runtime/base/quote.h"

#include <map>

namespace semrover {

namespace {

// what a picture is called in the folder `kind` beside its own; of one that lies in no folder, in the folder itself
Path sibling(const Path& folder, const Path& picture, const char* kind)
{
    const Path parent = picture.parent_path();
    return (parent == folder ? folder : parent.parent_path()) / kind / (picture.stem().string() + ".png");
}

// pictures of a kind that a camera's folder has; none of a kind that has no folder
Path optional_picture(const Path& picture)
{
    return is_folder(picture.parent_path()) ? with_ending(picture) : Path();
}

// the names that transforms.json gives, or numbers
class NumberedPictures {
  public:
    NumberedPictures(const Path& folder, const Path& poses) : folder_(folder), poses_(poses) {}

    Status open()
    {
        if (poses_.extension() != ".json")
            return {};
        SR_TRY(const Json file, read_json(poses_));
        frames_ = file.is_object() ? file.value("frames", Json()) : Json();
        return {};
    }

    Result<FramePictures> next(size_t index, const std::string& camera)
    {
        const Path base = camera.empty() ? folder_ : folder_ / camera;
        Path picture = base / "color" / fmt::format("{:06}.png", counts_[camera]++);
        SR_CHECK(named(index, "file_path", picture));
        FramePictures p{sibling(folder_, picture, "depth"), sibling(folder_, picture, "label"),
                        optional_picture(picture)};
        SR_CHECK(named(index, "depth_file_path", p.depth));
        SR_CHECK(named(index, "label_file_path", p.label));
        p.depth = with_ending(p.depth);
        p.label = optional_picture(p.label);
        return p;
    }

  private:
    Status named(size_t index, const char* key, Path& path) const
    {
        const Json* frame =
            frames_.is_array() && index < frames_.size() && frames_[index].is_object() ? &frames_[index] : nullptr;
        if (frame && frame->contains(key)) {
            const std::string where = fmt::format("{} frame {}: {}", quote_path(poses_), index, key);
            const Json& name = (*frame)[key];
            if (!name.is_string())
                return fail(ErrorCode::bad_input, "{}: expected a text, found {}", where, name.type_name());
            SR_TRY(path, path_inside(folder_, name.get_ref<const std::string&>(), where));
        }
        return {};
    }

    const Path &folder_, &poses_;
    Json frames_;
    std::map<std::string, uint32_t> counts_;
};

// COLMAP's picture FOLDERS/NAME is beside depth/, or depth/ has the same folders; of ScanNet's 0 it has 0.png
Result<FramePictures> pictures_of_name(const Path& folder, const CameraFrame& frame)
{
    SR_TRY(const Path picture, path_inside(folder, frame.picture, "the name of a picture"));
    const Path relative = picture.lexically_relative(folder);
    const auto found = [&](const char* kind) {
        const Path below = with_ending(folder / kind / relative);
        const Path of_camera = with_ending(folder / frame.camera / kind / relative.filename());
        const Path beside = with_ending(sibling(folder, picture, kind));
        return is_file(below) ? below : is_file(of_camera) ? of_camera : beside;
    };
    FramePictures p{found("depth"), found("label"), {}};
    for (const char* kind : {".geometric.bin", ".photometric.bin"}) // of COLMAP's dense reconstruction
        if (const Path map = folder / kDepthMaps / (relative.string() + kind); !is_file(p.depth) && is_file(map))
            p.depth = map;
    p.label = optional_picture(p.label);
    for (const Path& color : {picture, folder / "images" / relative, folder / "rgb" / relative, found("color")})
        if (p.color.empty() && is_file(with_ending(color)))
            p.color = with_ending(color);
    if (p.color.empty())
        p.color = optional_picture(found("color"));
    return p;
}

// pictures that are numbered must be as many as poses, else they were paired wrongly
Status check_count(const std::vector<FramePictures>& pictures, const Path& poses)
{
    std::map<Path, size_t> used;
    for (const FramePictures& p : pictures)
        if (p.depth.stem().string().size() == 6)
            ++used[p.depth.parent_path()];
    for (const auto& [folder, frames] : used) {
        if (!is_there(folder))
            continue;
        SR_TRY(const std::vector<Path> files, list_files(folder));
        const size_t found = size_t(std::ranges::count_if(
            files, [](const Path& path) { return path.extension() == ".png" || path.extension() == ".npy"; }));
        if (found > frames)
            return fail(ErrorCode::bad_input, "{} holds {} pictures, {} has {} poses", quote_path(folder), found,
                        quote_path(poses), frames);
    }
    return {};
}

} // namespace

Result<Path> path_inside(const Path& folder, std::string_view text, std::string_view where)
{
    if (!leads_inside(text))
        return fail(ErrorCode::bad_input, "{}: expected a path inside the folder, found {}", where, quote(text));
    return folder / Path(text).lexically_normal();
}

Path with_ending(Path picture)
{
    if (is_file(picture))
        return picture;
    for (const std::string_view ending : kPictureEndings)
        if (Path other = picture; is_file(other.replace_extension(ending)))
            return other;
    return picture;
}

Result<std::vector<FramePictures>> find_pictures(const Path& folder, const Path& poses,
                                                 const std::vector<CameraFrame>& cameras)
{
    NumberedPictures numbered(folder, poses);
    SR_CHECK(numbered.open());
    std::vector<FramePictures> pictures;
    bool named = poses.extension() == ".json";
    for (size_t i = 0; i < cameras.size(); ++i) {
        named = named || !cameras[i].picture.empty();
        SR_TRY(FramePictures p,
               cameras[i].picture.empty() ? numbered.next(i, cameras[i].camera) : pictures_of_name(folder, cameras[i]));
        if (!p.color.empty())
            p.used = optional_picture(sibling(folder, p.color, "used"));
        pictures.push_back(std::move(p));
    }
    if (!named)
        SR_CHECK(check_count(pictures, poses));
    return pictures;
}

} // namespace semrover
