// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/deferred/noise_trail.h"

#include "engine/camera/camera_view.h"

#include <algorithm>
#include <limits>

namespace semrover {

namespace {

constexpr double kInfinity = 1e7; // metres

struct Source {
    uint32_t pixel = 0;
    double distance = 0; // squared, pixels of the latent, from its centre
};

double metres(const DepthPicture& depth, double x, double y)
{
    const uint32_t column = std::min(uint32_t(x), depth.width - 1), row = std::min(uint32_t(y), depth.height - 1);
    const uint32_t d = depth.pixels[size_t(row) * depth.width + column];
    return d == 0 ? kInfinity : d * depth.unit;
}

// where the surface of a pixel of the latent was
std::optional<Source> source_of(uint32_t pixel, const LatentSize& size, const Reprojection& motion,
                                const DepthPicture& depth)
{
    const double block = size.downscale;
    const double x = (pixel % size.width() + 0.5) * block, y = (pixel / size.width() + 0.5) * block;
    const auto seen = motion.source(x, y, metres(depth, x, y));
    if (!seen)
        return {};
    const double u = seen->x / block, v = seen->y / block;
    if (!(u >= 0 && v >= 0 && u < size.width() && v < size.height()))
        return {};
    const auto column = uint32_t(u), row = uint32_t(v);
    const double dx = u - column - 0.5, dy = v - row - 0.5;
    return Source{row * size.width() + column, dx * dx + dy * dy};
}

} // namespace

void NoiseTrail::follow(const CameraFrame& camera, const DepthPicture& depth)
{
    SR_ASSERT(depth.width == size_.image_width && depth.height == size_.image_height,
              "depth of {}x{} pixels for frames of {}x{}", depth.width, depth.height, size_.image_width,
              size_.image_height);
    std::vector<NoiseKey> next(size_.pixels());
    for (uint32_t i = 0; i < next.size(); ++i)
        next[i] = {i, frames_};
    if (frames_ > 0) {
        const Reprojection motion(camera_, camera);
        constexpr uint32_t kNobody = std::numeric_limits<uint32_t>::max();
        std::vector<uint32_t> heir(keys_.size(), kNobody); // of a pixel's key
        std::vector<double> distance(keys_.size(), std::numeric_limits<double>::infinity());
        for (uint32_t i = 0; i < next.size(); ++i) {
            const auto source = source_of(i, size_, motion, depth);
            if (source && source->distance < distance[source->pixel]) {
                distance[source->pixel] = source->distance;
                heir[source->pixel] = i;
            }
        }
        for (size_t i = 0; i < heir.size(); ++i)
            if (heir[i] != kNobody)
                next[heir[i]] = keys_[i];
    }
    keys_ = std::move(next);
    camera_ = camera;
    ++frames_;
}

} // namespace semrover
