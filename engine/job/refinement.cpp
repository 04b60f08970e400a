// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/refinement.h"

#include "engine/job/budget_meter.h"
#include "engine/job/empty_frames.h"
#include "engine/job/frame_boxes.h"
#include "engine/job/outputs.h"
#include "engine/job/refine_schedule.h"
#include "runtime/base/quote.h"

namespace semrover {

namespace {

// The buffer that copies go through, where the device needs one, exists from here on: plans count it.
Status settle_device(Device& device)
{
    SR_TRY(const auto probe, Buffer::create(device, 256, MemoryKind::device, "probe"));
    const uint32_t word = 0;
    return device.write(probe->slice(), std::as_bytes(std::span(&word, 1)));
}

std::shared_ptr<LoadedNetworks> networks_of(Device& device, const Refinement& r)
{
    return r.options.networks ? r.options.networks
                              : std::make_shared<LoadedNetworks>(device, r.model, r.options.precision);
}

// words of a picture, the largest that is read back: a frame has three bytes for each of them, a latent less
uint64_t largest_read(const Refinement& r)
{
    uint64_t bytes = 0;
    const uint32_t channels = round_up(r.model.vae.latent_channels, kRowPadding);
    for (const RefinedCamera& c : r.cameras)
        bytes = std::max({bytes, uint64_t(c.size().image_width) * c.size().image_height * 4,
                          uint64_t(round_up(c.size().pixels(), kImageRowPadding)) * channels * 4});
    return bytes;
}

// of all cameras, each of which has its own
uint64_t history_bytes(const Device& device, const Refinement& r)
{
    uint64_t bytes = 0;
    for (const RefinedCamera& c : r.cameras)
        if (c.history > 0)
            bytes += FrameHistory::planned_bytes(device.limits(), c.size());
    return bytes;
}

// a grid's pictures on their way into OUT/buffers, as `semrover render` would write them
struct BufferDrawing {
    DrawnScene scene;
    PathDrawing drawing;
    TensorPool state;
    std::map<std::string, DeviceTensor> seen; // SplatPixelSlots::seen of each camera's last frame
    std::unique_ptr<CopyRing> copies;
    std::map<std::string, uint32_t> counts; // frames so far, per camera
    EmptyFrames empty;
    bool started = false; // the first moment is drawn

    BufferDrawing(Device& device, DrawnScene s, const Refinement& r, const Bounds& bounds)
        : scene(std::move(s)), drawing(device, scene, *r.options.path, r.options.draw.rasterizer(r.options.encoding),
                                       r.options.encoding.flow.has_value()),
          empty(*r.options.path, r.options.input, r.options.allow_empty)
    {
        empty.set_scene(bounds);
        for (const RefinedCamera& c : r.cameras)
            seen[c.name] =
                state.tensor(c.size().image_width * c.size().image_height, 1, DType::u32, "seen of a camera", 1);
    }
    Status allocate(Device& device)
    {
        SR_CHECK(state.allocate(device, "drawn buffers"));
        SR_TRY(copies, CopyRing::create(device));
        return {};
    }
};

class RefinementJob : public Job {
  public:
    RefinementJob(Device& device, Refinement refinement, RunFolder run, std::unique_ptr<FrameBoxes> boxes,
                  std::unique_ptr<Outgoing> out, const RefinementCallbacks& callbacks)
        : device_(device), r_(std::move(refinement)), run_(std::move(run)), callbacks_(callbacks),
          boxes_(std::move(boxes)), networks_(networks_of(device, r_)),
          store_(run_, r_.options.encoding, r_.model.vae.latent_channels), files_(device, store_, *out),
          out_(std::move(out))
    {
        drawn_ = !r_.options.from_grid() || was_drawn();
        host_bytes_ = device.host_bytes();
    }

    ~RefinementJob() override { cancel(); }

    Result<bool> step(const JobBudget& budget) override { return settled(advance(budget)); }
    Result<Json> finish() override { return settled(finish_run()); }
    void cancel() override
    {
        // note: an error of the device is no longer of interest; the frame is begun again from its files
        if (renderer_)
            (void)renderer_->cancel();
        (void)out_->drain();
    }
    Path kept_in() const override { return r_.options.output; }

