// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/sweep_drawing.h"

#include "engine/camera/camera_view.h"
#include "engine/camera/rig.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace semrover {

namespace {

constexpr uint32_t kPartWidth = 512; // pixels, at most
constexpr float kNear = 0.05f;       // metres

} // namespace

SweepDrawing::SweepDrawing(Device& device, const SceneActors& actors, std::shared_ptr<const Lidar> lidar)
    : device_(device), actors_(actors), lidar_(std::move(lidar)), picture_(*lidar_)
{
    parts_ = divide_up(picture_.width, std::min(kPartWidth, lidar_->columns / 2));
    part_width_ = divide_up(picture_.width, parts_);
}

Result<std::unique_ptr<SweepDrawing>> SweepDrawing::create(Device& device, const SplatScene& splats,
                                                           const SceneActors& actors,
                                                           std::shared_ptr<const Lidar> lidar,
                                                           RasterizerOptions options)
{
    std::unique_ptr<SweepDrawing> d(new SweepDrawing(device, actors, std::move(lidar)));
    options.near = kNear;
    options.screen_variance = 0;
    options.pixels_over.reset();
    options.moving = true;
    options.formats = {};
    for (size_t i = 0; i < d->lidar_->beams.size(); ++i) {
        const LidarBeam& beam = d->lidar_->beams[i];
        options.sweep_rows.push_back({float(-beam.elevation), float(d->picture_.rests[i]),
                                      float(d->picture_.first - d->picture_.shifts[i]),
                                      float(beam.delay / d->lidar_->column_microseconds())});
    }
    SR_TRY(d->rasterizer_,
           Rasterizer::create(device, splats, d->part_width_, uint32_t(d->lidar_->beams.size()), d->parts_, options));
    return d;
}

// its time is that of a part's middle, its readout the whole sweep's; its intrinsics are not used
CameraFrame SweepDrawing::frame_of(const LidarSweep& sweep, uint32_t part) const
{
    const double middle = (part + 0.5) * part_width_ / picture_.width; // of the sweep
    const auto view = [](const Rigid& sensor_to_world) {
        return Pose{inverse(compose(sensor_to_world, kForwardCamera))};
    };
    CameraFrame frame;
    frame.time = sweep.time - (1 - middle) * lidar_->sweep_seconds();
    const double end = sweep.time - frame.time, start = end - lidar_->sweep_seconds();
    frame.readout = Readout{ShutterDirection::right, view(sweep.begin), view(sweep.end), start, end};
    frame.pose = motion_of(frame).middle;
    return frame;
}

SplatCamera SweepDrawing::camera_of(const CameraFrame& frame, uint32_t part) const
{
    const double step = lidar_->step(), first = double(part) * part_width_; // pixel of the picture
    // within half a turn of straight ahead, where floats are dense
    const double azimuth = std::remainder(lidar_->start + step * (first + picture_.first), 2 * std::numbers::pi);
    SplatCamera c{float(1 / step), 1, float(0.5 - azimuth / step), 0};
    const auto narrowed = [](double v) { return float(v); };
    const CameraMotion motion = motion_of(frame);
    const Rigid& view = motion.middle.world_to_camera;
    std::transform(view.begin(), view.begin() + 12, c.world_to_camera.begin(), narrowed);
    std::ranges::transform(motion.turn, c.turn.begin(), narrowed);
    std::ranges::transform(motion.shift, c.shift.begin(), narrowed);
    c.radial_depth = true;
    double least = 0, most = 0; // that a row adds to a pixel's number
    for (size_t i = 0; i < picture_.shifts.size(); ++i) {
        const double added = double(picture_.first - picture_.shifts[i]);
        least = std::min(least, added);
        most = std::max(most, added + lidar_->beams[i].delay / lidar_->column_microseconds());
    }
    std::ranges::transform(std::array{first, double(lidar_->columns), least, most}, c.distortion.begin(), narrowed);
    return c;
}

Status SweepDrawing::draw(const LidarSweep& sweep, const Drawn& drawn)
{
    std::vector<CameraFrame> frames;
    std::vector<SplatCamera> cameras;
    for (uint32_t part = 0; part < parts_; ++part) {
        frames.push_back(frame_of(sweep, part));
        cameras.push_back(camera_of(frames.back(), part));
    }
    for (uint32_t part = 0; part < parts_;) {
        const SplatMovers movers = actors_.seen_by(std::span(frames).subspan(part), true);
        SR_TRY(const uint32_t together, rasterizer_->draw(std::span(cameras).subspan(part), movers));
        for (uint32_t i = 0; i < together; ++i, ++part)
            SR_CHECK(drawn(part, rasterizer_->images(i)));
    }
    return {};
}

Result<SweepImage> SweepDrawing::render(const LidarSweep& sweep)
{
    SweepImage seen = image();
    SR_CHECK(draw(sweep, [&](uint32_t part, SplatSlots slots) -> Status {
        std::vector<BufferSlice> slices;
        for (const DeviceTensor* slot : slots.all())
            slices.push_back(slot->slice());
        std::vector<std::vector<std::byte>> bytes(slices.size());
        SR_CHECK(device_.read(slices, [&](const ReadPiece& piece) {
            bytes[piece.slice].insert(bytes[piece.slice].end(), piece.bytes.begin(), piece.bytes.end());
        }));
        for (size_t slot = 0; slot < bytes.size(); ++slot)
            put(part, slot, bytes[slot], seen);
        return {};
    }));
    return seen;
}

uint64_t SweepDrawing::largest_read(const Lidar& lidar)
{
    return uint64_t(16) * kPartWidth * lidar.beams.size();
}

SweepImage SweepDrawing::image() const
{
    const size_t pixels = picture_.width * lidar_->beams.size();
    SweepImage image{.width = picture_.width};
    image.alpha.resize(pixels);
    image.range.resize(pixels);
    image.normal.resize(pixels * 3);
    image.label.resize(pixels);
    image.instance.resize(pixels);
    return image;
}

void SweepDrawing::put(uint32_t part, size_t slot, std::span<const std::byte> bytes, SweepImage& image) const
{
    static constexpr size_t kNumbers[] = {4, 4, 2, 2, 1}; // of a pixel, by slot
    const std::span numbers(reinterpret_cast<const float*>(bytes.data()), bytes.size() / sizeof(float));
    const std::span words(reinterpret_cast<const uint32_t*>(bytes.data()), numbers.size());
    const uint32_t first = part * part_width_, width = std::min(part_width_, picture_.width - first);
    for (size_t row = 0; row < lidar_->beams.size(); ++row)
        for (uint32_t x = 0; x < width; ++x) {
            const size_t from = (row * part_width_ + x) * kNumbers[slot], to = row * picture_.width + first + x;
            if (slot == 0)
                image.alpha[to] = numbers[from + 3];
            else if (slot == 1) // from a camera's axes
                for (size_t axis = 0; axis < 3; ++axis)
                    image.normal[to * 3 + axis] = axis == 0 ? numbers[from + 2] : -numbers[from + axis - 1];
            else if (slot == 2)
                image.range[to] = numbers[from + 1];
            else
                (slot == 3 ? image.label : image.instance)[to] = words[from];
        }
}

} // namespace semrover
