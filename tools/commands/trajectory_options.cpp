// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/commands/trajectory_options.h"

#include "runtime/base/quote.h"
#include "tools/cli/value_options.h"
#include "tools/trajectory/camera_path.h"

#include <CLI/CLI.hpp>

namespace semrover {

namespace {

Result<std::array<uint8_t, 3>> background_of(const TrajectoryOptions& o)
{
    unsigned r, g, b;
    int used = 0;
    if (std::sscanf(o.background.c_str(), "%u,%u,%u%n", &r, &g, &b, &used) != 3 ||
        size_t(used) != o.background.size() || r > 255 || g > 255 || b > 255)
        return fail(ErrorCode::usage, "--background takes R,G,B in 0..255, not '{}'", o.background);
    return std::array<uint8_t, 3>{uint8_t(r), uint8_t(g), uint8_t(b)};
}

bool is_of_object(const Actor& actor)
{
    return std::holds_alternative<ObjectOfScene>(actor.from);
}

// a file, or the one beside the grid
Result<std::vector<SceneObject>> objects_of(const Path& file, const Path& grid)
{
    const Path path = file.empty() ? objects_beside(grid) : file;
    if (file.empty() && !is_there(path))
        return fail(
            ErrorCode::usage,
            "{} is not there, which --instances, --boxes and actors need; --objects names another file, and `semrover "
            "convert {} NAME.objects.json -m MODEL` guesses them of the labels",
            quote_path(path), quote_path(grid));
    return read_objects(path);
}

} // namespace

void add_trajectory_options(CLI::App& c, TrajectoryOptions& o)
{
    c.add_option("--path", o.path,
                 "trajectory: TUM, KITTI, KITTI-360, transforms.json, camera_path.json, COLMAP's folder and others "
                 "(docs/formats.md §7.1)");
    add_lens_options(c, o);
    add_placement_options(c, o.placement);
    c.add_flag("--allow-empty", o.allow_empty, "it is no error if no frame sees anything of the scene");
    c.add_flag("--equirect", o.equirect, "panoramas of W x W/2 in place of the path's cameras");
    c.add_option("--rig", o.rig, "rig.json: every sensor at every pose, in folders of their names");
    c.add_option(
        "--splat-radius", o.splat_radius,
        "standard deviation of a splat in metres (0.04, or what the renderer says), or auto: from the spacing of "
        "the points");
    add_number(c, "--opacity", o.opacity, "of every splat", 0.01f, 1.f);
    add_number(c, "--visible-alpha", o.visible_alpha, "alpha from which a pixel counts as visible", 0.f, 1.f);
    add_number(c, "--screen-filter", o.screen_variance,
               "variance in pixels^2 of the dot that each splat is at least; less: sharper borders", 0.f, 10.f);
    c.add_option("--background", o.background, "R,G,B behind the splats");
    c.add_flag("--instances", o.instances, "also pictures of which object a pixel shows: instance/000000.png");
    c.add_flag(
        "--boxes", o.boxes,
        "with --instances, also boxes.jsonl: where each object is, what pictures show of it, how much is hidden");
    c.add_option("--actors", o.actors, "actors.json: what moves (docs/formats.md §2.10)");
    c.add_option(
        "--objects", o.objects,
        "the scene's objects, for --instances, --boxes and --actors; NAME.objects.json beside the grid by default");
}

Result<PointSplatOptions> point_splat_options(const std::string& splat_radius, float opacity)
{
    PointSplatOptions s;
    s.opacity = opacity;
    s.auto_sigma = splat_radius == "auto";
    if (s.auto_sigma || splat_radius.empty())
        return s;
    char* end = nullptr;
    s.sigma = std::strtof(splat_radius.c_str(), &end);
    if (*end || !(s.sigma > 0 && s.sigma < 100))
        return fail(ErrorCode::usage, "--splat-radius takes metres (0..100) or auto, not '{}'", splat_radius);
    return s;
}

Result<DrawOptions> draw_options(const TrajectoryOptions& o, const Path& grid)
{
    DrawOptions draw;
    draw.visible_alpha = o.visible_alpha;
    draw.screen_variance = o.screen_variance;
    SR_TRY(draw.splats, point_splat_options(o.splat_radius, o.opacity));
    SR_CHECK(intrinsics_of(o).map([](const auto&) {}));
    if (o.path.empty() && o.placement.any())
        return fail(ErrorCode::usage, "--relative-to, --calib, --world and --path-origin are of a trajectory: --path");
    if (o.equirect && !o.rig.empty())
        return fail(ErrorCode::usage, "--equirect or --rig; a rig.json may have an equirectangular sensor");
    if (o.equirect && o.width % 2)
        return fail(ErrorCode::usage, "--equirect draws W x W/2 pixels, and {} is odd", o.width);
    SR_TRY(draw.background, background_of(o));
    draw.instances = o.instances || o.boxes;
    draw.boxes = o.boxes;
    if (!o.actors.empty()) {
        SR_TRY(draw.actors, read_actors(o.actors));
    }
    const bool needs_objects = draw.instances || std::ranges::any_of(draw.actors, is_of_object);
    if (!needs_objects && !o.objects.empty())
        return fail(ErrorCode::usage, "--objects is for --instances, --boxes and --actors that are made of objects");
    if (needs_objects) {
        SR_TRY(draw.objects, objects_of(o.objects, grid));
    }
    return draw;
}

Result<CameraPath> load_cameras(const TrajectoryOptions& o)
{
    SR_TRY(const PathPlacement placement, placement_of(o.placement));
    if (!o.equirect)
        return read_cameras(o.path, o.rig, o, placement);
    SR_TRY(PathLens lens, path_lens_of(o));
    lens.matters = false;
    SR_TRY(CameraPath path, read_camera_path(o.path, lens, placement));
    if (path.body)
        path.warnings.push_back(body_text(quote_path(o.path), *path.body));
    for (CameraFrame& frame : path.frames)
        frame.intrinsics = whole_sphere(o.width, o.width / 2);
    return path;
}

} // namespace semrover
