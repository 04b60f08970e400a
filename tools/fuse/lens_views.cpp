// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/fuse/lens_views.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace semrover {

namespace {

constexpr double kWidestSingle = 60.0 / 180 * 3.14159265358979; // from the axis
constexpr float kOneSurface = 1.1f;                             // of neighbouring depths: a surface's differ by less

// x right, y down, z forward of each side of a cube, as rows
constexpr std::array<Rigid, 6> kSides = {{
    {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1},   // front
    {0, 0, -1, 0, 0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 1},  // right
    {-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1}, // back
    {0, 0, 1, 0, 0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 0, 1},  // left
    {1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1},  // up
    {1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1},  // down
}};

double angle_between(const Point3& a, const Point3& b)
{
    return std::acos(std::clamp(a[0] * b[0] + a[1] * b[1] + a[2] * b[2], -1.0, 1.0));
}

// pixels a radian in the middle of the picture, across and down
std::array<double, 2> sharpness(const Lens& lens, const Intrinsics& k)
{
    const double x = std::clamp(k.cx, 1.0, k.width - 1.0), y = std::clamp(k.cy, 1.0, k.height - 1.0);
    const auto along = [&](double dx, double dy) {
        const auto a = lens.ray(x - dx, y - dy), b = lens.ray(x + dx, y + dy);
        return a && b ? 2 * std::hypot(dx, dy) / angle_between(*a, *b) : 1;
    };
    return {along(0.5, 0), along(0, 0.5)};
}

uint32_t side_of(double pixels)
{
    return uint32_t(std::clamp(std::ceil(pixels), 1.0, 16384.0));
}

} // namespace

LensViews::LensViews(const Intrinsics& lens) : lens_(lens)
{
    const Lens mapping(lens);
    rays_.resize(size_t(lens.width) * lens.height);
    double widest = 0;
    std::array<double, 4> ends{}; // least x, y and most x, y at z = 1
    for (uint32_t y = 0; y < lens.height; ++y)
        for (uint32_t x = 0; x < lens.width; ++x) {
            const auto ray = mapping.ray(x + 0.5, y + 0.5);
            if (!ray)
                continue;
            for (size_t axis = 0; axis < 3; ++axis)
                rays_[size_t(y) * lens.width + x][axis] = float((*ray)[axis]);
            widest = std::max(widest, angle_between(*ray, {0, 0, 1}));
            const double a = (*ray)[0] / (*ray)[2], b = (*ray)[1] / (*ray)[2];
            ends = {std::min(ends[0], a), std::min(ends[1], b), std::max(ends[2], a), std::max(ends[3], b)};
        }
    if (widest > kWidestSingle) {
        add_cube();
        return;
    }
    const auto [fx, fy] = sharpness(mapping, lens);
    Intrinsics k{fx, fy, 0.5 - fx * ends[0], 0.5 - fy * ends[1]};
    k.width = side_of(k.cx + fx * ends[2] + 0.5);
    k.height = side_of(k.cy + fy * ends[3] + 0.5);
    add_view({k});
}

void LensViews::add_cube()
{
    const auto [across, down] = sharpness(Lens(lens_), lens_);
    const double focal = 0.5 * side_of(across + down);
    const Intrinsics k{focal, focal, focal, focal, side_of(2 * focal), side_of(2 * focal)};
    for (const Rigid& side : kSides)
        if (std::ranges::any_of(rays_, [&](const std::array<float, 3>& ray) {
                const Point3 p = transform(side, {ray[0], ray[1], ray[2]});
                return p[2] > 0 && std::max(std::abs(p[0]), std::abs(p[1])) < p[2];
            }))
            add_view({k, side});
}

