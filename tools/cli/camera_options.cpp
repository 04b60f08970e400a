// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/cli/camera_options.h"

#include "engine/camera/rig.h"
#include "runtime/base/json.h"
#include "runtime/base/quote.h"
#include "tools/cli/value_options.h"
#include "tools/dataset/rigid_file.h"
#include "tools/trajectory/camera_path.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>

namespace semrover {

namespace {

// numbers with commas between them
Result<std::vector<double>> numbers_in(std::string_view text)
{
    std::vector<double> numbers;
    for (const char *at = text.data(), *end = at + text.size(); at < end;) {
        double value = 0;
        const auto [next, error] = std::from_chars(at, end, value);
        if (error != std::errc() || !std::isfinite(value) || (next < end && (*next != ',' || next + 1 == end)))
            return fail(ErrorCode::usage, "--distortion takes numbers with commas between them, not {}", quote(text));
        numbers.push_back(value);
        at = next + (next < end);
    }
    return numbers;
}

Status put_distortion(const LensOptions& o, Intrinsics& k)
{
    if (o.distortion.empty())
        return {};
    SR_TRY(const std::vector<double> values, numbers_in(o.distortion));
    const size_t n = values.size();
    if (!(k.model == CameraModel::opencv && (n == 4 || n == 5 || n == 8 || n == 12)) &&
        !(k.model == CameraModel::fisheye && n == 4))
        return fail(
            ErrorCode::usage,
            "--distortion takes k1,k2,p1,p2[,k3[,k4,k5,k6[,s1,s2,s3,s4]]] of --camera-model opencv or k1,k2,k3,k4 of "
            "fisheye, not {} numbers of {}",
            n, name_of(k.model));
    std::ranges::copy(values, k.distortion.begin());
    return {};
}

// Whether the reader took the lens of the options: another one is the path's own.
bool takes_lens(const CameraFrame& frame, const Intrinsics& lens)
{
    const Intrinsics &k = frame.intrinsics, expected = scaled_to(lens, k.width, k.height);
    return k.model == lens.model && k.distortion == lens.distortion && std::abs(k.fx - expected.fx) <= 1e-9 * k.fx;
}

Status refuse_lens(const LensOptions& o, std::string_view whose)
{
    if (!o.lens_given && o.distortion.empty())
        return {};
    return fail(
        ErrorCode::usage,
        "{} has lenses of its own: --fov-x, --camera-model and --distortion mean nothing (-W and -H scale them)",
        whose);
}

Status scale(Intrinsics& k, const LensOptions& o)
{
    const double shape = double(k.height) / k.width;
    const double width = o.width_given ? o.width : o.height / shape, height = o.height_given ? o.height : width * shape;
    const uint32_t w = uint32_t(std::max(1.0, std::round(width))), h = uint32_t(std::max(1.0, std::round(height)));
    if (w == k.width && h == k.height)
        return {};
    k = scaled_to(k, w, h);
    if (const Status status = check_intrinsics(k, "-W and -H"); !status)
        return fail(ErrorCode::usage, "{}", status.error().message);
    return {};
}

Result<Rigid> world_option(const std::string& text)
{
    if (is_file(text))
        return read_rigid(text);
    if (text.find(',') == std::string::npos && text.find(' ') == std::string::npos)
        return fail(ErrorCode::bad_input,
                    "--world: there is no file {}; it takes one, or 12 or 16 numbers with commas "
                    "between them",
                    quote(text));
    return parse_rigid(text, "--world");
}

Result<uint64_t> frame_option(const std::string& text)
{
    if (text == "first")
        return PathPlacement::kFirst;
    const auto number = parse_number<uint64_t>(text, {0, 1ull << 53});
    if (!number)
        return fail(ErrorCode::usage, "--relative-to takes first or the number of a frame, not {}", quote(text, 60));
    return *number;
}

const std::vector<std::string> kDepthKinds = {"z", "ray", "carla"}; // as DepthKind

} // namespace

void add_lens_options(CLI::App& c, LensOptions& o)
{
    const auto set = [&o](auto& to, bool& given) {
        return [&o, &to, &given](auto value) {
            to = value;
            given = true;
            o.size_given = o.width_given || o.height_given;
        };
    };
    add_number_function<uint32_t>(c, "-W,--width", set(o.width, o.width_given),
                                  "pixels; cameras of a path or rig are scaled to it", {1, 16384});
    add_number_function<uint32_t>(c, "-H,--height", set(o.height, o.height_given),
                                  "pixels; with one of both, theirs keep their shape", {1, 16384});
    add_number_function<double>(c, "--fov-x",
                                [&o](double degrees) {
                                    o.fov = degrees;
                                    o.view_given = o.lens_given = true;
                                },
                                "horizontal field of view in degrees, where the path has no intrinsics; 73",
                                {1.0, 360.0});
    add_choice(c, "--camera-model", {"pinhole", "opencv", "fisheye", "equirectangular"},
               "lens, where the path has no intrinsics",
               [set = set(o.camera_model, o.lens_given)](const std::string& model) { set(model); });
    c.add_option("--distortion", o.distortion,
                 "k1,k2,p1,p2[,k3[,k4,k5,k6[,s1,s2,s3,s4]]] of opencv, k1,k2,k3,k4 of fisheye");
}

std::span<const std::string_view> lens_options()
{
    static constexpr std::array<std::string_view, 5> kNames = {"--width", "--height", "--fov-x", "--camera-model",
                                                               "--distortion"};
    return kNames;
}

Result<Intrinsics> intrinsics_of(const LensOptions& o)
{
    const CameraModel model = camera_model_of(o.camera_model).value_or(CameraModel::pinhole);
    const bool plane = model == CameraModel::pinhole || model == CameraModel::opencv;
    if (plane && o.fov > 170)
        return fail(ErrorCode::usage, "--fov-x of {} degrees: a {} camera sees at most 170", o.fov, name_of(model));
    Intrinsics k = plane                           ? pinhole_from_fov(o.fov, o.width, o.height)
                   : model == CameraModel::fisheye ? fisheye_from_fov(o.fov, o.width, o.height)
                                                   : whole_sphere(o.width, o.height);
    k.model = model;
    SR_CHECK(put_distortion(o, k));
    if (const Status status = check_intrinsics(k, "--distortion"); !status)
        return fail(ErrorCode::usage, "{}", status.error().message);
    return simplified(k);
}

Result<PathLens> path_lens_of(const LensOptions& o)
{
    SR_TRY(const Intrinsics intrinsics, intrinsics_of(o));
    return PathLens(intrinsics, o.size_given, o.view_given || intrinsics.model == CameraModel::equirectangular);
}

Result<CameraPath> read_cameras(const Path& file, const Path& rig_file, const LensOptions& o,
                                const PathPlacement& placement)
{
    SR_TRY(PathLens lens, path_lens_of(o));
    lens.matters = rig_file.empty();
    SR_TRY(CameraPath path, read_camera_path(file, lens, placement));
    if (path.body && rig_file.empty())
        path.warnings.push_back(body_text(quote_path(file), *path.body));
    const auto own = [&](const CameraFrame& f) { return !takes_lens(f, lens.intrinsics); };
    if (!rig_file.empty()) {
        SR_CHECK(refuse_lens(o, quote_path(rig_file)));
        SR_TRY(const Rig rig, read_rig(rig_file));
        SR_TRY(path, expand_rig(rig, path));
    } else if (std::ranges::any_of(path.frames, own)) {
        SR_CHECK(refuse_lens(o, quote_path(file)));
    } else if (path.frames[0].intrinsics.width == o.width && path.frames[0].intrinsics.height == o.height) {
        return path; // it has no size of its own either
    }
    if (!o.size_given)
        return path;
    for (CameraFrame& frame : path.frames)
        SR_CHECK(scale(frame.intrinsics, o));
    for (Sensor& sensor : path.sensors)
        SR_CHECK(scale(sensor.intrinsics, o));
    return path;
}

Status need_cameras(const CameraPath& path, std::string_view what)
{
    if (path.frames.empty())
        return fail(ErrorCode::usage, "{} needs cameras, and the sensors of the rig are lidars", what);
    return {};
}

void add_placement_options(CLI::App& c, PathOptions& o)
{
    const std::string group = "Where the trajectory lies in the grid's world, in the order that they apply";
    c.add_option(
         "--relative-to", o.relative_to,
         "first or FRAME: poses relative to that frame's, for a grid in its frame. FRAME is the number that the "
         "file gives it, else counted from 0")
        ->group(group);
    if (!c.get_option_no_throw("--calib"))
        c.add_option(
             "--calib", o.calibration,
             "KITTI's calib.txt: its camera's poses become the lidar's (Tr), for a grid in the lidar's frame; of "
             "the first frame without --relative-to")
            ->group(group);
    c.add_option("--world", o.world,
                 "the path's world to the grid's: 12 or 16 numbers, row-major, with commas between them, or a file of "
                 "them (text, .json, .npy)")
        ->group(group);
    c.add_option(c.get_option_no_throw("--origin") ? "--path-origin" : "--path-origin,--origin", o.origin,
                 "X,Y,Z: where the path's origin lies in the grid's world, metres; it is added to positions")
        ->group(group);
}

std::span<const std::string_view> placement_options()
{
    static constexpr std::array<std::string_view, 4> kNames = {"--relative-to", "--calib", "--world", "--path-origin"};
    return kNames;
}

nlohmann::json json_of(const PathOptions& o)
{
    nlohmann::json json = nlohmann::json::object();
    for (const auto& [name, text] : {std::pair{"relative_to", &o.relative_to},
                                     {"calib", &o.calibration},
                                     {"world", &o.world},
                                     {"origin", &o.origin}})
        if (!text->empty())
            json[name] = *text;
    return json;
}

Result<PathPlacement> placement_of(const PathOptions& o)
{
    PathPlacement placement;
    if (!o.relative_to.empty()) {
        SR_TRY(placement.relative_to, frame_option(o.relative_to));
    }
    if (!o.calibration.empty()) {
        SR_TRY(placement.lidar_to_camera, read_kitti_lidar(o.calibration));
    }
    if (!o.world.empty()) {
        SR_TRY(placement.world, world_option(o.world));
    }
    SR_TRY(placement.origin, origin_from(o.origin));
    return placement;
}

void add_origin(CLI::App& command, std::string& text)
{
    command.add_option("--origin", text, "X,Y,Z: where the input's origin lies in the world, metres");
}

Result<std::array<double, 3>> origin_from(const std::string& text)
{
    std::array<double, 3> origin{};
    int used = 0;
    if (text.empty())
        return origin;
    if (std::sscanf(text.c_str(), "%lf,%lf,%lf%n", &origin[0], &origin[1], &origin[2], &used) != 3 ||
        size_t(used) != text.size() || !std::isfinite(origin[0] + origin[1] + origin[2]))
        return fail(ErrorCode::usage, "--origin takes X,Y,Z in metres, not {}", quote(text, 60));
    return origin;
}

std::string_view name_of(std::optional<DepthKind> kind)
{
    return kind ? std::string_view(kDepthKinds[size_t(*kind)]) : "auto";
}

void add_depth_options(CLI::App& command, DepthEncoding& e, const std::string& of)
{
    const std::string kind = "--" + of + "-kind", scale = "--" + of + "-scale";
    add_choice(command, kind.c_str(), kDepthKinds,
               "depth along the axis (z), from the camera along each ray (Hypersim, Unreal, Blender), or CARLA's 24 "
               "bits; carla for 8-bit colour pictures, else z",
               [&e](const std::string& word) {
                   e.kind = DepthKind(std::ranges::find(kDepthKinds, word) - kDepthKinds.begin());
               });
    add_number(
        command, scale, e.unit,
        "metres of one unit of depth; what transforms.json says, else 0.001 (TUM RGB-D: 0.0002, KITTI: 0.00390625), of "
        "fractions in .npy 1",
        1e-6, 10.0);
}

} // namespace semrover
