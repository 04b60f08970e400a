// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/eval/flicker.h"

#include "engine/camera/camera_view.h"
#include "engine/camera/lens.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

// the four pixels around a position and their shares
struct Taps {
    std::array<size_t, 4> pixels;
    std::array<double, 4> weights;
};

constexpr double kRounding = 1e-6; // pixels and weights

// none where the position does not lie between pixel centres
std::optional<Taps> taps_at(double x, double y, uint32_t width, uint32_t height)
{
    x -= 0.5;
    y -= 0.5;
    const double right = double(width) - 1, bottom = double(height) - 1;
    if (!(x >= -kRounding && y >= -kRounding && x <= right + kRounding && y <= bottom + kRounding))
        return {};
    x = std::clamp(x, 0.0, right);
    y = std::clamp(y, 0.0, bottom);
    const auto column = size_t(x), row = size_t(y);
    const size_t next = std::min<size_t>(column + 1, width - 1), below = std::min<size_t>(row + 1, height - 1);
    const double u = x - double(column), v = y - double(row);
    return Taps{{row * width + column, row * width + next, below * width + column, below * width + next},
                {(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v}};
}

// 1 / depth between pixels; 0 where one of them has none
double inverse_depth(const Taps& taps, const DepthPicture& depth)
{
    double sum = 0;
    for (size_t i = 0; i < 4; ++i) {
        if (taps.weights[i] <= kRounding)
            continue;
        const double d = depth.pixels[taps.pixels[i]] * depth.unit;
        if (!(d > 0))
            return 0;
        sum += taps.weights[i] / d;
    }
    return sum;
}

} // namespace

Flow flow_between(const CameraFrame& from, const DepthPicture& from_depth, const CameraFrame& to,
                  const DepthPicture& to_depth, const WarpOptions& o, const ThingMotions& moving)
{
    const uint32_t width = to.intrinsics.width, height = to.intrinsics.height;
    SR_ASSERT(to_depth.width == width && to_depth.height == height && from_depth.width == from.intrinsics.width &&
                  from_depth.height == from.intrinsics.height,
              "depth of {}x{} pixels, a camera of {}x{}", to_depth.width, to_depth.height, width, height);
    const Reprojection still(from, to);
    std::map<uint16_t, std::optional<Reprojection>> moved;
    for (const auto& [thing, motion] : moving.motions) {
        CameraFrame other = from; // a thing moves, or else the camera the other way
        if (motion)
            other.pose.world_to_camera = compose(from.pose.world_to_camera, *motion);
        moved.emplace(thing, motion ? std::optional(Reprojection(other, to)) : std::nullopt);
    }
    Flow flow;
    flow.sources.resize(size_t(width) * height);
    for (size_t i = 0; i < flow.sources.size(); ++i) {
        const double depth = to_depth.pixels[i] * to_depth.unit;
        if (!(depth > 0))
            continue;
        ++flow.with_depth;
        const auto own = moving.things.empty() ? moved.end() : moved.find(moving.things[i]);
        if (own != moved.end() && !own->second)
            continue;
        const Reprojection& motion = own == moved.end() ? still : *own->second;
        const auto seen = motion.source(double(i % width) + 0.5, double(i / width) + 0.5, depth);
        if (!seen)
            continue;
        const auto taps = taps_at(seen->x, seen->y, from_depth.width, from_depth.height);
        if (taps && std::abs(seen->depth * inverse_depth(*taps, from_depth) - 1) <= o.tolerance)
            flow.sources[i] = {seen->x, seen->y};
    }
    return flow;
}

WarpSums& WarpSums::operator+=(const WarpSums& other)
{
    pixels += other.pixels;
    with_depth += other.with_depth;
    valid += other.valid;
    absolute += other.absolute;
    squares += other.squares;
    return *this;
}

double WarpSums::mean() const
{
    return valid ? absolute / double(3 * valid) : 0;
}

double WarpSums::rms() const
{
    return valid ? std::sqrt(squares / double(3 * valid)) : 0;
}

double WarpSums::share() const
{
    return pixels ? double(valid) / double(pixels) : 0;
}

WarpSums warped_difference(const Flow& flow, const ImageRgb8& from, const ImageRgb8& to)
{
    SR_ASSERT(flow.sources.size() * 3 == to.pixels.size(), "a flow of {} pixels, a frame of {}x{}", flow.sources.size(),
              to.width, to.height);
    WarpSums sums{.pixels = flow.sources.size(), .with_depth = flow.with_depth};
    for (size_t i = 0; i < flow.sources.size(); ++i) {
        const auto taps = taps_at(flow.sources[i].x, flow.sources[i].y, from.width, from.height);
        if (!taps)
            continue;
        ++sums.valid;
        for (size_t c = 0; c < 3; ++c) {
            double value = 0;
            for (size_t t = 0; t < 4; ++t)
                value += taps->weights[t] * from.pixels[3 * taps->pixels[t] + c];
            const double difference = to.pixels[3 * i + c] - value;
            sums.absolute += std::abs(difference);
            sums.squares += difference * difference;
        }
    }
    return sums;
}

} // namespace semrover
