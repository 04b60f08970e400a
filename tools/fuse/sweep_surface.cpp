// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/fuse/sweep_surface.h"

#include "engine/scene/palette.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

constexpr size_t kColumns = 900;
constexpr float kPi = 3.14159265359f, kColumn = 2 * kPi / kColumns;
constexpr float kSameBeam = 0.0015f;  // of slopes; the finest lidars have beams 0.0022 apart
constexpr float kMostBetween = 0.04f; // of slopes: lidars have beams at most 2 degrees apart where they look at streets
constexpr float kAlike = 0.3f, kAlikeShare = 0.05f;           // metres between ranges, or a share of them
constexpr float kBelow = 1;                                   // metres: what is as far below the lidar may be ground
constexpr float kFarthestGround = 6, kSteepestGround = 0.15f; // metres between returns, and up a metre
constexpr double kFocal = 480; // pixels: a pixel is 0.12 degrees wide, which beams seldom exceed

bool may_be_ground(uint8_t label)
{
    return is_ground(label) || label == kNoLabel;
}

} // namespace

SweepSurface::SweepSurface(std::span<const ScanPoint> points) : columns_(kColumns)
{
    for (const ScanPoint& p : points) {
        const float across = std::hypot(p[0], p[1]), label = p[6];
        if (!(across > 1e-3f) || !std::isfinite(across) || !std::isfinite(p[2]))
            continue;
        const float azimuth = std::atan2(p[1], p[0]);
        const auto column = std::min(size_t((azimuth + kPi) / kColumn), kColumns - 1);
        columns_[column].push_back(
            {azimuth, p[2] / across, across, label >= 0 && label < kClassCount ? uint8_t(label) : kNoLabel});
    }
    for (size_t c = 0; c < kColumns; ++c) {
        std::vector<Return>& column = columns_[c];
        std::ranges::sort(column, {}, &Return::slope);
        const float middle = (float(c) + 0.5f) * kColumn - kPi;
        std::vector<Return> beams; // of each the return nearest to the column's middle
        for (const Return& r : column) {
            if (beams.empty() || r.slope - beams.back().slope > kSameBeam)
                beams.push_back(r);
            else if (std::abs(r.azimuth - middle) < std::abs(beams.back().azimuth - middle))
                beams.back() = r;
        }
        column = std::move(beams);
    }
}

bool SweepSurface::belong_together(const Return& a, const Return& b)
{
    const float apart = std::abs(a.across - b.across), least = std::min(a.across, b.across);
    if (b.slope - a.slope > kMostBetween && apart > kAlike)
        return false;
    if (apart <= std::max(kAlike, kAlikeShare * least))
        return true;
    const bool low = std::max(a.height(), b.height()) < -kBelow;
    return low && may_be_ground(a.label) && may_be_ground(b.label) && apart < kFarthestGround &&
           std::abs(a.height() - b.height()) < kSteepestGround * apart;
}

std::optional<SweepSurface::Hit> SweepSurface::in_column(size_t column, float slope) const
{
    const std::vector<Return>& returns = columns_[column];
    const auto above = std::ranges::lower_bound(returns, slope, {}, &Return::slope);
    if (above == returns.begin() || above == returns.end())
        return {};
    const Return &a = *(above - 1), &b = *above;
    if (!belong_together(a, b))
        return {};
    // the ray height = slope * across meets the line from a to b
    const float share = (slope * a.across - a.height()) / (b.height() - a.height() - slope * (b.across - a.across));
    return Hit{a.across + share * (b.across - a.across), a.azimuth + share * (b.azimuth - a.azimuth),
               share < 0.5f ? a.label : b.label};
}

std::optional<SweepSurface::Hit> SweepSurface::along(float azimuth, float slope) const
{
    const float at = (azimuth + kPi) / kColumn - 0.5f;
    const auto left = size_t(int(std::floor(at)) + int(kColumns)) % kColumns, right = (left + 1) % kColumns;
    const std::optional<Hit> a = in_column(left, slope), b = in_column(right, slope);
    const bool left_is_nearer = at - std::floor(at) < 0.5f;
    if (!a || !b)
        return left_is_nearer ? a : b;
    const float from_a = std::remainder(azimuth - a->azimuth, 2 * kPi),
                from_a_to_b = std::remainder(b->azimuth - a->azimuth, 2 * kPi);
    const Hit& nearer = left_is_nearer ? *a : *b;
    const float apart = std::abs(a->across - b->across), least = std::min(a->across, b->across);
    if (!(from_a_to_b > 0.1f * kColumn) || apart > std::max(kAlike, kAlikeShare * least))
        return nearer;
    // 1 / across of a plane is nearly straight
    const float share = std::clamp(from_a / from_a_to_b, -0.5f, 1.5f);
    return Hit{1 / (1 / a->across + share * (1 / b->across - 1 / a->across)), azimuth, nearer.label};
}

std::vector<PinholeView> sweep_views(double lowest_slope, double highest_slope)
{
    const double corner = std::sqrt(2.0); // slopes are steepest there
    const double top = std::ceil(kFocal * corner * std::max(highest_slope, 0.0)) + 1,
                 bottom = std::ceil(kFocal * corner * std::max(-lowest_slope, 0.0)) + 1;
    const Intrinsics k{kFocal, kFocal, kFocal, top, uint32_t(2 * kFocal), uint32_t(std::min(top + bottom, 4 * kFocal))};
    // camera axes x right, y down, z forward as rows, looking ahead, to the right, behind and to the left
    return {{k, {0, -1, 0, 0, 0, 0, -1, 0, 1, 0, 0, 0, 0, 0, 0, 1}},
            {k, {-1, 0, 0, 0, 0, 0, -1, 0, 0, -1, 0, 0, 0, 0, 0, 1}},
            {k, {0, 1, 0, 0, 0, 0, -1, 0, -1, 0, 0, 0, 0, 0, 0, 1}},
            {k, {1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1}}};
}

DepthImages seen_by(const PinholeView& view, const SweepSurface& surface)
{
    const Intrinsics& k = view.intrinsics;
    const Rigid to_sensor = inverse(view.from_sensor);
    const size_t pixels = size_t(k.width) * k.height;
    DepthImages seen{std::vector<float>(pixels), std::vector<uint8_t>(pixels, kNoLabel), {}};
    for (uint32_t x = 0; x < k.width; ++x) {
        const Point3 ray = transform(to_sensor, {(x + 0.5 - k.cx) / k.fx, 0, 1});
        const double across = std::hypot(ray[0], ray[1]);
        const auto azimuth = float(std::atan2(ray[1], ray[0]));
        for (uint32_t y = 0; y < k.height; ++y) {
            const auto hit = surface.along(azimuth, float((k.cy - y - 0.5) / k.fy / across));
            if (!hit)
                continue;
            const size_t i = size_t(y) * k.width + x;
            seen.depth[i] = float(hit->across / across);
            seen.labels[i] = hit->label;
        }
    }
    return seen;
}

} // namespace semrover
