// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/convert_path.h"

#include "engine/camera/rig.h"
#include "engine/format/camera_path.h"
#include "runtime/base/json.h"
#include "runtime/base/quote.h"
#include "tools/cli/choice.h"
#include "tools/cli/warnings.h"

#include <algorithm>
#include <CLI/CLI.hpp>
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
        "{} does not tell which format is meant: say it with --path-format, or write to .tum, poses.txt (KITTI), "
        "transforms.json, camera_path.json or a folder (COLMAP)",
        quote_path(out));
}

Status check_output(const Path& in, const Path& out, PathFormat format, const Globals& globals)
{
    std::error_code ignored;
    if (fs::equivalent(in, out, ignored))
        return fail(ErrorCode::usage, "IN and OUT are the same, {}", quote_path(out));
    const bool folder = fs::is_directory(out, ignored);
    if (format == PathFormat::colmap && is_there(out) && !folder)
        return fail(ErrorCode::bad_input, "{} is a file; COLMAP's model is a folder", quote_path(out));
    if (format != PathFormat::colmap && folder)
        return fail(ErrorCode::bad_input, "{} is a folder, expected a file to write", quote_path(out));
    std::vector<Path> files{out};
    if (format == PathFormat::colmap)
        files = {out / "cameras.txt", out / "images.txt"};
    if (format == PathFormat::kitti)
        files = {out, out.parent_path() / "times.txt", out.parent_path() / "calib.txt"};
    for (const Path& path : files)
        if (is_there(path) && !globals.yes)
            return fail(ErrorCode::usage, "{} exists; -y replaces it", quote_path(path));
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

Result<CameraPath> read_input(const Path& in, const ConvertPathOptions& o)
{
    SR_TRY(PathLens lens, path_lens_of(o.lens));
    lens.matters = o.rig.empty();
    SR_TRY(const PathPlacement placement, placement_of(o.placement));
    SR_TRY(CameraPath path, read_camera_path(in, lens, placement));
    if (path.body && o.rig.empty())
        path.warnings.push_back(body_text(quote_path(in), *path.body));
    if (o.rig.empty())
        return path;
    SR_TRY(const Rig rig, read_rig(o.rig));
    return expand_rig(rig, path);
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
               "of a camera path that is written; by default OUT's name tells", o.format);
    c.add_option("--camera", o.camera, "of a camera path: only the frames of this camera");
    c.add_option("--rig", o.rig, "of a camera path: every sensor of a rig.json at every pose");
    add_lens_options(c, o.lens);
    add_placement_options(c, o.placement);
}

bool is_camera_path(const Path& path)
{
    const Path extension = path.extension();
    return find_path(path) || extension == ".tum" || extension == ".kitti" || (extension == ".json" && !is_there(path));
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
    SR_CHECK(check_output(in, to, format, globals));
    SR_TRY(CameraPath path, read_input(in, o));
    SR_CHECK(choose_camera(path, in, o, format));
    if (!dry_run)
        SR_CHECK(write_output(to, path, format));
    print_warnings(path.warnings, globals);
    if (globals.json)
        fmt::print("{}\n", Json{{"output", printable(to.string())},
                                {"format", std::string(name_of(format))},
                                {"frames", path.frames.size()}}
                               .dump());
    else if (!globals.quiet)
        fmt::print("{} frames as {}{}\n", path.frames.size(), name_of(format),
                   format == PathFormat::tum     ? ", without intrinsics"
                   : format != PathFormat::kitti ? ""
                   : has_kitti_calibration(path) ? ", with times.txt and calib.txt beside them"
                                                 : ", with times.txt beside them, without intrinsics");
    return {};
}

} // namespace semrover
