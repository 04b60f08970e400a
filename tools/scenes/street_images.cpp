// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/scenes/street_images.h"

#include "tools/cli/progress.h"

#include <cmath>
#include <numbers>

namespace semrover {

namespace {

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

std::vector<uint32_t> faces_around(const Mesh& mesh, const CameraFrame& frame, double radius)
{
    const Point3 o = translation_of(frame.pose.camera_to_world());
    std::vector<uint32_t> faces;
    for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
        const auto& p = mesh.positions[mesh.faces[f][0]];
        if (std::hypot(p[0] - o[0], p[1] - o[1]) < radius)
            faces.push_back(f);
    }
    return faces;
}

} // namespace

Status draw_street(Device& device, const Street& street, const CameraPath& path, uint64_t seed,
                   const StreetImages& images, const Path& folder, const Globals& globals)
{
    Progress progress(progress_to_stderr(globals), "trace", "frames", path.frames.size());
    const Daylight light = daylight(images, seed);
    const ShadeOptions options{
        .width = images.width, .height = images.height, .samples = images.samples, .ambient_rays = images.ambient_rays};
    const bool whole = street.mesh.faces.size() <= kWholeScene;
    for (size_t i = 0; i < path.frames.size();) {
        const CameraFrame& first = path.frames[i];
        std::vector<uint32_t> faces;
        if (!whole)
            faces = faces_around(street.mesh, first, kReach + kStretch);
        SR_TRY(const DeviceTraceScene scene,
               DeviceTraceScene::create(device, trace_tables(street.mesh, street.gloss, faces)));
        SR_TRY(const auto tracer, Tracer::create(device, scene, options));
        for (; i < path.frames.size() && (whole || apart(first, path.frames[i]) < kStretch); ++i) {
            SR_TRY(const TracedImage image, tracer->render(path.frames[i], light));
            SR_CHECK(write_traced_image(folder, uint32_t(i), image));
            progress.update(i + 1, device.allocated_bytes());
            if (interrupt_requested())
                return fail(ErrorCode::interrupted, "interrupted after {} frames; nothing was kept", i + 1);
        }
    }
    progress.finish();
    return {};
}

} // namespace semrover