  private:
    template <typename T>
    Result<T> settled(Result<T> result)
    {
        if (result)
            return result;
        (void)out_->drain(); // of two errors the first one counts
        run_.drop_if_empty();
        return result;
    }
    Result<bool> advance(const JobBudget& budget)
    {
        BudgetMeter meter(budget, cost_);
        bool done = false;
        do {
            const Result<bool> unit = submit();
            if (!unit && unit.error().code == ErrorCode::out_of_memory && drawing_ && renderer_) {
                SR_CHECK(part_ways());
                continue;
            }
            SR_TRY(done, unit);
            meter.submitted();
        } while (!done && meter.room());
        return done;
    }
    // one submit of the device; true: all is done
    Result<bool> submit()
    {
        if (!drawn_ && (!renderer_ || refined_ || waits())) {
            SR_CHECK(draw());
            return drawn_ && refined_;
        }
        if (!renderer_)
            SR_CHECK(begin_renderer());
        SR_TRY(refined_, refine());
        return refined_ && drawn_;
    }
    bool waits() const { return schedule_->task() && files_.waits_for(*schedule_->task()); }
    Result<bool> refine()
    {
        SR_CHECK(out_->poll());
        SR_TRY(const bool over, settle());
        if (over)
            return true;
        SR_TRY(const bool done, renderer_->step(*schedule_->task()));
        schedule_->count(done);
        return settle();
    }
    // at the next task; true: none is left
    Result<bool> settle()
    {
        for (;;) {
            schedule_->enter();
            if (!schedule_->at_end_of_stage())
                return !schedule_->task();
            SR_CHECK(out_->drain()); // the next stage reads what this one wrote
            schedule_->leave();
        }
    }

    // by an earlier start of the run
    bool was_drawn() const
    {
        for (const Json& entry : run_.entries())
            if (entry.is_object() && entry.value("rendered", Json()) == r_.options.path->frames.size())
                return true;
        return false;
    }
    // The next moment. After the first one it is known what drawing takes: where it fits beside both networks, frames
    // are refined as they are drawn, else all are drawn before.
    Status draw()
    {
        if (!drawing_) {
            SR_TRY(const VoxelGrid grid, r_.options.grid());
            SR_TRY(DrawnScene scene, splats_of(device_, grid, r_.options.input, r_.options.draw));
            drawing_ = std::make_unique<BufferDrawing>(device_, std::move(scene), r_, bounds_of(grid));
            SR_CHECK(drawing_->allocate(device_));
        }
        SR_CHECK(out_->poll());
        const auto counts = drawing_->counts;
        const Result<bool> last =
            drawing_->drawing.step([this](const CameraFrame& f, const FrameSlots& pixels) { return take(f, pixels); });
        if (!last) {
            drawing_->counts = counts; // where memory was short, the moment is drawn again as a whole
            return tl::make_unexpected(last.error());
        }
        if (!std::exchange(drawing_->started, true))
            SR_CHECK(try_to_refine_while_drawing());
        if (!renderer_)
            say_drawn(*last);
        return *last ? end_drawing() : Status{};
    }
    Status take(const CameraFrame& frame, const FrameSlots& slots)
    {
        const std::string& camera = frame.camera;
        SR_CHECK(drawing_->copies->copy(slots.seen, drawing_->seen[camera]).map([](uint64_t) {}));
        const ImageSize size{frame.intrinsics.width, frame.intrinsics.height};
        const uint32_t number = drawing_->counts[camera]++;
        files_.give_buffer(camera, number, drawing_->seen[camera]);
        SR_CHECK(out_->read(slots, size, [this, frame, camera, number](FramePixels pixels) -> Status {
            DepthPicture depth = depth_picture(pixels);
            depth.unit = r_.options.encoding.depth_unit();
            files_.give_depth(camera, number, std::move(depth));
            drawing_->empty.add(sees_nothing(pixels));
            const uint64_t bytes = pixels.bytes();
            SR_CHECK(out_->write(bytes, [this, number, frame, pixels = std::move(pixels)]() mutable {
                mark_sky(pixels, frame);
                return make_buffer(frame, number, pixels);
            }));
            ++arrived_;
            return note_drawn();
        }));
        ++taken_;
        return {};
    }
    Result<FileQueue::Commit> make_buffer(const CameraFrame& frame, uint32_t number, const FramePixels& pixels) const
    {
        const auto files = std::make_shared<MadeFiles>();
        const Path folder = camera_folder(run_.path() / "buffers", frame.camera);
        SR_CHECK(make_frame_images(folder, number, pixels, r_.options.buffer_encoding(), *files));
        if (!boxes_)
            return [files] { return files->commit(); };
        return [this, files, key = frame_key(frame.camera, number), line = boxes_->line(frame, number, pixels)] {
            boxes_->keep(key, line);
            return files->commit();
        };
    }
    Status end_drawing()
    {
        drawn_ = true;
        if (renderer_) // the drawing stays as it was planned
            return note_drawn();
        // before anything is refined it is known whether there is anything to see
        SR_CHECK(arrived_ < taken_ ? out_->drain() : note_drawn());
        drawing_.reset();
        return {};
    }
    // in the journal, behind the files of the last frame
    Status note_drawn()
    {
        if (!drawn_ || arrived_ < taken_)
            return {};
        SR_CHECK(drawing_->empty.report(callbacks_));
        return out_->write(0, [this]() -> Result<FileQueue::Commit> {
            return [this]() -> Status {
                if (boxes_)
                    SR_CHECK(boxes_->write(run_.path()));
                return run_.append({{"rendered", r_.options.path->frames.size()}});
            };
        });
    }
    void say_drawn(bool ended)
    {
        const PathDrawing& d = drawing_->drawing;
        const auto say = [&](size_t done, bool last) {
            callbacks_.progress({.stage = "render",
                                 .unit = "frames",
                                 .done = done,
                                 .total = d.total(),
                                 .device_bytes = device_.allocated_bytes(),
                                 .ended = last});
        };
        if (!callbacks_.progress)
            return;
        if (!said_drawn_)
            say(0, false);
        said_drawn_ = true;
        say(d.done(), ended);
    }

