// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/drawing.h"

#include "engine/format/image.h"
#include "engine/job/budget_meter.h"
#include "engine/job/empty_frames.h"
#include "engine/job/float_buffers.h"
#include "engine/job/outgoing.h"
#include "engine/scene/palette.h"
#include "engine/splat/bounds.h"

namespace semrover {

namespace {

// straight down from above the middle, x to the right in the picture, with a narrow view so that heights hardly shift
CameraFrame overview_camera(const Bounds& b, const ImageSize& size)
{
    const double x = (b.low[0] + b.high[0]) / 2, y = (b.low[1] + b.high[1]) / 2;
    CameraFrame frame;
    frame.intrinsics = pinhole_from_fov(20, size.width, size.height);
    const double along = (b.high[0] - b.low[0]) * frame.intrinsics.fx / size.width; // x runs along the width
    const double across = (b.high[1] - b.low[1]) * frame.intrinsics.fy / size.height;
    const double up = b.high[2] + 1.05 * std::max(along, across);
    frame.pose.world_to_camera = {1, 0, 0, -x, 0, -1, 0, y, 0, 0, -1, up, 0, 0, 0, 1};
    return frame;
}

// splats are drawn as they are
Result<SurfelScene> load_scene(Device& device, DrawingOptions& o)
{
    if (const auto* grid = std::get_if<VoxelGrid>(&o.scene))
        return splats_of(device, *grid, o.scene_name, o.draw);
    Surfels& splats = std::get<Surfels>(o.scene);
    for (size_t i = 0; o.draw.semantic && i < splats.label.size(); ++i)
        splats.color[i] = label_color(splats.label[i]);
    return SurfelScene::create(device, splats);
}

class DrawingJob : public Job {
  public:
    DrawingJob(Device& device, DrawingOptions options, SurfelScene scene, std::unique_ptr<Outgoing> out,
               const JobCallbacks& callbacks)
        : device_(device), o_(std::move(options)), scene_(std::move(scene)), callbacks_(callbacks),
          drawing_(device, scene_, o_.path, o_.draw.rasterizer()), floats_(device, scene_, o_.draw.rasterizer()),
          out_(std::move(out))
    {
        if (drawing_.total()) {
            empty_.emplace(o_.path, o_.scene_name, o_.allow_empty);
            empty_->set_scene(bounds());
        }
        say(false);
    }

    Result<bool> step(const JobBudget& budget) override
    {
        BudgetMeter meter(budget, cost_);
        bool done = drawing_.total() == 0;
        while (!done) {
            SR_CHECK(out_->poll());
            SR_TRY(done, drawing_.step([this](const CameraFrame& frame, const SplatPixelSlots& pixels) {
                return take(frame, pixels);
            }));
            say(done);
            meter.submitted();
            if (!meter.room())
                break;
        }
        if (done && o_.top.width)
            SR_CHECK(draw_overview());
        if (done)
            SR_CHECK(out_->drain());
        if (done && empty_)
            SR_CHECK(empty_->report(callbacks_));
        return done;
    }

    Result<Json> finish() override
    {
        return Json{{"frames", drawing_.total()},
                    {"splats", scene_.size()},
                    {"skipped", scene_.skipped()},
                    {"empty_frames", empty_ ? empty_->count() : 0},
                    {"peak_device_bytes", device_.peak_bytes()}};
    }

    // what was drawn is written
    void cancel() override { (void)out_->drain(); }

  private:
    void say(bool ended)
    {
        if (callbacks_.progress && drawing_.total())
            callbacks_.progress({.stage = "render",
                                 .unit = "frames",
                                 .done = drawing_.done(),
                                 .total = drawing_.total(),
                                 .device_bytes = device_.allocated_bytes(),
                                 .ended = ended});
    }
    Status take(const CameraFrame& frame, const SplatPixelSlots& slots)
    {
        const Path folder = camera_folder(o_.folder, frame.camera);
        const ImageSize size{frame.intrinsics.width, frame.intrinsics.height};
        const uint32_t number = counts_[frame.camera]++;
        if (o_.floats)
            SR_CHECK(floats_.write(folder, number, frame));
        return out_->read(slots, size, [this, frame, folder, number](FramePixels pixels) -> Status {
            empty_->add(pixels);
            if (o_.visible_depth)
                clear_hidden_depth(pixels);
            if (o_.picture)
                SR_CHECK(o_.picture(frame, color_pixels(pixels)));
            return out_->write(
                [folder, number, pixels = std::move(pixels)] { return write_frame_images(folder, number, pixels); });
        });
    }
    Bounds bounds() const
    {
        return std::visit([](const auto& s) { return bounds_of(s); }, o_.scene);
    }
    Status draw_overview()
    {
        const CameraFrame camera = overview_camera(bounds(), o_.top);
        return drawing_.draw({&camera, 1}, [this](const CameraFrame&, const SplatPixelSlots& slots) {
            return out_->read(slots, o_.top, [this](const FramePixels& pixels) {
                return out_->write([this, color = color_pixels(pixels)] { return write_overview(color); });
            });
        });
    }
    Status write_overview(std::span<const uint8_t> color) const
    {
        std::error_code error;
        std::filesystem::create_directories(o_.folder, error);
        return write_png_rgb8(o_.folder / "top.png", o_.top.width, o_.top.height, color);
    }

    Device& device_;
    DrawingOptions o_;
    SurfelScene scene_;
    JobCallbacks callbacks_;
    PathDrawing drawing_;
    FloatBuffers floats_;
    SubmitCost cost_;
    std::optional<EmptyFrames> empty_;       // of a path
    std::map<std::string, uint32_t> counts_; // frames so far, per camera
    std::unique_ptr<Outgoing> out_;          // last: what it writes is of the others
};

uint64_t largest_read(const DrawingOptions& o)
{
    uint64_t pixels = uint64_t(o.top.width) * o.top.height;
    for (const CameraFrame& f : o.path.frames)
        pixels = std::max(pixels, uint64_t(f.intrinsics.width) * f.intrinsics.height);
    return pixels * 4;
}

} // namespace

Result<std::unique_ptr<Job>> begin_drawing(Device& device, DrawingOptions options, const JobCallbacks& callbacks)
{
    SR_TRY(SurfelScene scene, load_scene(device, options));
    if (scene.skipped() && callbacks.warning)
        callbacks.warning(fmt::format("{} of {} splats are degenerate and not drawn", scene.skipped(), scene.size()));
    SR_TRY(auto out, Outgoing::create(device, largest_read(options)));
    return std::make_unique<DrawingJob>(device, std::move(options), std::move(scene), std::move(out), callbacks);
}

} // namespace semrover
