// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/commands/convert.h"

#include "engine/format/labelled_points.h"
#include "engine/shards/shard_set.h"
#include "runtime/base/final_name.h"
#include "runtime/base/json.h"
#include "runtime/base/quote.h"
#include "tools/cli/print_stderr.h"
#include "tools/cli/value_options.h"
#include "tools/commands/scene_input.h"
#include "tools/trajectory/camera_path.h"

#include <algorithm>
#include <CLI/CLI.hpp>
#include <map>
#include <set>

namespace semrover {

namespace {

namespace fs = std::filesystem;

Result<PathFormat> output_format(const Path& out, const ConvertPathOptions& o)
{
    if (!o.format.empty())
        return path_format_of(o.format).value();
    const std::string name = out.filename().string(), stem = out.stem().string();
    if (out.extension() == ".json")
        return name.find("camera_path") == std::string::npos ? PathFormat::transforms : PathFormat::camera_path;
    if (out.extension() == ".tum")
        return PathFormat::tum;
    if (out.extension() == ".kitti" || name == "poses.txt" ||
        (out.extension() == ".txt" && std::ranges::all_of(stem, ::isdigit)))
        return PathFormat::kitti;
    if (!out.has_extension())
        return PathFormat::colmap;
    return fail(
        ErrorCode::usage,
        "{} does not show which format is meant: say it with --path-format, or write to .tum, poses.txt (KITTI), "
        "transforms.json, camera_path.json or a folder (COLMAP)",
        quote_path(out));
}

// where trainers look for pictures: beside sparse/0, else in the model's folder
Path images_folder(const Path& model)
{
    const Path parent = model.parent_path();
    if (model.filename() == "sparse")
        return parent / "images";
    return model.filename() == "0" && parent.filename() == "sparse" ? parent.parent_path() / "images"
                                                                    : model / "images";
}

Status check_output(const Path& in, const Path& out, const ConvertPathOptions& o, PathFormat format,
                    const Globals& globals)
{
    std::error_code ignored;
    if (fs::equivalent(in, out, ignored))
        return fail(ErrorCode::usage, "IN and OUT are the same, {}", quote_path(out));
    if (format == PathFormat::colmap)
        SR_CHECK(has_folder(out).map([](bool) {}));
    else if (is_folder(out))
        return fail(ErrorCode::bad_input, "{} is a folder, expected a file to write", quote_path(out));
    std::vector<Path> files{out};
    if (format == PathFormat::colmap)
        files = {out / "cameras.txt", out / "images.txt", out / "points3D.txt"};
    if (format == PathFormat::transforms && !o.points.empty())
        files.push_back(out.parent_path() / "points.ply");
    if (!o.images.empty())
        files.push_back(images_folder(out));
    if (format == PathFormat::kitti)
        files = {out, out.parent_path() / "times.txt", out.parent_path() / "calib.txt"};
    for (const Path& path : files)
        SR_CHECK(refuse_existing(path, globals.yes));
    return {};
}

// the frames that go into the file
Status choose_camera(CameraPath& path, const Path& in, const ConvertPathOptions& o, PathFormat format)
{
    std::set<std::string> names;
    for (const CameraFrame& frame : path.frames)
        names.insert(frame.camera);
    if (!o.camera.empty()) {
        std::erase_if(path.frames, [&](const CameraFrame& f) { return f.camera != o.camera; });
        if (path.frames.empty())
            return fail(ErrorCode::bad_input, "{} has no camera {}, only {}", quote_path(in), quote(o.camera),
                        fmt::join(names, ", "));
    } else if (names.size() > 1 && format != PathFormat::transforms && format != PathFormat::colmap) {
        return fail(ErrorCode::bad_input, "{} has the cameras {}; a {} file holds one, choose it with --camera",
                    quote_path(in), fmt::join(names, ", "), name_of(format));
    }
    return {};
}

// a picture that `render` or `refine` wrote
Result<Path> find_picture(const Path& folder, const std::string& camera, uint32_t number)
{
    const Path rendered = folder / picture_name(camera, "color", number);
    const Path refined = folder / "frames" / camera / fmt::format("{:06}.png", number);
    for (Path path : {rendered, refined})
        for (const char* extension : {".png", ".jpg"})
            if (is_file(path.replace_extension(extension)))
                return path;
    return fail(ErrorCode::bad_input, "--images: {} is missing, and so is {}", quote_path(rendered),
                quote_path(refined));
}

// Links, or copies where the file system has none. Also without folders: the first loader of 3DGS looks there. What the
// pictures' names end in
Result<std::string> link_images(const Path& model, const CameraPath& path, const Path& from)
{
    std::string extension;
    SR_TRY(const ShardsOrNone shards, open_if_shards(from));
    std::map<std::string, uint32_t> counts;
    for (const CameraFrame& f : path.frames)
        counts[f.camera] = 0;
    for (const CameraFrame& f : path.frames) {
        const uint32_t number = counts[f.camera]++;
        SR_TRY(const Path picture, find_picture(from, f.camera, number));
        const std::string own = picture.extension().string().substr(1);
        if (!extension.empty() && own != extension)
            return fail(ErrorCode::bad_input, "--images: {} is no .{} as those before it are", quote_path(picture),
                        extension);
        extension = own;
        const Path name = colmap_picture_name(f.camera, number, counts.size(), extension);
        for (const Path& to : {images_folder(model) / name, images_folder(model) / name.filename()}) {
            SR_CHECK(make_folder(to.parent_path()));
            std::error_code error;
            fs::remove(to, error);
            fs::create_hard_link(picture, to, error);
            if (error) {
                SR_TRY(const MappedFile bytes, MappedFile::open(picture));
                SR_CHECK(write_file_atomically(to, bytes.bytes()));
            }
        }
    }
    return extension;
}

Status write_with_points(const Path& out, const CameraPath& path, const ConvertPathOptions& o, PathFormat format,
                         const Globals& globals)
{
    if (format != PathFormat::colmap && format != PathFormat::transforms)
        return fail(ErrorCode::usage, "--points and --images: a {} file has no place for them", name_of(format));
    if (format != PathFormat::colmap && !o.images.empty())
        return fail(ErrorCode::usage, "--images: the pictures of a transforms.json lie beside it");
    Splats points;
    if (!o.points.empty()) {
        SR_TRY(const VoxelGrid grid, load_grid(o.points, {}, globals));
        points = labelled_points(grid);
    }
    if (format == PathFormat::transforms) {
        SR_CHECK(write_points_ply(out.parent_path() / "points.ply", points));
        return write_transforms(out, path, {{}, "points.ply"});
    }
    std::string extension = "png";
    if (!o.images.empty()) {
        SR_TRY(extension, link_images(out, path, o.images));
    }
    return write_colmap(out, path, points, extension);
}

Status write_output(const Path& out, const CameraPath& path, PathFormat format)
{
    switch (format) {
    case PathFormat::tum:
        return write_tum(out, path);
    case PathFormat::kitti:
        return write_kitti(out, path);
    case PathFormat::transforms:
        return write_transforms(out, path);
    case PathFormat::camera_path:
        return write_camera_path_json(out, path);
    default:
        break;
    }
    return write_colmap(out, path);
}

} // namespace

void add_path_options(CLI::App& c, ConvertPathOptions& o)
{
    add_choice(c, "--path-format", {"tum", "kitti", "transforms", "camera_path", "colmap"},
               "of a trajectory that is written; by default OUT's name decides", o.format);
    c.add_option("--camera", o.camera, "of a trajectory: only the frames of this camera");
    c.add_option("--rig", o.rig, "of a trajectory: every sensor of a rig.json at every pose");
    c.add_option(
        "--points", o.points,
        "of a trajectory: a grid whose points go along, to points3D.txt of COLMAP or, for nerfstudio, points.ply");
    c.add_option("--images", o.images,
                 "of a trajectory to COLMAP: a folder of `render` or `refine`, whose pictures get links in images/");
    add_lens_options(c, o.lens);
    add_placement_options(c, o.placement);
}

Result<bool> is_camera_path(const Path& path)
{
    const Path extension = path.extension();
    SR_TRY(const std::optional<FoundPath> found, find_path(path));
    return found || extension == ".tum" || extension == ".kitti" || (extension == ".json" && !is_there(path));
}

Status refuse_unknown_input(const Path& path)
{
    return refuse_unknown_path(path, "; or a scene (.sgrid, .npz, .label, .vox, .ply, .glb, .splat), boxes, or a "
                                     "network's weights (.safetensors, or a folder in the layout of diffusers)");
}

Status convert_path(const Path& in, const Path& out, const ConvertPathOptions& o, bool dry_run, const Globals& globals)
{
    const Path to = out.has_filename() ? out : out.parent_path(); // "sparse/"
    SR_TRY(const PathFormat format, output_format(to, o));
    SR_CHECK(check_output(in, to, o, format, globals));
    SR_TRY(const PathPlacement placement, placement_of(o.placement));
    SR_TRY(CameraPath path, read_cameras(in, o.rig, o.lens, placement));
    SR_CHECK(need_cameras(path, "convert"));
    SR_CHECK(choose_camera(path, in, o, format));
    const bool more = !o.points.empty() || !o.images.empty();
    if (!dry_run)
        SR_CHECK(more ? write_with_points(to, path, o, format, globals) : write_output(to, path, format));
    print_warnings(path.warnings, globals);
    if (globals.json)
        fmt::print("{}\n", json_text(Json{{"output", printable(to.string())},
                                          {"format", std::string(name_of(format))},
                                          {"frames", path.frames.size()}}));
    else if (!globals.quiet)
        fmt::print("{} frames as {}{}\n", path.frames.size(), name_of(format),
                   format == PathFormat::tum     ? ", without intrinsics"
                   : format != PathFormat::kitti ? ""
                   : has_kitti_calibration(path) ? ", with times.txt and calib.txt beside them"
                                                 : ", with times.txt beside them, without intrinsics");
    return {};
}

} // namespace semrover
