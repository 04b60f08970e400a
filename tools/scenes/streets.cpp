// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover streets -o DIR: makes up a street: a textured, labelled mesh, its grids, a drive, and with --images pictures
#include "engine/conditioning/cell_objects.h"
#include "engine/mesh/mesh_files.h"
#include "engine/scene/palette.h"
#include "runtime/base/json.h"
#include "tools/cli/commands.h"
#include "tools/cli/open_device.h"
#include "tools/cli/output_folder.h"
#include "tools/cli/progress.h"
#include "tools/cli/value_options.h"
#include "tools/scenes/placement_option.h"
#include "tools/streets/ground_objects.h"
#include "tools/streets/street.h"
#include "tools/streets/street_grid.h"
#include "tools/trace/tracer.h"

#include <CLI/CLI.hpp>
#include <cmath>
#include <numbers>
#include <optional>

namespace semrover {

namespace {

struct StreetImages {
    uint32_t width = 616, height = 424;
    uint32_t samples = 4, ambient_rays = 2;
    std::optional<double> sun_azimuth, sun_elevation; // degrees, as in Daylight
    std::optional<double> cloud_cover;                // 0..1
};

constexpr double kReach = 260;          // metres that a picture shows
constexpr size_t kWholeScene = 1500000; // faces up to which the street is traced in one piece
constexpr double kStretch = 80;         // metres of drive that share a piece of a longer one

Daylight daylight(const StreetImages& images, uint64_t seed)
{
    constexpr double kDegree = std::numbers::pi / 180;
    Daylight d = daylight_of_seed(seed);
    if (images.sun_azimuth)
        d.sun_azimuth = *images.sun_azimuth * kDegree;
    if (images.sun_elevation)
        d.sun_elevation = *images.sun_elevation * kDegree;
    d.cloud_cover = images.cloud_cover.value_or(d.cloud_cover);
    return d;
}

double apart(const CameraFrame& a, const CameraFrame& b)
{
    const Point3 p = translation_of(a.pose.camera_to_world()), q = translation_of(b.pose.camera_to_world());
    return std::hypot(p[0] - q[0], p[1] - q[1]);
}

// what of a street is there at a moment, within a radius of a camera
std::vector<uint32_t> faces_around(const Street& street, const Mesh& mesh, const std::vector<bool>& absent,
                                   const CameraFrame& frame, double radius)
{
    const Point3 o = translation_of(frame.pose.camera_to_world());
    std::vector<uint32_t> faces;
    for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
        const auto& p = mesh.positions[mesh.faces[f][0]];
        const uint32_t owner = street.owners[f];
        const bool there = owner == 0 || absent.empty() || !absent[owner - 1];
        if (there && std::hypot(p[0] - o[0], p[1] - o[1]) < radius)
            faces.push_back(f);
    }
    return faces;
}

// What a street looks like at a moment; the mesh changes with time where there are actors.
class StreetMoments {
  public:
    StreetMoments(const Street& street, std::span<const Actor> actors) : street_(street), actors_(actors)
    {
        if (!actors.empty())
            moved_ = street.mesh;
    }

    // what cameras near this frame see, at its time; `whole`: all of it
    Result<DeviceTraceScene> scene(Device& device, const CameraFrame& frame, bool whole)
    {
        std::vector<bool> absent;
        if (!actors_.empty())
            absent = move_actors(moved_, street_, actors_, microseconds_of(frame.time));
        const Mesh& mesh = actors_.empty() ? street_.mesh : moved_;
        std::vector<uint32_t> faces;
        if (!whole || !actors_.empty())
            faces = faces_around(street_, mesh, absent, frame, whole ? INFINITY : kReach + kStretch);
        return DeviceTraceScene::create(device, trace_tables(mesh, street_.gloss, faces, street_.owners));
    }
    bool same(const CameraFrame& a, const CameraFrame& b) const
    {
        return actors_.empty() || microseconds_of(a.time) == microseconds_of(b.time);
    }

