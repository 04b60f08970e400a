// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <random>
#include <vector>

// the splat rasteriser in double, every splat against every pixel, after docs/method.md §5.3
namespace semrover {

struct HostSplat {
    std::array<double, 3> position, normal, color;
    double sigma_u, sigma_v, opacity;
};

struct HostCamera {
    double fx, fy, cx, cy;
    std::array<double, 12> view; // world to camera
};

struct SplatRules {
    double near = 0.2, alpha_min = 1.0 / 255, alpha_max = 0.99, transmittance_min = 1e-4, screen_variance = 0.5,
           cutoff = 1e9;
};

struct ReferencePixel {
    std::array<double, 3> color{}, normal{};
    double alpha = 0, depth = 0, median = 0, largest = 0;
    int64_t splat = -1, median_splat = -1; // of the largest weight, of the median
};

using Vector = std::array<double, 3>;

inline Vector cross(const Vector& a, const Vector& b)
{
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
inline double dot(const Vector& a, const Vector& b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// rows of K [R t_u sigma_u | R t_v sigma_v | R p + t], in the classic form of Huang et al. 2024
struct ReferenceSplat {
    Vector tu, tv, tw, normal;
    std::array<double, 2> center;
};

// t_u = normalize(e x n), e the axis least aligned with n, and t_v = n x t_u
inline std::array<Vector, 2> tangents(const Vector& normal)
{
    size_t least = 0;
    for (size_t a = 1; a < 3; ++a)
        if (std::abs(normal[a]) < std::abs(normal[least]))
            least = a;
    Vector e{};
    e[least] = 1;
    Vector u = cross(e, normal);
    const double length = std::sqrt(dot(u, u));
    for (double& x : u)
        x /= length;
    return {u, cross(normal, u)};
}

inline ReferenceSplat place(const HostSplat& s, const HostCamera& c)
{
    const auto turn = [&](const Vector& v) {
        return Vector{c.view[0] * v[0] + c.view[1] * v[1] + c.view[2] * v[2],
                      c.view[4] * v[0] + c.view[5] * v[1] + c.view[6] * v[2],
                      c.view[8] * v[0] + c.view[9] * v[1] + c.view[10] * v[2]};
    };
    auto [u, v] = tangents(s.normal);
    Vector center = turn(s.position);
    for (size_t a = 0; a < 3; ++a) {
        u[a] *= s.sigma_u;
        v[a] *= s.sigma_v;
        center[a] += c.view[4 * a + 3];
    }
    const Vector cu = turn(u), cv = turn(v);
    ReferenceSplat r;
    r.tu = {c.fx * cu[0] + c.cx * cu[2], c.fx * cv[0] + c.cx * cv[2], c.fx * center[0] + c.cx * center[2]};
    r.tv = {c.fy * cu[1] + c.cy * cu[2], c.fy * cv[1] + c.cy * cv[2], c.fy * center[1] + c.cy * center[2]};
    r.tw = {cu[2], cv[2], center[2]};
    r.normal = turn(s.normal);
    if (dot(r.normal, center) > 0)
        for (double& x : r.normal)
            x = -x;
    r.center = {r.tu[2] / r.tw[2], r.tv[2] / r.tw[2]};
    return r;
}

// alpha at a pixel position, and the depth there; 0 where the splat is skipped
inline double alpha_at(const ReferenceSplat& s, double opacity, double x, double y, const SplatRules& rules, double& z)
{
    Vector k, l;
    for (size_t a = 0; a < 3; ++a) {
        k[a] = x * s.tw[a] - s.tu[a];
        l[a] = y * s.tw[a] - s.tv[a];
    }
    const Vector q = cross(k, l);
    const double u = q[0] / q[2], v = q[1] / q[2];
    const double r3 = std::isfinite(u) && std::isfinite(v) ? u * u + v * v : INFINITY;
    const double r2 = (std::pow(x - s.center[0], 2) + std::pow(y - s.center[1], 2)) / rules.screen_variance;
    z = r3 <= r2 ? u * s.tw[0] + v * s.tw[1] + s.tw[2] : s.tw[2];
    const double r = std::min(r3, r2), alpha = std::min(rules.alpha_max, opacity * std::exp(-0.5 * r));
    return alpha < rules.alpha_min || z < rules.near || r > rules.cutoff * rules.cutoff ? 0 : alpha;
}

// a splat over a pixel with the transmittance t; false when the pixel is done
inline bool cover(ReferencePixel& pixel, double& t, const HostSplat& s, const Vector& normal, double alpha, double z,
                  size_t index, const SplatRules& rules)
{
    if (alpha == 0)
        return true;
    if (t * (1 - alpha) < rules.transmittance_min)
        return false;
    const double w = alpha * t;
    for (size_t a = 0; a < 3; ++a) {
        pixel.color[a] += w * s.color[a];
        pixel.normal[a] += w * normal[a];
    }
    pixel.depth += w * z;
    if (t > 0.5) {
        pixel.median = z;
        pixel.median_splat = int64_t(index);
    }
    if (w > pixel.largest) {
        pixel.largest = w;
        pixel.splat = int64_t(index);
    }
    t *= 1 - alpha;
    return true;
}

inline std::vector<ReferencePixel> render_reference(const std::vector<HostSplat>& splats, const HostCamera& camera,
                                                    uint32_t width, uint32_t height, const SplatRules& rules = {})
{
    std::vector<ReferenceSplat> placed;
    std::vector<size_t> order(splats.size());
    for (const HostSplat& s : splats)
        placed.push_back(place(s, camera));
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return placed[a].tw[2] < placed[b].tw[2]; });
    std::vector<ReferencePixel> image(size_t(width) * height);
    for (size_t i = 0; i < image.size(); ++i) {
        ReferencePixel& pixel = image[i];
        double t = 1;
        for (size_t j : order) {
            double z;
            if (!(placed[j].tw[2] > rules.near))
                continue;
            const double alpha =
                alpha_at(placed[j], splats[j].opacity, double(i % width) + 0.5, double(i / width) + 0.5, rules, z);
            if (!cover(pixel, t, splats[j], placed[j].normal, alpha, z, j, rules))
                break;
        }
        pixel.alpha = 1 - t;
    }
    return image;
}

} // namespace semrover
