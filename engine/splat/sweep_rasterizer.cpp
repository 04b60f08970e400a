// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/splat/sweep_rasterizer.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace semrover {

namespace {

constexpr uint32_t kPartWidth = 512; // pixels, at most
constexpr float kNear = 0.05f;       // metres

// axes of a sensor (forward, left, up) to those of a camera that looks forward (right, down, forward)
constexpr Rigid kSensorToCamera = {0, -1, 0, 0, 0, 0, -1, 0, 1, 0, 0, 0, 0, 0, 0, 1};

} // namespace

SweepRasterizer::SweepRasterizer(std::shared_ptr<const Lidar> lidar) : lidar_(std::move(lidar)), picture_(*lidar_)
{
    parts_ = divide_up(picture_.width, std::min(kPartWidth, lidar_->columns / 2));
    part_width_ = divide_up(picture_.width, parts_);
}

Result<std::unique_ptr<SweepRasterizer>> SweepRasterizer::create(Device& device, const SplatScene& scene,
                                                                 std::shared_ptr<const Lidar> lidar)
{
    std::unique_ptr<SweepRasterizer> r(new SweepRasterizer(std::move(lidar)));
    RasterizerOptions options{.near = kNear, .screen_variance = 0};
    for (size_t i = 0; i < r->lidar_->beams.size(); ++i) {
        const LidarBeam& beam = r->lidar_->beams[i];
        options.sweep_rows.push_back({float(-beam.elevation), float(r->picture_.rests[i]),
                                      float(r->picture_.first - r->picture_.shifts[i]), float(beam.every)});
    }
    SR_TRY(r->rasterizer_,
           Rasterizer::create(device, scene, r->part_width_, uint32_t(r->lidar_->beams.size()), r->parts_, options));
    return r;
}

std::vector<SplatCamera> SweepRasterizer::cameras_of(const LidarSweep& sweep) const
{
    const Rigid to_camera = compose(kSensorToCamera, inverse(sweep.begin));
    std::vector<SplatCamera> cameras;
    for (uint32_t part = 0; part < parts_; ++part) {
        const uint32_t first = part * part_width_; // pixel of the picture
        // within a turn of straight ahead, where floats are dense
        const double azimuth =
            std::remainder(lidar_->start + lidar_->step() * (double(first) + picture_.first), 2 * std::numbers::pi);
        SplatCamera c{float(1 / lidar_->step()), 1, float(0.5 - azimuth / lidar_->step()), 0};
        std::transform(to_camera.begin(), to_camera.begin() + 12, c.world_to_camera.begin(),
                       [](double v) { return float(v); });
        c.distortion[0] = float(first);
        c.distortion[1] = float(lidar_->columns);
        c.radial_depth = true;
        cameras.push_back(c);
    }
    return cameras;
}

Status SweepRasterizer::draw(const LidarSweep& sweep, const Drawn& drawn)
{
    const std::vector<SplatCamera> cameras = cameras_of(sweep);
    for (uint32_t part = 0; part < parts_;) {
        SR_TRY(const uint32_t together, rasterizer_->draw(std::span(cameras).subspan(part)));
        for (uint32_t i = 0; i < together; ++i, ++part)
            SR_CHECK(drawn(part, rasterizer_->images(i)));
    }
    return {};
}

uint64_t SweepRasterizer::largest_read(const Lidar& lidar)
{
    return uint64_t(16) * kPartWidth * lidar.beams.size();
}

SweepImage SweepRasterizer::image() const
{
    const size_t pixels = picture_.width * lidar_->beams.size();
    SweepImage image{.width = picture_.width};
    image.alpha.resize(pixels);
    image.range.resize(pixels);
    image.normal.resize(pixels * 3);
    image.label.resize(pixels);
    return image;
}

void SweepRasterizer::put(uint32_t part, size_t slot, std::span<const std::byte> bytes, SweepImage& image) const
{
    const std::span numbers(reinterpret_cast<const float*>(bytes.data()), bytes.size() / sizeof(float));
    const std::span words(reinterpret_cast<const uint32_t*>(bytes.data()), numbers.size());
    const uint32_t first = part * part_width_, width = std::min(part_width_, picture_.width - first);
    for (size_t row = 0; row < lidar_->beams.size(); ++row)
        for (uint32_t x = 0; x < width; ++x) {
            const size_t from = (row * part_width_ + x) * (slot < 2 ? 4 : 2), to = row * picture_.width + first + x;
            if (slot == 0)
                image.alpha[to] = numbers[from + 3];
            else if (slot == 1) // from a camera's axes
                for (size_t axis = 0; axis < 3; ++axis)
                    image.normal[to * 3 + axis] = axis == 0 ? numbers[from + 2] : -numbers[from + axis - 1];
            else if (slot == 2)
                image.range[to] = numbers[from + 1];
            else
                image.label[to] = words[from];
        }
}

} // namespace semrover
