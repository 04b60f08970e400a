// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/drawing.h"

#include "engine/format/buffer_folder.h"
#include "engine/format/image.h"
#include "engine/format/labelled_points.h"
#include "engine/job/budget_meter.h"
#include "engine/job/drawing_store.h"
#include "engine/job/empty_frames.h"
#include "engine/job/input_hashes.h"
#include "engine/job/lidar_returns.h"
#include "engine/job/outgoing.h"
#include "engine/job/outputs.h"
#include "engine/job/run_folder.h"
#include "engine/job/version.h"
#include "engine/scene/palette.h"
#include "engine/splat/bounds.h"
#include "runtime/base/hash.h"

namespace semrover {

namespace {

constexpr uint64_t kFloatsMore = 5; // a SplatImage beside FramePixels

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

RasterizerOptions float_options(const DrawOptions& o)
{
    RasterizerOptions options = o.rasterizer();
    options.pixels_over.reset();
    return options;
}

Result<DrawnScene> load_scene(Device& device, const DrawingOptions& o)
{
    if (const auto* grid = std::get_if<VoxelGrid>(&o.scene))
        return splats_of(device, *grid, o.scene_name, o.draw);
    return splats_of(device, std::get<Splats>(o.scene), o.draw);
}

class DrawingJob : public Job {
  public:
    DrawingJob(Device& device, DrawingOptions options, DrawnScene scene, std::unique_ptr<FrameBoxes> boxes,
               std::unique_ptr<DrawingStore> store, std::unique_ptr<Outgoing> out, const JobCallbacks& callbacks)
        : device_(device), o_(std::move(options)), scene_(std::move(scene)), callbacks_(callbacks),
          drawing_(device, scene_, o_.path, o_.draw.rasterizer(o_.encoding), o_.encoding.flow.has_value()),
          floats_(device, scene_, {}, float_options(o_.draw), false), boxes_(std::move(boxes)),
          store_(std::move(store)), out_(std::move(out))
    {
        if (drawing_.total()) {
            empty_.emplace(o_.path, o_.scene_name, o_.allow_empty);
            empty_->set_scene(bounds());
        }
        find_whole();
        say(false);
    }

    Result<bool> step(const JobBudget& budget) override
    {
        Result<bool> done = advance(budget);
        if (!done) {
            (void)out_->drain(); // of two errors the first one counts
            store_->drop_if_empty();
        }
        return done;
    }

    Result<Json> finish() override
    {
        if (store_->run().results() && !drew_) {
            SR_CHECK(store_->restore_boxes());
            return *store_->run().results();
        }
        const Json results{{"output", o_.folder.string()},
                           {"frames", drawing_.total()},
                           {"sweeps", o_.path.sweeps.size()},
                           {"splats", scene_.splats.size()},
                           {"skipped", scene_.splats.skipped()},
                           {"empty_frames", empty_ ? empty_->count() : 0},
                           {"seconds", seconds_since(start_)},
                           {"file_wait_seconds", out_->file_wait_seconds()},
                           {"peak_device_bytes", device_.peak_bytes()}};
        SR_CHECK(store_->finish(results));
        return results;
    }

    // what was drawn is written
    void cancel() override { (void)out_->drain(); }
    Path kept_in() const override { return o_.folder; }

