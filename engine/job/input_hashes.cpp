// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/input_hashes.h"

#include "runtime/base/hash.h"

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
    return hash.value();
}

Json drawing_json(const DrawOptions& o)
{
    const PointSplatOptions& s = o.splats;
    return {{"splat_radius", s.auto_sigma ? "auto" : fmt::format("{}", s.sigma)},
            {"opacity", s.opacity},
            {"visible_alpha", o.rasterizer().visible_alpha},
            {"background", fmt::format("{}", fmt::join(o.background, ","))}};
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
    return settings;
}

} // namespace semrover
