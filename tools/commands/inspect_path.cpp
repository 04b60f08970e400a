// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/commands/inspect_path.h"

#include "engine/camera/camera_view.h"
#include "engine/job/empty_frames.h"
#include "runtime/base/quote.h"
#include "tools/trajectory/path_format.h"

#include <algorithm>
#include <cmath>
#include <set>

namespace semrover {

namespace {

constexpr double kNearMetres = 10;         // from the box around the scene
constexpr size_t kMostProjections = 1e8;   // of places of the scene into frames, in all
constexpr double kOtherFrameMetres = 1000; // an offset of maps, not a drive out of the grid

double distance_to(const Bounds& box, const Point3& p)
{
    double square = 0;
    for (size_t axis = 0; axis < 3; ++axis) {
        const double outside = std::max({box.low[axis] - p[axis], p[axis] - box.high[axis], 0.0});
        square += outside * outside;
    }
    return std::sqrt(square);
}

// places of the scene, evenly chosen so that all frames can be asked
std::vector<Point3> places_of(const SceneInput& scene, size_t frames)
{
    const size_t count = scene.grid ? scene.grid->cells.size() : scene.splats->position.size();
    const size_t step = std::max<size_t>(1, count / std::max<size_t>(1, kMostProjections / frames));
    std::vector<Point3> places;
    for (size_t i = 0; i < count; i += step) {
        Point3 p;
        for (size_t axis = 0; axis < 3; ++axis)
            p[axis] = scene.grid ? (scene.grid->cells[i][axis] + 0.5) * scene.grid->voxel_size
                                 : double(scene.splats->position[i][axis]);
        places.push_back(p);
    }
    return places;
}

bool looks_at(const CameraFrame& frame, const std::vector<Point3>& places)
{
    return std::ranges::any_of(places, [&](const Point3& place) {
        const auto pixel = project(frame, place);
        return pixel && pixel->depth > 0 && pixel->x >= 0 && pixel->y >= 0 && pixel->x < frame.intrinsics.width &&
               pixel->y < frame.intrinsics.height;
    });
}

struct Meeting {
    size_t inside = 0, near = 0, looking = 0;
};
Meeting meeting_of(const CameraPath& path, const SceneInput& scene, const Bounds& box)
{
    const std::vector<Point3> places = places_of(scene, path.frames.size());
    Meeting m;
    for (const CameraFrame& frame : path.frames) {
        const double distance = distance_to(box, translation_of(frame.pose.camera_to_world()));
        m.inside += distance == 0;
        m.near += distance <= kNearMetres;
        m.looking += looks_at(frame, places);
    }
    return m;
}

// of no frame that looks at the scene
std::string advice(const Path& name, const CameraPath& path, const SceneInput& scene, const Meeting& m)
{
    const auto found = find_path(name).value_or(std::nullopt);
    if (found && found->format == PathFormat::kitti && scene.format == SceneFormat::semantickitti)
        return "--calib CALIB.TXT: KITTI's poses are the camera's, its voxels lie in the lidar's frame (of frame N: "
               "also "
               "--relative-to N)";
    const Bounds box = scene.grid ? bounds_of(*scene.grid) : bounds_of(*scene.splats);
    const Point3 first = translation_of(path.frames.front().pose.camera_to_world());
    if (distance_to(box, first) > kOtherFrameMetres)
        return fmt::format("--relative-to first where the scene lies in the frame of the first pose, or --path-origin="
                           "{:.10g},{:.10g},{:.10g} where only the origin differs; --world takes any matrix",
                           std::round(-first[0]) + 0.0, std::round(-first[1]) + 0.0, std::round(-first[2]) + 0.0);
    if (m.inside)
        return "other axes: the poses may be a vehicle's (--rig with path_axes vehicle), or the world's axes others "
               "(--world)";
    return "--relative-to FRAME where the scene lies in the frame of a pose; --world and --path-origin move the path";
}

} // namespace

Report metres(const Point3& position)
{
    Report list = Report::array();
    for (const double c : position)
        list.push_back(std::round(c * 1e4) / 1e4);
    return list;
}

Report describe_path(const Path& name, const CameraPath& path)
{
    const auto found = find_path(name).value_or(std::nullopt);
    std::set<std::string> cameras;
    for (const CameraFrame& frame : path.frames)
        if (!frame.camera.empty())
            cameras.insert(frame.camera);
    const Bounds extent = bounds_of(path);
    const Intrinsics& k = path.frames.front().intrinsics;
    Report report = {{"camera_path", name.string()}};
    report["format"] = found ? name_of(found->format) : "";
    report["frames"] = path.frames.size();
    if (!cameras.empty())
        report["cameras"] = cameras;
    report["poses"] = path.body ? "of " + path.body->name : "of a camera (x right, y down, z forward)";
    report[path.numbered ? "numbers" : "times"] = {path.frames.front().time, path.frames.back().time};
    report["lens"] = {{"model", std::string(name_of(k.model))}, {"size", {k.width, k.height}}, {"focal", {k.fx, k.fy}}};
    report["extent"] = {{"min_m", metres(extent.low)}, {"max_m", metres(extent.high)}};
    for (const std::string& warning : path.warnings)
        report["warnings"].push_back({{"warning", warning}});
    return report;
}

Report describe_meeting(const Path& name, const CameraPath& path, const SceneInput& scene)
{
    const Bounds box = scene.grid ? bounds_of(*scene.grid) : bounds_of(*scene.splats);
    const Meeting m = meeting_of(path, scene, box);
    Report report = {{"scene_lies_in", extent_text(box)},
                     {"cameras_lie_in", extent_text(bounds_of(path))},
                     {"frames", path.frames.size()},
                     {"frames_inside", m.inside},
                     {"frames_near", m.near},
                     {"frames_that_look_at_it", m.looking}};
    report["meet"] = m.looking == path.frames.size() ? "yes" : m.looking ? "in part" : "no";
    if (m.looking == 0)
        report["try"] = advice(name, path, scene, m);
    return report;
}

} // namespace semrover