    Status try_to_refine_while_drawing()
    {
        const auto same_size = [&](const RefinedCamera& c) { return c.size() == r_.cameras[0].size(); };
        if (r_.model.video() || !std::ranges::all_of(r_.cameras, same_size))
            return {}; // windows of several cameras at a time; what depends on the size would be made again and again
        SR_CHECK(out_->drain());
        if (drawing_->empty.all())
            return {}; // maybe all are: they are drawn before anything is refined
        Status begun = plan();
        if (begun && memory_.policy == MemoryPolicy::resident)
            begun = begin_planned(&*r_.options.path);
        // with the splats beside it nothing fits: without them it may
        return !begun && begun.error().code == ErrorCode::out_of_memory ? Status{} : begun;
    }
    // there is no room for drawing and refining at a time after all: draw what is left, then refine what is left
    Status part_ways()
    {
        SR_CHECK(renderer_->cancel());
        SR_CHECK(out_->drain());
        if (schedule_->task())
            schedule_->leave();
        if (drawn_)
            drawing_.reset();
        renderer_.reset();
        refined_ = false;
        return {};
    }

    Status begin_renderer()
    {
        SR_CHECK(out_->drain());
        SR_CHECK(plan());
        return begin_planned(nullptr);
    }
    // what is left to do, and what it takes
    Status plan()
    {
        std::vector<RendererWork> work;
        for (const RefinedCamera& c : r_.cameras)
            work.push_back(work_left(store_, c));
        SR_TRY(memory_, plan_renderer(device_, *networks_, r_.settings, work, history_bytes(device_, r_)));
        return {};
    }
    // drawn: the path whose buffers are being drawn
    Status begin_planned(const CameraPath* drawn)
    {
        if (r_.options.from_grid()) {
            render_bytes_ = std::max(render_bytes_, device_.peak_bytes());
            device_.reset_peak();
        }
        if (callbacks_.planned)
            callbacks_.planned(r_, memory_);
        files_.set_drawn(drawn != nullptr);
        std::vector<const CameraChain*> chains;
        for (const RefinedCamera& c : r_.cameras)
            chains.push_back(&c);
        SR_TRY(renderer_, DeferredRenderer::create(device_, networks_, r_.settings, memory_, chains, files_));
        schedule_.emplace(store_, r_.cameras, RefineOrder{memory_.policy, r_.settings.plan.rows.size(), drawn},
                          callbacks_, device_);
        return {};
    }
    Result<Json> finish_run()
    {
        SR_CHECK(out_->drain());
        renderer_.reset();
        drawing_.reset();
        Json results{{"output", r_.options.output.string()},
                     {"frames", r_.frames()},
                     {"steps", r_.settings.steps},
                     {"seconds", seconds_since(start_)},
                     {"file_wait_seconds", out_->file_wait_seconds()},
                     {"policy", policy_name(memory_.policy)},
                     {"planned_device_bytes", memory_.bytes},
                     {"peak_device_bytes", device_.peak_bytes()},
                     {"host_bytes_read", device_.host_bytes().read - host_bytes_.read},
                     {"host_bytes_written", device_.host_bytes().written - host_bytes_.written}};
        if (render_bytes_)
            results["render_device_bytes"] = render_bytes_;
        if (callbacks_.refined)
            SR_CHECK(callbacks_.refined(store_, r_.cameras));
        SR_CHECK(run_.finish(results));
        return results;
    }

    Device& device_;
    Refinement r_;
    RunFolder run_;
    RefinementCallbacks callbacks_;
    SubmitCost cost_;
    std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();

