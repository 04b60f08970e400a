// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/lens.h"
#include "tests/support/splat_reference.h"

// the splat rasteriser of cameras with lenses in double, every splat against the ray of every pixel, after
// docs/method.md §5.4; engine_lens tests the lenses themselves
namespace semrover {

struct LensCamera {
    Intrinsics intrinsics;
    std::array<double, 12> view; // world to camera
};

struct LensSplat {
    Vector center, u, v, normal; // camera frame; u and v unit
    double key;                  // of the sort
    double depth;                // of the centre
    bool kept;
    std::optional<Projection> pixel;
};

inline LensSplat place(const HostSplat& s, const LensCamera& c, const Lens& lens, const SplatRules& rules)
{
    const auto turn = [&](const Vector& v) {
        return Vector{c.view[0] * v[0] + c.view[1] * v[1] + c.view[2] * v[2],
                      c.view[4] * v[0] + c.view[5] * v[1] + c.view[6] * v[2],
                      c.view[8] * v[0] + c.view[9] * v[1] + c.view[10] * v[2]};
    };
    const auto [u, v] = tangents(s.normal);
    LensSplat r{turn(s.position), turn(u), turn(v), turn(s.normal), 0, 0, false, {}};
    for (size_t a = 0; a < 3; ++a)
        r.center[a] += c.view[4 * a + 3];
    if (dot(r.normal, r.center) > 0)
        for (double& x : r.normal)
            x = -x;
    r.key = c.intrinsics.model == CameraModel::opencv ? r.center[2] : std::sqrt(dot(r.center, r.center));
    r.depth = lens.radial_depth() ? std::sqrt(dot(r.center, r.center)) : r.center[2];
    r.kept = r.key > rules.near;
    r.pixel = lens.project(r.center);
    return r;
}

// alpha at a pixel position with the ray r, and the depth there; 0 where the splat is skipped
inline double alpha_at(const LensSplat& s, const HostSplat& splat, const LensCamera& c, const Lens& lens, double x,
                       double y, const Vector& r, const SplatRules& rules, double& z)
{
    const double distance = dot(s.normal, s.center) / dot(s.normal, r);
    Vector hit;
    for (size_t a = 0; a < 3; ++a)
        hit[a] = distance * r[a] - s.center[a];
    const double u = dot(hit, s.u) / splat.sigma_u, v = dot(hit, s.v) / splat.sigma_v;
    const double r3 = std::isfinite(u) && std::isfinite(v) ? u * u + v * v : INFINITY;
    double r2 = INFINITY;
    if (s.pixel) {
        double across = x - s.pixel->x;
        if (c.intrinsics.model == CameraModel::equirectangular)
            across = std::remainder(across, c.intrinsics.width);
        r2 = (across * across + std::pow(y - s.pixel->y, 2)) / rules.screen_variance;
    }
    const bool surface = r3 <= r2, axial = c.intrinsics.model == CameraModel::opencv;
    z = !surface ? s.depth : lens.radial_depth() ? distance : distance * r[2];
    const bool near = surface && (axial ? distance * r[2] : distance) < rules.near;
    const double nearest = std::min(r3, r2);
    const double alpha = std::min(rules.alpha_max, splat.opacity * std::exp(-0.5 * nearest));
    return alpha < rules.alpha_min || near || nearest > rules.cutoff * rules.cutoff ? 0 : alpha;
}

inline std::vector<ReferencePixel> render_reference(const std::vector<HostSplat>& splats, const LensCamera& camera,
                                                    const SplatRules& rules = {})
{
    const Lens lens(camera.intrinsics);
    std::vector<LensSplat> placed;
    std::vector<size_t> order(splats.size());
    for (const HostSplat& s : splats)
        placed.push_back(place(s, camera, lens, rules));
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return placed[a].key < placed[b].key; });
    const uint32_t width = camera.intrinsics.width;
    std::vector<ReferencePixel> image(size_t(width) * camera.intrinsics.height);
    for (size_t i = 0; i < image.size(); ++i) {
        const double x = double(i % width) + 0.5, y = double(i / width) + 0.5;
        const std::optional<Point3> ray = lens.ray(x, y);
        if (!ray)
            continue;
        double t = 1;
        for (const size_t j : order) {
            double z;
            if (!placed[j].kept)
                continue;
            const double alpha = alpha_at(placed[j], splats[j], camera, lens, x, y, *ray, rules, z);
            if (!cover(image[i], t, splats[j], placed[j].normal, alpha, z, j, rules))
                break;
        }
        image[i].alpha = 1 - t;
    }
    return image;
}

} // namespace semrover