  private:
    // frames that an earlier start has drawn; of a JPEG the colours are not known any more
    void find_whole()
    {
        std::map<std::string, uint32_t> counts;
        const bool draw_all = o_.encoding.jpeg && o_.picture;
        for (const CameraFrame& f : o_.path.frames)
            whole_.push_back(store_->has(f.camera, counts[f.camera]++) && !draw_all);
        before_ = size_t(std::ranges::count(whole_, true));
        for (const LidarSweep& s : o_.path.sweeps)
            before_ += store_->has_sweep(s.sensor, counts[s.sensor]++);
        top_left_ = o_.top.width && !store_->has_top();
    }
    Result<bool> advance(const JobBudget& budget)
    {
        BudgetMeter meter(budget, cost_);
        while (!all_drawn()) {
            SR_CHECK(out_->poll());
            SR_CHECK(drawing_.done() < drawing_.total() ? draw_moment() : draw_sweep(o_.path.sweeps[sweep_]));
            say(all_drawn());
            meter.submitted();
            if (!meter.room())
                break;
        }
        const bool done = all_drawn();
        if (done && top_left_)
            SR_CHECK(draw_overview());
        if (done)
            SR_CHECK(out_->drain());
        if (done && empty_)
            SR_CHECK(empty_->report(callbacks_));
        return done;
    }
    bool all_drawn() const { return drawing_.done() == drawing_.total() && sweep_ == o_.path.sweeps.size(); }
    Status draw_moment()
    {
        const auto moment = drawing_.next();
        const auto whole = whole_.begin() + ptrdiff_t(drawing_.done());
        if (std::all_of(whole, whole + ptrdiff_t(moment.size()), [](bool w) { return w; })) {
            SR_CHECK(pass_on(moment));
            drawing_.skip();
            return {};
        }
        drew_ = true;
        return drawing_.step([this](const CameraFrame& frame, const FrameSlots& pixels) { return take(frame, pixels); })
            .map([](bool) {});
    }
    Status draw_sweep(const LidarSweep& sweep)
    {
        ++sweep_;
        const uint32_t number = counts_[sweep.sensor]++;
        if (store_->has_sweep(sweep.sensor, number))
            return {};
        drew_ = true;
        std::unique_ptr<SweepDrawing>& sweeps = lidars_[sweep.lidar.get()];
        if (!sweeps) {
            SR_TRY(sweeps,
                   SweepDrawing::create(device_, scene_.splats, scene_.actors, sweep.lidar, o_.draw.rasterizer()));
        }
        const auto image = std::make_shared<SweepImage>(sweeps->image());
        const auto write = [this, sweep, number, image] {
            return out_->write(image->bytes(), [this, sweep, number, image] {
                const float least_alpha = o_.draw.rasterizer().visible_alpha;
                return store_->make_sweep(sweep.sensor, number, lidar_returns(sweep, *image, least_alpha));
            });
        };
        return sweeps->draw(sweep, [&, rasterizer = sweeps.get()](uint32_t part, SplatSlots seen) -> Status {
            for (size_t slot = 0; slot < seen.all().size(); ++slot) {
                const bool last = part + 1 == rasterizer->parts() && slot + 1 == seen.all().size();
                SR_CHECK(out_->read(*seen.all()[slot], [=](std::span<const std::byte> bytes) -> Status {
                    rasterizer->put(part, slot, bytes, *image);
                    return last ? write() : Status();
                }));
            }
            return {};
        });
    }
    void say(bool ended)
    {
        const size_t total = drawing_.total() + o_.path.sweeps.size();
        if (callbacks_.progress && total)
            callbacks_.progress({.stage = "render",
                                 .unit = "frames",
                                 .done = drawing_.done() + sweep_,
                                 .total = total,
                                 .done_before = before_,
                                 .device_bytes = device_.allocated_bytes(),
                                 .ended = ended});
    }
    // frames that were drawn before, as they were written
    Status pass_on(std::span<const CameraFrame> frames)
    {
        SR_CHECK(out_->arrive()); // pictures go on in the path's order
        for (const CameraFrame& frame : frames) {
            const uint32_t number = counts_[frame.camera]++;
            SR_TRY(const bool nothing, store_->saw_nothing(frame.camera, number));
            empty_->add(nothing);
            if (!o_.picture)
                continue;
            SR_TRY(const Path path, find_picture(store_->folder(frame.camera), "color", number));
            SR_TRY(const ImageRgb8 color, read_image_rgb8(path));
            SR_CHECK(o_.picture(frame, color.pixels));
        }
        return {};
    }
    Status take(const CameraFrame& frame, const FrameSlots& slots)
    {
        const ImageSize size{frame.intrinsics.width, frame.intrinsics.height};
        const uint32_t number = counts_[frame.camera]++;
        std::shared_ptr<const SplatImage> floats;
        if (o_.floats) {
            SR_TRY(SplatImage image, floats_.image(frame));
            floats = std::make_shared<const SplatImage>(std::move(image));
        }
        return out_->read(slots, size, [this, frame, number, floats](FramePixels pixels) -> Status {
            empty_->add(sees_nothing(pixels));
            if (o_.visible_depth)
                clear_hidden_depth(pixels);
            if (o_.picture)
                SR_CHECK(o_.picture(frame, color_pixels(pixels)));
            const uint64_t bytes = pixels.bytes() * (floats ? kFloatsMore : 1);
            return out_->write(bytes, [this, frame, number, floats, pixels = std::move(pixels)]() mutable {
                mark_sky(pixels, frame);
                return store_->make(frame, number, pixels, floats.get());
            });
        });
    }
    Bounds bounds() const
    {
        return std::visit([](const auto& s) { return bounds_of(s); }, o_.scene);
    }
    Status draw_overview()
    {
        drew_ = true;
        const CameraFrame camera = overview_camera(bounds(), o_.top);
        return drawing_.draw({&camera, 1}, [this](const CameraFrame&, const FrameSlots& slots) {
            return out_->read(slots, o_.top, [this](const FramePixels& pixels) {
                return out_->write(pixels.bytes(),
                                   [this, color = color_pixels(pixels)] { return store_->make_top(o_.top, color); });
            });
        });
    }