    std::unique_ptr<FrameBoxes> boxes_;      // of the buffers that are drawn
    std::unique_ptr<BufferDrawing> drawing_; // while there is something to draw
    bool drawn_ = false, refined_ = false;   // all of it
    bool said_drawn_ = false;
    size_t taken_ = 0, arrived_ = 0; // frames whose pixels are on their way from the device, and there
    HostBytes host_bytes_;           // of the device, before this job
    uint64_t render_bytes_ = 0;      // device memory at most while buffers were rendered

    std::shared_ptr<LoadedNetworks> networks_;
    MemoryPlan memory_;
    RefineStore store_;
    RefineFiles files_;
    std::unique_ptr<Outgoing> out_; // what it writes goes through the ones above
    std::optional<RefineSchedule> schedule_;
    std::unique_ptr<DeferredRenderer> renderer_; // while drawing_ is there: frames are refined as they are drawn
};

// a run that was finished before, and whose frames are there
class FinishedRefinement : public Job {
  public:
    FinishedRefinement(Refinement refinement, RunFolder run, const RefinementCallbacks& callbacks)
        : r_(std::move(refinement)), run_(std::move(run)), callbacks_(callbacks),
          store_(run_, r_.options.encoding, r_.model.vae.latent_channels)
    {
    }
    Status check() const
    {
        for (const RefinedCamera& c : r_.cameras)
            for (uint32_t f = c.range.first; f <= c.range.last; ++f)
                for (const PieceKind kind : {PieceKind::latent, PieceKind::frame})
                    if (!store_.has(kind, c.buffers, f))
                        return fail(ErrorCode::usage,
                                    "{} exists, a finished run of which {} is not as it was; `replace` replaces it",
                                    quote_path(r_.options.output), store_.name(kind, c.buffers, f));
        return {};
    }
    Result<bool> step(const JobBudget&) override { return true; }
    Result<Json> finish() override
    {
        if (callbacks_.refined)
            SR_CHECK(callbacks_.refined(store_, r_.cameras));
        return *run_.results();
    }
    void cancel() override {}
    Path kept_in() const override { return r_.options.output; }

  private:
    Refinement r_;
    RunFolder run_;
    RefinementCallbacks callbacks_;
    RefineStore store_;
};

Result<std::unique_ptr<Job>> finished_refinement(Refinement r, RunFolder run, const RefinementCallbacks& callbacks)
{
    auto job = std::make_unique<FinishedRefinement>(std::move(r), std::move(run), callbacks);
    SR_CHECK(job->check());
    return job;
}

} // namespace

Result<MemoryPlan> plan_refinement(Device& device, const Refinement& r)
{
    SR_CHECK(settle_device(device));
    device.reset_peak();
    std::vector<RendererWork> work;
    for (const RefinedCamera& c : r.cameras)
        work.push_back(c.work);
    const uint64_t outgoing = Outgoing::planned_bytes(device.limits(), largest_read(r));
    return plan_renderer(device, *networks_of(device, r), r.settings, work, outgoing + history_bytes(device, r));
}

Result<std::unique_ptr<Job>> begin_refinement(Device& device, Refinement r, const RefinementCallbacks& callbacks)
{
    SR_CHECK(r.check_outputs({}));
    if (r.was_stopped() || (r.was_finished() && !r.options.replace)) {
        SR_CHECK(settle_device(device));
        device.reset_peak();
    } else { // what does not fit is refused before anything is replaced
        SR_CHECK(plan_refinement(device, r));
    }
    SR_TRY(const Json settings, refinement_settings(r, device));
    RunContents contents{{"encoded"}, {"latents", "frames", "transforms.json"}};
    contents.results.insert(contents.results.end(), std::begin(kDriveRecordFiles), std::end(kDriveRecordFiles));
    if (r.options.draw.boxes || is_file(r.options.input / kBoxesName))
        contents.results.insert(contents.results.end(), {kBoxesName, kObjectsName});
    if (r.options.from_grid())
        contents.results.push_back("buffers");
    SR_TRY(RunFolder run, open_run(r.options.output, settings, r.options.replace, contents, true));
    if (run.results())
        return finished_refinement(std::move(r), std::move(run), callbacks);
    std::unique_ptr<FrameBoxes> boxes;
    if (r.options.from_grid() && r.options.draw.boxes) {
        SR_TRY(boxes, FrameBoxes::create(*r.options.path, r.options.draw, r.options.encoding));
    }
    SR_CHECK(write_frame_cameras(r));
    SR_CHECK(write_frame_record(r, callbacks));
    auto out = Outgoing::create(device, largest_read(r), r.options.threads);
    if (!out) {
        run.drop_if_empty();
        return tl::make_unexpected(out.error());
    }
    return std::make_unique<RefinementJob>(device, std::move(r), std::move(run), std::move(boxes), std::move(*out),
                                           callbacks);
}

} // namespace semrover