void LensViews::add_view(const PinholeView& view)
{
    const Lens mapping(lens_);
    const Rigid to_sensor = inverse(view.from_sensor);
    const Intrinsics& k = view.intrinsics;
    std::vector<std::array<float, 2>> positions;
    positions.reserve(size_t(k.width) * k.height);
    for (uint32_t y = 0; y < k.height; ++y)
        for (uint32_t x = 0; x < k.width; ++x) {
            const auto at =
                mapping.project(transform(to_sensor, {(x + 0.5 - k.cx) / k.fx, (y + 0.5 - k.cy) / k.fy, 1}));
            const bool inside = at && at->x >= 0 && at->y >= 0 && at->x <= lens_.width && at->y <= lens_.height;
            positions.push_back(inside ? std::array{float(at->x), float(at->y)} : std::array{-1.f, -1.f});
        }
    views_.push_back(view);
    positions_.push_back(std::move(positions));
}

// the pixels around a position, their shares, and the nearest; a panorama goes on beyond its sides
LensViews::Mix LensViews::mix_at(const std::array<float, 2>& position) const
{
    const auto width = int(lens_.width), height = int(lens_.height);
    const bool around = lens_.model == CameraModel::equirectangular;
    const float x = position[0] - 0.5f, y = position[1] - 0.5f, left = std::floor(x), top = std::floor(y);
    Mix mix{};
    for (int i = 0; i < 4; ++i) {
        const int column = int(left) + i % 2, row = std::clamp(int(top) + i / 2, 0, height - 1);
        const int inside = around ? (column + width) % width : std::clamp(column, 0, width - 1);
        mix.pixels[size_t(i)] = uint32_t(row * width + inside);
        mix.shares[size_t(i)] = (i % 2 ? x - left : 1 - x + left) * (i / 2 ? y - top : 1 - y + top);
    }
    mix.nearest = size_t(std::ranges::max_element(mix.shares) - mix.shares.begin());
    return mix;
}

// Along a line of a picture 1 / z of a plane is straight, so it is mixed; where pixels show several surfaces, the
// nearest pixel's
float LensViews::depth_of(const Mix& mix, const PinholeView& view, const DepthImages& pictures, bool radial) const
{
    if (pictures.depth[mix.pixels[mix.nearest]] <= 0)
        return 0;
    std::array<float, 4> z{};
    for (size_t i = 0; i < 4; ++i) {
        const std::array<float, 3>& ray = rays_[mix.pixels[i]];
        const float metres = pictures.depth[mix.pixels[i]] / (radial ? 1 : ray[2]);
        const Rigid& m = view.from_sensor;
        z[i] = metres > 0 ? metres * float(m[8] * ray[0] + m[9] * ray[1] + m[10] * ray[2]) : 0;
    }
    const auto [least, most] = std::ranges::minmax(z);
    if (!(least > 0 && most < kOneSurface * least))
        return std::max(z[mix.nearest], 0.f);
    float inverse = 0;
    for (size_t i = 0; i < 4; ++i)
        inverse += mix.shares[i] / z[i];
    return 1 / inverse;
}

DepthImages LensViews::seen_by(size_t view, const DepthImages& pictures, bool radial) const
{
    const size_t pixels = positions_[view].size();
    DepthImages seen;
    seen.depth.resize(pixels);
    seen.labels.resize(pictures.labels.empty() ? 0 : pixels);
    seen.colors.resize(pictures.colors.empty() ? 0 : 3 * pixels);
    for (size_t i = 0; i < pixels; ++i) {
        if (positions_[view][i][0] < 0)
            continue;
        const Mix mix = mix_at(positions_[view][i]);
        seen.depth[i] = depth_of(mix, views_[view], pictures, radial);
        if (!seen.labels.empty())
            seen.labels[i] = pictures.labels[mix.pixels[mix.nearest]];
        for (size_t c = 0; c < 3 && !seen.colors.empty(); ++c) {
            float color = 0.5f;
            for (size_t n = 0; n < 4; ++n)
                color += mix.shares[n] * float(pictures.colors[3 * mix.pixels[n] + c]);
            seen.colors[3 * i + c] = uint8_t(color);
        }
    }
    return seen;
}

} // namespace semrover