    Device& device_;
    DrawingOptions o_;
    DrawnScene scene_;
    JobCallbacks callbacks_;
    PathDrawing drawing_;
    PathDrawing floats_; // what files of 8 and 16 bits round away
    SubmitCost cost_;
    std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
    std::optional<EmptyFrames> empty_;       // of a path
    std::map<std::string, uint32_t> counts_; // frames so far, per camera; sweeps, per lidar
    std::map<const Lidar*, std::unique_ptr<SweepDrawing>> lidars_;
    size_t sweep_ = 0;        // the next of the path
    std::vector<bool> whole_; // of each frame of the path
    size_t before_ = 0;       // how many of them
    bool top_left_ = false, drew_ = false;
    std::unique_ptr<FrameBoxes> boxes_; // what the store keeps its lines in
    std::unique_ptr<DrawingStore> store_;
    std::unique_ptr<Outgoing> out_; // last: what it writes is of the others
};

// all that decides the bytes of the pictures
Json drawing_settings(const DrawingOptions& o, const Device& device)
{
    const auto* grid = std::get_if<VoxelGrid>(&o.scene);
    const uint64_t scene = grid ? hash_grid(*grid) : hash_splats(std::get<Splats>(o.scene));
    Json settings{{"command", "render"},
                  {"version", kVersion},
                  {"scene", hash_text(scene)},
                  {"path", hash_text(hash_cameras(o.path))},
                  {"drive", drawing_json(o.draw)},
                  {"semantic", o.draw.semantic},
                  {"visible_depth", o.visible_depth},
                  {"top", {o.top.width, o.top.height}}};
    settings.update(encoding_json(o.encoding));
    settings.update(device_key(device));
    return settings;
}

Status write_points(const Path& path, const DrawingOptions& o)
{
    if (const auto* grid = std::get_if<VoxelGrid>(&o.scene))
        return write_labelled_points(path, *grid);
    return write_points_ply(path, std::get<Splats>(o.scene));
}

uint64_t largest_read(const DrawingOptions& o)
{
    uint64_t pixels = uint64_t(o.top.width) * o.top.height;
    for (const CameraFrame& f : o.path.frames)
        pixels = std::max(pixels, uint64_t(f.intrinsics.width) * f.intrinsics.height);
    uint64_t bytes = pixels * (o.encoding.flow ? 8 : 4);
    for (const LidarSensor& lidar : o.path.lidars)
        bytes = std::max(bytes, SweepDrawing::largest_read(*lidar.lidar));
    return bytes;
}

} // namespace

Status check_drawing_outputs(const DrawingOptions& o)
{
    return DrawingStore::check(o.folder, o.path, o.replace);
}

Result<std::unique_ptr<Job>> begin_drawing(Device& device, DrawingOptions options, const JobCallbacks& callbacks)
{
    DrawingOptions& o = options;
    SR_CHECK(check_drawing_outputs(o));
    const Json settings = drawing_settings(o, device);
    SR_TRY(DrawnScene scene, load_scene(device, o));
    if (const SplatScene& splats = scene.splats; splats.skipped() && callbacks.warning)
        callbacks.warning(fmt::format("{} of {} splats are degenerate and not drawn", splats.skipped(), splats.size()));
    SR_TRY(auto out, Outgoing::create(device, largest_read(o), o.threads));
    std::unique_ptr<FrameBoxes> boxes;
    if (o.draw.boxes) {
        SR_TRY(boxes, FrameBoxes::create(o.path, o.draw, o.encoding));
    }
    const DrawnFiles files{.floats = o.floats,
                           .top = o.top.width > 0,
                           .points = o.points,
                           .instances = o.draw.instances,
                           .boxes = boxes.get(),
                           .encoding = o.encoding,
                           .lidar = o.lidar};
    SR_TRY(auto store, DrawingStore::open(o.folder, settings, o.path, files, o.replace));
    if (!store->run().results()) {
        SR_CHECK(store->write_cameras(o.path));
        if (!o.path.frames.empty())
            SR_CHECK(write_record_of(o.path, o.encoding.depth_unit(), o.folder, callbacks));
        if (o.points)
            SR_CHECK(write_points(o.folder / "points.ply", o));
    }
    return std::make_unique<DrawingJob>(device, std::move(options), std::move(scene), std::move(boxes),
                                        std::move(store), std::move(out), callbacks);
}

} // namespace semrover