  private:
    const Street& street_;
    std::span<const Actor> actors_;
    Mesh moved_;
};

// pictures of a drive through a street, FOLDER/{color,depth,normal,label,instance,visible}/NNNNNN.png, in daylight of
// the seed where `images` does not say another
Status draw_street(Device& device, const Street& street, std::span<const Actor> actors, const CameraPath& path,
                   uint64_t seed, const StreetImages& images, const Path& folder, const Globals& globals)
{
    Progress progress(progress_to_stderr(globals), "trace", "frames", path.frames.size());
    const Daylight light = daylight(images, seed);
    const ShadeOptions options{
        .width = images.width, .height = images.height, .samples = images.samples, .ambient_rays = images.ambient_rays};
    const bool whole = street.mesh.faces.size() <= kWholeScene;
    StreetMoments moments(street, actors);
    for (size_t i = 0; i < path.frames.size();) {
        const CameraFrame& first = path.frames[i];
        SR_TRY(const DeviceTraceScene scene, moments.scene(device, first, whole));
        SR_TRY(const auto tracer, Tracer::create(device, scene, options));
        for (; i < path.frames.size() && (whole || apart(first, path.frames[i]) < kStretch) &&
               moments.same(first, path.frames[i]);
             ++i) {
            SR_TRY(TracedImage image, tracer->render(path.frames[i], light));
            number_ground(image, path.frames[i], street.boxes);
            SR_CHECK(write_traced_image(folder, uint32_t(i), image));
            progress.update(i + 1, device.allocated_bytes());
            if (interrupt_requested())
                return fail(ErrorCode::interrupted, "interrupted after {} frames; nothing was kept", i + 1);
        }
    }
    progress.finish();
    return {};
}

struct StreetsArguments {
    std::string output;
    StreetOptions street;
    DriveShape drive;
    double fov = 73, shift = 1.5;
    StreetImages images;
    VoxelizeOptions voxels;
    SeenOptions sight;
    bool pictures = false, no_grids = false, seen = false, traffic = false;
};

Json street_json(const StreetsArguments& o, const Street& street, const CameraPath& path)
{
    const CrossSection& c = street.road.section();
    Json classes = Json::object();
    const std::vector<ClassShare> shares = class_shares(street.mesh);
    for (size_t i = 0; i < shares.size(); ++i)
        classes[std::string(kPalette[i].name)] = {{"faces", shares[i].faces}, {"square_metres", shares[i].area}};
    return {{"seed", o.street.seed},
            {"length", o.street.length},
            {"faces", street.mesh.faces.size()},
            {"materials", street.mesh.materials.size()},
            {"textures", street.mesh.textures.size()},
            {"objects", street.objects},
            {"classes", classes},
            {"section",
             {{"lane", c.lane},
              {"cycle_lane", c.cycle},
              {"parking", c.parking},
              {"sidewalk", c.sidewalk},
              {"kerb_height", c.kerb_height},
              {"rails", c.rails}}},
            {"frames", path.frames.size()},
            {"shift", o.shift}};
}

Status write_grids(const StreetsArguments& o, Device& device, Street& street, std::span<const CameraPath> drives,
                   const OutputFolder& out)
{
    VoxelizeOptions voxels = o.voxels;
    voxels.seed = o.street.seed;
    SR_TRY(StreetGrids grids, street_grids(device, street, voxels));
    if (o.seen) {
        SR_TRY(const std::vector<uint32_t> seen, seen_cells(device, street.mesh, grids.truth, drives, o.sight));
        grids = part_of(grids, seen);
    }
    SR_CHECK(tint_objects(street.boxes, grids.truth)); // of the front that is seen, not of the walls behind it
    for (VoxelGrid* grid : {&grids.truth, &grids.semantic}) {
        grid->metadata["name"] = fmt::format("street {}", o.street.seed);
        grid->metadata["seed"] = std::to_string(o.street.seed);
    }
    SR_CHECK(write_grid(out / "truth.sgrid", grids.truth));
    return write_grid(out / "semantic.sgrid", grids.semantic);
}

Status draw(const StreetsArguments& o, const Globals& globals, Device& device, Street& street,
            std::span<const Actor> actors, const CameraPath& path, const CameraPath& shifted, const OutputFolder& out)
{
    if (!o.no_grids)
        SR_CHECK(write_grids(o, device, street, std::array{path, shifted}, out));
    if (!o.pictures)
        return {};
    SR_CHECK(draw_street(device, street, actors, path, o.street.seed, o.images, out.path(), globals));
    if (o.shift != 0)
        SR_CHECK(draw_street(device, street, actors, shifted, o.street.seed, o.images, out / "shifted", globals));
    return {};
}

TransformsFiles files_of(bool pictures)
{
    TransformsFiles files;
    if (pictures)
        files.pictures = [](const std::string& camera, uint32_t number) { return rendered_pictures(camera, number); };
    return files;
}

Status check_drive(const StreetsArguments& o)
{
    constexpr double kMostFrames = 100000; // each has its lines in two trajectories
    if (o.drive.first > o.street.length)
        return fail(ErrorCode::usage, "--first: {} m is behind the end of the street, which is {} m long",
                    o.drive.first, o.street.length);
    if (const double frames = (o.street.length - o.drive.first) / o.drive.spacing; frames > kMostFrames)
        return fail(ErrorCode::usage, "--spacing: {} m makes {:.0f} frames of this street, at most {:.0f} are possible",
                    o.drive.spacing, frames, kMostFrames);
    return {};
}

// for the drive and a second more: a sensor may measure for a while after its frame's time
Result<std::vector<Actor>> traffic_of(const Street& street, const CameraPath& path)
{
    std::vector<Actor> actors = moving_actors(street, path.frames.back().time + 1);
    size_t poses = 0;
    for (const Actor& actor : actors)
        poses += actor.poses.size();
    if (poses > kMaxActorPoses)
        return fail(ErrorCode::usage, "--traffic: what moves in this street has {} poses, at most {} are possible",
                    poses, kMaxActorPoses);
    return actors;
}

Status streets(const StreetsArguments& o, const Globals& globals)
{
    SR_CHECK(check_drive(o));
    SR_TRY(OutputFolder out, OutputFolder::create(o.output, globals.yes));
    Street street = make_street(o.street);
    const Intrinsics lens = pinhole_from_fov(o.fov, o.images.width, o.images.height);
    const CameraPath path = drive_along(street.road, o.drive, lens);
    DriveShape beside = o.drive;
    beside.offset += o.shift;
    const CameraPath shifted = drive_along(street.road, beside, lens);
    SR_CHECK(write_glb(out / "mesh.glb", street.mesh));
    SR_CHECK(write_tum(out / "drive.tum", path));
    SR_CHECK(write_transforms(out / "transforms.json", path, files_of(o.pictures)));
    SR_CHECK(make_folder(out / "shifted"));
    SR_CHECK(write_transforms(out / "shifted/transforms.json", shifted, files_of(o.pictures && o.shift != 0)));
    Json about = street_json(o, street, path);
    std::vector<Actor> actors;
    if (o.traffic) {
        SR_TRY(actors, traffic_of(street, path));
        SR_CHECK(write_actors(out / "actors.json", actors));
        about["actors"] = actors.size();
    }
    SR_CHECK(write_file_atomically(out / "street.json", json_text(about, 2) + "\n"));
    if (o.pictures || !o.no_grids) {
        SR_TRY(const auto device, open_device(globals));
        SR_CHECK(draw(o, globals, *device, street, actors, path, shifted, out));
    }
    SR_CHECK(write_objects(out / "objects.json", street.boxes));
    SR_CHECK(out.commit());
    if (globals.json)
        fmt::print("{}\n", json_text(about));
    else if (!globals.quiet)
        fmt::print("{} m of street, {} faces, {} frames\n", o.street.length, street.mesh.faces.size(),
                   path.frames.size());
    return {};
}

} // namespace

