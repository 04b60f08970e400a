// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/input_hashes.h"

#include "runtime/base/hash.h"

#include <map>

namespace semrover {

namespace {

template <typename... Arrays>
uint64_t hash_arrays(std::string_view first, const Arrays&... arrays)
{
    Hash hash;
    hash.add(first);
    (hash.add(std::as_bytes(std::span(arrays))), ...);
    return hash.value();
}

void add_lidar(Hash& hash, const Lidar& l)
{
    const double numbers[] = {double(l.columns), l.rate,     double(l.clockwise), l.start,
                              l.nearest,         l.farthest, l.farthest_at_tenth, double(l.first_ring_on_top)};
    hash.add(std::as_bytes(std::span(numbers)));
    for (const LidarBeam& b : l.beams) {
        const double beam[] = {b.elevation, b.azimuth, b.delay, double(b.every)};
        hash.add(std::as_bytes(std::span(beam)));
    }
}

// of what pictures of instances show, and actors are made of
uint64_t hash_objects(std::span<const SceneObject> objects)
{
    Hash hash;
    for (const SceneObject& o : objects) {
        const std::array<double, 10> values = {double(o.id), double(o.label), o.center[0], o.center[1], o.center[2],
                                               o.size[0],    o.size[1],       o.size[2],   o.heading,   double(o.part)};
        hash.add(std::as_bytes(std::span(values)));
    }
    return hash.value();
}

uint64_t hash_actors(std::span<const Actor> actors)
{
    Hash hash;
    std::map<Path, uint64_t> files; // that many may be made of
    const auto add_file = [&](const Path& path) {
        const auto [file, first] = files.try_emplace(path);
        if (first) // of a file that is not there who draws it will say so
            file->second = hash_file(path).value_or(0);
        hash.add(path.filename().string());
        hash.add(std::as_bytes(std::span(&file->second, 1)));
    };
    for (const Actor& a : actors) {
        hash.add(fmt::format("{} {} {} {}", a.id, a.label, a.from.index(), a.poses.size()));
        if (const auto* grid = std::get_if<GridOfActor>(&a.from))
            add_file(grid->path);
        if (const auto* splats = std::get_if<SplatsOfActor>(&a.from))
            add_file(splats->path);
        for (const ActorPose& p : a.poses) {
            hash.add(std::as_bytes(std::span(&p.time, 1)));
            hash.add(std::as_bytes(std::span(p.to_world)));
        }
    }
    return hash.value();
}

} // namespace

uint64_t hash_grid(const VoxelGrid& grid)
{
    return hash_arrays(fmt::format("{}", grid.voxel_size), grid.cells, grid.labels, grid.points, grid.colors,
                       grid.generated);
}

uint64_t hash_splats(const Splats& s)
{
    return hash_arrays("splats", s.position, s.normal, s.color, s.sigma_u, s.sigma_v, s.opacity, s.label);
}

uint64_t hash_cameras(const CameraPath& path)
{
    Hash hash;
    for (const CameraFrame& f : path.frames) {
        const Intrinsics& k = f.intrinsics;
        const double view[] = {f.time, k.fx, k.fy, k.cx, k.cy, double(k.width), double(k.height), double(k.model)};
        hash.add(f.camera);
        hash.add(std::as_bytes(std::span(view)));
        hash.add(std::as_bytes(std::span(k.distortion)));
        hash.add(std::as_bytes(std::span(f.pose.world_to_camera)));
        if (!f.readout)
            continue;
        hash.add(name_of(f.readout->direction));
        hash.add(std::as_bytes(std::span(f.readout->from.world_to_camera)));
        hash.add(std::as_bytes(std::span(f.readout->to.world_to_camera)));
    }
    for (const LidarSweep& s : path.sweeps) {
        hash.add(s.sensor);
        hash.add(std::as_bytes(std::span(&s.time, 1)));
        hash.add(std::as_bytes(std::span(s.begin)));
        hash.add(std::as_bytes(std::span(s.end)));
        add_lidar(hash, *s.lidar);
    }
    return hash.value();
}

Json drawing_json(const DrawOptions& o)
{
    const PointSplatOptions& s = o.splats;
    Json drive{{"splat_radius", s.auto_sigma ? "auto" : fmt::format("{}", s.sigma)},
               {"opacity", s.opacity},
               {"visible_alpha", o.rasterizer().visible_alpha},
               {"background", fmt::format("{}", fmt::join(o.background, ","))}};
    if (o.screen_variance != 0.5f) // not there with it, so that runs of earlier versions go on
        drive["screen_variance"] = o.screen_variance;
    if (o.instances || !o.actors.empty())
        drive["objects"] = hash_text(hash_objects(o.objects));
    if (o.instances)
        drive["instances"] = true;
    if (o.boxes)
        drive["boxes"] = true;
    if (!o.actors.empty())
        drive["actors"] = hash_text(hash_actors(o.actors));
    return drive;
}

Json encoding_json(const PictureEncoding& e)
{
    Json settings = Json::object();
    if (e.jpeg)
        settings = {{"format", "jpeg"}, {"quality", e.quality}};
    if (e.png_level != kPngLevel)
        settings["png_level"] = e.png_level;
    if (e.depth != DepthFormat::mm)
        settings["depth"] = kDepthFormats[size_t(e.depth)];
    if (e.flow)
        settings["flow"] = kFlowFormats[size_t(*e.flow)];
    return settings;
}

} // namespace semrover
