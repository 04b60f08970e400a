// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/refinement.h"

#include "engine/job/budget_meter.h"
#include "engine/job/outputs.h"
#include "engine/job/refiner.h"

namespace semrover {

namespace {

// The buffer that copies go through, where the device needs one, exists from here on: plans count it.
Status settle_device(Device& device)
{
    SR_TRY(const auto probe, Buffer::create(device, 256, MemoryKind::device, "probe"));
    const uint32_t word = 0;
    return device.write(probe->slice(), std::as_bytes(std::span(&word, 1)));
}

Result<MemoryPlan> plan_of(Device& device, const Refinement& r, std::span<const RendererWork> work)
{
    const auto unet = Unet::plan(r.model.unet, r.options.precision, device.limits());
    const auto vae = Vae::plan(r.model.vae, r.options.precision, device.limits());
    const RendererNetworks networks{*unet, *vae, r.plan, r.model.conditioning_tokens, r.asd.guidance_scale};
    SR_TRY(RendererBytes parts, renderer_bytes(device.limits(), networks, work));
    return plan_memory(std::move(parts), device.allocated_bytes(), device.budget());
}

// a grid's pictures on their way into OUT/buffers, as `semrover render` would write them
struct BufferDrawing {
    SurfelScene scene;
    PathDrawing drawing;
    std::map<std::string, uint32_t> counts; // frames so far, per camera

    BufferDrawing(Device& device, SurfelScene s, const Refinement& r)
        : scene(std::move(s)), drawing(device, scene, *r.options.path, r.draw.rasterizer())
    {
    }
};

class RefinementJob : public Job {
  public:
    RefinementJob(Device& device, Refinement refinement, RunFolder run, const RefinementCallbacks& callbacks)
        : device_(device), r_(std::move(refinement)), run_(std::move(run)), callbacks_(callbacks)
    {
    }

    Result<bool> step(const JobBudget& budget) override
    {
        Result<bool> result = advance(budget);
        if (!result)
            run_.drop_if_empty();
        return result;
    }
    Result<Json> finish() override
    {
        Result<Json> result = finish_run();
        if (!result)
            run_.drop_if_empty();
        return result;
    }
    void cancel() override
    {
        // note: an error of the device is no longer of interest; the frame is begun again from its files
        if (refiner_)
            (void)refiner_->cancel();
    }
    Path kept_in() const override { return r_.options.output; }

  private:
    Result<bool> advance(const JobBudget& budget)
    {
        BudgetMeter meter(budget, cost_);
        bool done = false;
        do {
            if (!refiner_ && r_.options.from_grid() && !was_drawn()) {
                SR_CHECK(draw());
            } else {
                if (!refiner_)
                    SR_CHECK(begin_refiner());
                SR_TRY(done, refiner_->step());
            }
            meter.submitted();
        } while (!done && meter.room());
        return done;
    }

    // by this start of the run or an earlier one
    bool was_drawn() const
    {
        for (const Json& entry : run_.entries())
            if (entry.is_object() && entry.value("rendered", Json()) == r_.options.path->frames.size())
                return true;
        return drawn_;
    }
    Status begin_drawing()
    {
        SR_TRY(const VoxelGrid grid, r_.options.grid());
        SR_TRY(SurfelScene scene, splats_of(device_, grid, r_.options.input, r_.draw));
        drawing_ = std::make_unique<BufferDrawing>(device_, std::move(scene), r_);
        say_drawn(false);
        return {};
    }
    Status draw()
    {
        if (!drawing_)
            SR_CHECK(begin_drawing());
        SR_TRY(drawn_, drawing_->drawing.step([this](const CameraFrame& frame, const SplatImage& image) {
            const Path folder = camera_folder(run_.path() / "buffers", frame.camera);
            return write_frame_images(folder, drawing_->counts[frame.camera]++, image, r_.draw.background);
        }));
        say_drawn(drawn_);
        if (!drawn_)
            return {};
        SR_CHECK(run_.append({{"rendered", drawing_->drawing.total()}}));
        drawing_.reset();
        return {};
    }
    void say_drawn(bool ended) const
    {
        if (callbacks_.progress)
            callbacks_.progress({.stage = "render",
                                 .unit = "frames",
                                 .done = drawing_->drawing.done(),
                                 .total = drawing_->drawing.total(),
                                 .device_bytes = device_.allocated_bytes(),
                                 .ended = ended});
    }

    Status begin_refiner()
    {
        if (r_.options.from_grid()) {
            render_bytes_ = device_.peak_bytes();
            device_.reset_peak();
        }
        store_.emplace(run_, r_.options.format, r_.model.vae.latent_channels);
        refiner_.emplace(*store_, r_.chains);
        SR_TRY(memory_, plan_of(device_, r_, refiner_->work()));
        if (callbacks_.planned)
            callbacks_.planned(r_, memory_);
        renderer_.emplace(device_, r_.model, r_.plan, r_.options.precision, r_.asd, memory_.policy);
        refiner_->begin(*renderer_, memory_.policy, r_.plan.rows.size(), callbacks_, device_);
        return {};
    }
    Result<Json> finish_run()
    {
        const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
        renderer_.reset();
        Json results{{"output", r_.options.output.string()},
                     {"frames", r_.frames()},
                     {"steps", r_.steps},
                     {"seconds", seconds},
                     {"policy", policy_name(memory_.policy)},
                     {"planned_device_bytes", memory_.bytes},
                     {"peak_device_bytes", device_.peak_bytes()}};
        if (render_bytes_)
            results["render_device_bytes"] = render_bytes_;
        if (callbacks_.refined)
            SR_CHECK(callbacks_.refined(*store_, r_.chains));
        SR_CHECK(run_.finish(results));
        return results;
    }

    Device& device_;
    Refinement r_;
    RunFolder run_;
    RefinementCallbacks callbacks_;
    SubmitCost cost_;
    std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();

    std::unique_ptr<BufferDrawing> drawing_;
    bool drawn_ = false;
    uint64_t render_bytes_ = 0; // device memory at most while buffers were rendered

    std::optional<RefineStore> store_;
    MemoryPlan memory_;
    std::optional<FrameRenderer> renderer_;
    std::optional<Refiner> refiner_;
};

} // namespace

Result<MemoryPlan> plan_refinement(Device& device, const Refinement& r)
{
    SR_CHECK(settle_device(device));
    device.reset_peak();
    std::vector<RendererWork> work;
    for (const RefineChain& c : r.chains)
        work.push_back({c.size});
    return plan_of(device, r, work);
}

Result<std::unique_ptr<Job>> begin_refinement(Device& device, Refinement r, const RefinementCallbacks& callbacks)
{
    SR_CHECK(r.check_outputs({}));
    if (r.was_stopped()) {
        SR_CHECK(settle_device(device));
        device.reset_peak();
    } else { // what does not fit is refused before anything is replaced
        SR_CHECK(plan_refinement(device, r));
    }
    SR_TRY(const Json settings, refinement_settings(r, device));
    RunContents contents{{"encoded"}, {"latents", "frames"}};
    if (r.options.from_grid())
        contents.results.push_back("buffers");
    SR_TRY(RunFolder run, open_run(r.options.output, settings, r.options.replace, contents));
    return std::make_unique<RefinementJob>(device, std::move(r), std::move(run), callbacks);
}

} // namespace semrover