void add_streets(CLI::App& app, const Globals& globals, Run& run)
{
    auto o = std::make_shared<StreetsArguments>();
    CLI::App* c = app.add_subcommand("streets", "make up a street: mesh, grids, a drive, and pictures to train with");
    c->add_option("-o,--output", o->output, "folder")->required();
    add_seed(*c, "--seed", o->street.seed, "another seed, another street");
    add_number(*c, "--length", o->street.length, "metres", 30.0, 20000.0);
    add_number(*c, "--spacing", o->drive.spacing, "metres between the frames of the drive", 0.01, 1000.0);
    add_number(*c, "--first", o->drive.first, "metres along the street where the drive begins", 0, 20000);
    add_number(*c, "--end-margin", o->drive.end_margin, "metres before the end where it stops", 0.0, 20000.0);
    add_number(*c, "--camera-height", o->drive.height, "of the camera, metres", 0.2, 50.0);
    add_number(*c, "--yaw", o->drive.yaw, "radians to the left of the street", -6.3, 6.3);
    c->add_flag("--traffic", o->traffic, "vehicles drive and people walk: actors.json, and so in the pictures");
    add_number(*c, "--shift", o->shift, "metres to the left of the second, novel drive", -100, 100);
    CLI::Option* no_grids = c->add_flag("--no-grids", o->no_grids, "without truth.sgrid and semantic.sgrid");
    CLI::Option* seen = c->add_flag("--seen", o->seen, "of the grids only what the drives see, as a recording would");
    seen->excludes(no_grids);
    add_number(*c, "--reach", o->sight.reach, "metres that --seen looks", 1.0, 1000.0)->needs(seen);
    add_number(*c, "--voxel-size", o->voxels.voxel_size, "metres", 0.05f, 10.f)->excludes(no_grids);
    add_number(*c, "--points", o->voxels.points_per_voxel, "points of a voxel", 1, 4096)->excludes(no_grids);
    add_placement(*c, o->voxels)->excludes(no_grids);
    CLI::Option* images =
        c->add_flag("--images", o->pictures,
                    "also pictures of both drives: {color,depth,normal,label,instance,visible}/000000.png");
    add_number(*c, "--samples", o->images.samples, "rays a pixel", 1u, 256u)->needs(images);
    add_number(*c, "--ambient-rays", o->images.ambient_rays, "rays for the light from around, a sample", 1u, 64u)
        ->needs(images);
    add_number(*c, "--sun-azimuth", o->images.sun_azimuth,
               "where the sun stands, degrees to the left of the street's direction; the sky is the seed's otherwise",
               -360.0, 360.0);
    add_number(*c, "--sun-elevation", o->images.sun_elevation, "degrees above the horizon", 1.0, 90.0)->needs(images);
    add_number(*c, "--clouds", o->images.cloud_cover, "share of the sky that they cover", 0.0, 1.0)->needs(images);
    add_number(*c, "-W,--width", o->images.width, "pixels", 1u, 4096u);
    add_number(*c, "-H,--height", o->images.height, "pixels", 1u, 4096u);
    add_number(*c, "--fov-x", o->fov, "horizontal field of view in degrees", 1.0, 170.0);
    c->callback([o, &globals, &run] { run = [o, &globals] { return streets(*o, globals); }; });
}

} // namespace semrover
