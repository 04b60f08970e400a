// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "engine/job/drawing.h"
#include "engine/job/refinement.h"
#include "engine/world/world.h"
#include "tests/support/json_text.h"
#include "tests/support/renderer_folders.h"
#include "tools/trajectory/camera_path.h"

#include "runtime/base/json.h"

namespace semrover {
namespace engine_job_refinement_test {

namespace fs = std::filesystem;

constexpr uint32_t kWidth = 56, kHeight = 40, kFrames = 2;
constexpr int kSteps = 3;

Device& device()
{
    static const std::unique_ptr<Device> d = std::move(*Device::create({}));
    return *d;
}

// bytes of every file of these kinds under `folder`, by name
std::map<std::string, std::string> files_in(const Path& folder, std::initializer_list<const char*> kinds)
{
    std::map<std::string, std::string> files;
    for (const char* kind : kinds)
        for (const auto& entry : fs::directory_iterator(folder / kind))
            files[std::string(kind) + "/" + entry.path().filename().string()] = contents(entry.path());
    return files;
}

class JobRefinement : public testing::Test {
  protected:
    JobRefinement()
    {
        put_renderer_model(folder_ / "model");
        put_buffers(folder_ / "in", kFrames, kWidth, kHeight);
        folder_.put("path.tum", "0 0 3.6 1.6 -0.5 0.5 -0.5 0.5\n1 0.5 3.6 1.6 -0.5 0.5 -0.5 0.5\n");
        EXPECT_TRUE(write_grid(folder_ / "street.sgrid", street()));
    }

    CameraPath drive() const { return *read_camera_path(folder_ / "path.tum", pinhole_from_fov(73, kWidth, kHeight)); }
    RefinementOptions options(std::string_view output) const
    {
        RefinementOptions o;
        o.input = folder_ / "in";
        o.model = folder_ / "model";
        o.output = folder_ / output;
        o.renderer.steps = kSteps;
        return o;
    }
    RefinementOptions options_of_grid(std::string_view output) const
    {
        RefinementOptions o = options(output);
        o.input = folder_ / "street.sgrid";
        o.path = drive();
        o.grid = [] { return street(); };
        o.renderer.frame_noise = FrameNoise::warped;
        o.renderer.frame_history = 0.6f;
        return o;
    }
    std::unique_ptr<Job> begin(const RefinementOptions& o, const RefinementCallbacks& callbacks = {},
                               Device& on = device())
    {
        auto resolved = resolve_refinement(o, callbacks);
        EXPECT_TRUE(resolved) << resolved.error().message;
        auto job = begin_refinement(on, std::move(*resolved), callbacks);
        EXPECT_TRUE(job) << job.error().message;
        return std::move(*job);
    }
    // steps a job to its end; how many it took
    size_t run(Job& job, const JobBudget& budget = JobBudget::unlimited(), Json* figures = nullptr)
    {
        size_t steps = 0;
        for (bool done = false; !done; ++steps) {
            const auto result = job.step(budget);
            EXPECT_TRUE(result) << result.error().message;
            done = !result || *result;
        }
        const auto finished = job.finish();
        EXPECT_TRUE(finished) << finished.error().message;
        if (figures && finished)
            *figures = *finished;
        return steps;
    }
    // steps of one submit, one after the other, until both have finished
    void take_turns(Job& a, Job& b)
    {
        for (bool a_done = false, b_done = false; !a_done || !b_done;) {
            if (!a_done)
                a_done = *a.step(JobBudget::one_submit());
            if (!b_done)
                b_done = *b.step(JobBudget::one_submit());
        }
        EXPECT_TRUE(a.finish() && b.finish());
    }
    std::map<std::string, std::string> results(std::string_view output) const
    {
        return files_in(folder_ / output, {"frames", "latents"});
    }
    std::map<std::string, std::string> whole(const RefinementOptions& o, std::string_view output)
    {
        Json figures;
        EXPECT_EQ(run(*begin(o), JobBudget::unlimited(), &figures), 1u);
        EXPECT_EQ(figures["frames"], kFrames);
        EXPECT_EQ(figures["planned_device_bytes"], figures["peak_device_bytes"]);
        EXPECT_EQ(results(output).size(), 2 * kFrames);
        return results(output);
    }

    ScratchFolder folder_;
};

TEST_F(JobRefinement, budgets_of_one_submit_give_the_bytes_of_the_uninterrupted_run)
{
    const auto buffers = whole(options("buffers"), "buffers"), grid = whole(options_of_grid("grid"), "grid");
    // each frame is encoded, denoised and decoded; those of a grid are drawn
    EXPECT_EQ(run(*begin(options("steps")), JobBudget::one_submit()), kFrames * (kSteps + 2));
    EXPECT_EQ(run(*begin(options_of_grid("grid_steps")), JobBudget::one_submit()), kFrames * (kSteps + 3));
    EXPECT_TRUE(buffers == results("steps"));
    EXPECT_TRUE(grid == results("grid_steps"));
    EXPECT_TRUE(files_in(folder_ / "grid" / "buffers", {"color", "depth", "visible", "label", "normal"}) ==
                files_in(folder_ / "grid_steps" / "buffers", {"color", "depth", "visible", "label", "normal"}));
    EXPECT_FALSE(buffers == grid);
}

TEST_F(JobRefinement, budgets_of_time_stop_as_well_and_change_no_byte)
{
    const auto expected = whole(options("whole"), "whole");
    EXPECT_EQ(run(*begin(options("instant")), {~0u, 0}), kFrames * (kSteps + 2)); // always some work
    EXPECT_EQ(run(*begin(options("hour")), {~0u, 3'600'000'000}), 1u);
    EXPECT_EQ(run(*begin(options("three")), {3, ~0ull}), (kFrames * (kSteps + 2) + 2) / 3);
    for (const char* output : {"instant", "hour", "three"})
        EXPECT_TRUE(expected == results(output)) << output;
}

TEST_F(JobRefinement, refinements_take_turns_on_one_device_and_do_not_know_of_each_other)
{
    RefinementOptions other = options_of_grid("other");
    other.renderer.seed = 5;
    const auto first = whole(options("first"), "first"), second = whole(other, "other");
    RefinementOptions other_again = other;
    other_again.output = folder_ / "b";
    const auto a = begin(options("a")), b = begin(other_again);
    take_turns(*a, *b);
    EXPECT_TRUE(first == results("a"));
    EXPECT_TRUE(second == results("b"));
}

TEST_F(JobRefinement, a_generation_takes_turns_with_it_on_one_device)
{
    const auto expected = whole(options_of_grid("whole"), "whole");
    GenerationOptions generation;
    generation.model = SEMROVER_SOURCE_DIR "/tests/golden/sampling_ddpm/model";
    generation.steps = 2;
    generation.region_size = 40;
    generation.coverage_threshold = 12;
    const auto world_of_labels = [&] {
        VoxelGrid labels = street();
        labels.points.clear();
        labels.colors.clear();
        labels.generated.clear();
        auto world =
            open_world(device(), {.settings = *resolve_generation(generation)}, labels_of_grid(std::move(labels)));
        EXPECT_TRUE(world) << world.error().message;
        EXPECT_TRUE((*world)->everywhere());
        return std::move(*world);
    };
    const auto alone = world_of_labels(), a = world_of_labels();
    size_t steps = 1;
    while (!*alone->step(JobBudget::one_submit()))
        ++steps;
    ASSERT_GT(steps, kFrames * (kSteps + 3)); // so that the turns reach every step of the refinement
    const auto b = begin(options_of_grid("turns"));
    for (bool a_done = false, b_done = false; !a_done || !b_done;) {
        a_done = a_done || *a->step(JobBudget::one_submit());
        b_done = b_done || *b->step(JobBudget::one_submit());
    }
    EXPECT_TRUE(b->finish());
    EXPECT_EQ(alone->scene().points, a->scene().points);
    EXPECT_TRUE(expected == results("turns"));
}

TEST_F(JobRefinement, a_job_that_is_given_up_at_any_step_is_begun_again_and_gives_the_same_bytes)
{
    const auto expected = whole(options_of_grid("whole"), "whole");
    constexpr size_t kSubmits = kFrames * (kSteps + 3);
    for (size_t at = 0; at <= kSubmits; ++at) {
        const std::string output = fmt::format("stopped{}", at);
        {
            const auto job = begin(options_of_grid(output));
            EXPECT_EQ(job->kept_in(), folder_ / output);
            for (size_t i = 0; i < at; ++i)
                EXPECT_EQ(*job->step(JobBudget::one_submit()), i + 1 == kSubmits);
            if (at % 2)
                job->cancel(); // else it is destroyed as it is, like a process that is killed
        }
        run(*begin(options_of_grid(output)), JobBudget{2, ~0ull});
        EXPECT_TRUE(expected == results(output)) << at;
    }
}

TEST_F(JobRefinement, frames_of_a_rig_are_refined_as_they_are_drawn_like_those_of_its_buffers)
{
    RefinementOptions o = options_of_grid("drawn");
    CameraPath rig;
    for (const CameraFrame& frame : o.path->frames)
        for (const char* camera : {"left", "right"}) {
            rig.frames.push_back(frame);
            rig.frames.back().camera = camera;
            rig.frames.back().pose.world_to_camera[3] += camera[0] == 'l' ? 0.3 : -0.3;
        }
    o.path = rig;
    const auto kinds = {"frames/left", "frames/right", "latents/left", "latents/right"};
    EXPECT_EQ(run(*begin(o), JobBudget::one_submit()), 2 * kFrames * (kSteps + 2) + kFrames);
    const auto drawn = files_in(folder_ / "drawn", kinds);
    EXPECT_EQ(drawn.size(), 4 * kFrames);
    RefinementOptions of_files = o;
    of_files.input = folder_ / "drawn" / "buffers";
    of_files.output = folder_ / "files";
    run(*begin(of_files));
    EXPECT_TRUE(drawn == files_in(folder_ / "files", kinds));
    RefinementOptions stopped = o;
    stopped.output = folder_ / "stopped";
    {
        const auto job = begin(stopped);
        for (size_t i = 0; i < 2 * (kSteps + 2) + 4; ++i)
            ASSERT_FALSE(*job->step(JobBudget::one_submit()));
    }
    run(*begin(stopped));
    EXPECT_TRUE(drawn == files_in(folder_ / "stopped", kinds));
}

TEST_F(JobRefinement, where_memory_is_short_everything_is_drawn_before_and_the_bytes_are_the_same)
{
    Json roomy, tight;
    run(*begin(options_of_grid("roomy")), JobBudget::unlimited(), &roomy);
    DeviceOptions limited; // as much as drawing takes alone, which is enough to refine alone
    limited.max_bytes = roomy["render_device_bytes"];
    ASSERT_LT(limited.max_bytes, roomy["planned_device_bytes"]);
    const auto small = std::move(*Device::create(limited));
    std::vector<std::string> stages;
    RefinementCallbacks callbacks;
    callbacks.progress = [&](const JobProgress& p) {
        if (p.ended)
            stages.emplace_back(p.stage);
    };
    run(*begin(options_of_grid("tight"), callbacks, *small), JobBudget::one_submit(), &tight);
    EXPECT_EQ(tight["policy"], "resident");
    EXPECT_EQ(tight["planned_device_bytes"], tight["peak_device_bytes"]);
    EXPECT_LT(tight["planned_device_bytes"], roomy["planned_device_bytes"]);
    EXPECT_EQ(stages, (std::vector<std::string>{"render", "refine"}));
    EXPECT_TRUE(results("roomy") == results("tight"));
}

TEST_F(JobRefinement, where_drawing_needs_more_than_is_left_the_rest_is_drawn_before_and_the_bytes_are_the_same)
{
    const auto of_two_lenses = [&](std::string_view output) {
        RefinementOptions o = options_of_grid(output);
        o.renderer.frame_noise = FrameNoise::fresh;
        o.path->frames.back().intrinsics.model = CameraModel::fisheye; // drawn by another rasterizer
        return o;
    };
    Json one_lens, two_lenses;
    run(*begin(options_of_grid("one_lens")), JobBudget::unlimited(), &one_lens);
    run(*begin(of_two_lenses("roomy")), JobBudget::unlimited(), &two_lenses);
    DeviceOptions limited; // the networks fit beside one of the rasterizers, and not quite beside both
    limited.max_bytes = two_lenses["peak_device_bytes"].get<uint64_t>() - 4096;
    ASSERT_LT(one_lens["planned_device_bytes"], limited.max_bytes);
    const auto small = std::move(*Device::create(limited));
    std::vector<std::string> planned;
    RefinementCallbacks callbacks;
    callbacks.planned = [&](const Refinement&, const MemoryPlan& plan) {
        planned.emplace_back(policy_name(plan.policy));
    };
    run(*begin(of_two_lenses("tight"), callbacks, *small), JobBudget::one_submit());
    EXPECT_EQ(planned, (std::vector<std::string>{"resident", "resident"})); // beside the drawing, and after it
    EXPECT_TRUE(results("roomy") == results("tight"));
    const auto kinds = {"color", "depth", "visible", "label", "normal"};
    EXPECT_TRUE(files_in(folder_ / "roomy" / "buffers", kinds) == files_in(folder_ / "tight" / "buffers", kinds));
}

TEST_F(JobRefinement, callbacks_tell_stages_counts_and_the_plan_and_may_refuse_the_end)
{
    std::vector<std::string> told;
    size_t counted = 0;
    RefinementCallbacks callbacks;
    callbacks.progress = [&](const JobProgress& p) {
        counted = p.done;
        EXPECT_LE(p.done, p.total);
        EXPECT_GT(p.device_bytes, 0u);
        if (p.ended)
            told.push_back(fmt::format("{} {} of {} {}", p.stage, p.done, p.total, p.unit));
    };
    callbacks.planned = [&](const Refinement& r, const MemoryPlan& plan) {
        told.push_back(fmt::format("{} frames, {}", r.frames(), policy_name(plan.policy)));
    };
    callbacks.refined = [](const RefineStore& store, std::span<const RefinedCamera> cameras) -> Status {
        EXPECT_TRUE(store.load_frame(cameras[0].buffers, 1));
        return fail(ErrorCode::bad_input, "no room for a video");
    };
    const auto job = begin(options_of_grid("out"), callbacks);
    while (!*job->step(JobBudget::one_submit()))
        EXPECT_LE(counted, kFrames * kSteps);
    const auto refused = job->finish();
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().message, "no room for a video");
    EXPECT_EQ(told.back(), "refine 6 of 6 steps");
    EXPECT_NE(std::ranges::find(told, "2 frames, resident"), told.end());
    EXPECT_EQ(json_of(contents(folder_ / "out" / "run.json"))["state"], "running");
}

TEST_F(JobRefinement, what_cannot_be_is_refused_before_any_work)
{
    RefinementOptions o = options("out");
    o.first_frame = 2;
    EXPECT_EQ(resolve_refinement(o, {}).error().code, ErrorCode::usage);
    o = options("out");
    o.renderer.steps = 0;
    EXPECT_EQ(resolve_refinement(o, {}).error().code, ErrorCode::bad_input);
    o = options_of_grid("out");
    o.path.reset();
    EXPECT_EQ(resolve_refinement(o, {}).error().code, ErrorCode::usage);
    EXPECT_FALSE(fs::exists(folder_ / "out"));
    whole(options("done"), "done");
    o = options("done");
    o.renderer.seed = 77;
    const auto other = begin_refinement(device(), *resolve_refinement(o, {}), {});
    EXPECT_EQ(other.error().code, ErrorCode::usage);
    o = options("done");
    o.replace = true;
    EXPECT_TRUE(begin_refinement(device(), *resolve_refinement(o, {}), {}));
}

TEST_F(JobRefinement, a_drawing_by_steps_writes_the_files_of_one_that_runs_through)
{
    for (const char* output : {"through", "steps"}) {
        DrawingOptions o;
        o.scene = street();
        o.path = drive();
        o.top = {64, 48};
        o.folder = folder_ / output;
        size_t pictures = 0;
        o.picture = [&](const CameraFrame&, std::span<const uint8_t> pixels) -> Status {
            EXPECT_EQ(pixels.size(), size_t(kWidth) * kHeight * 3);
            ++pictures;
            return {};
        };
        const auto job = begin_drawing(device(), std::move(o), {});
        ASSERT_TRUE(job) << job.error().message;
        const bool through = std::string_view(output) == "through";
        EXPECT_EQ(run(**job, through ? JobBudget::unlimited() : JobBudget::one_submit()), through ? 1u : kFrames);
        EXPECT_EQ(pictures, kFrames);
    }
    const auto kinds = {"color", "depth", "visible", "label", "normal"};
    EXPECT_EQ(files_in(folder_ / "steps", kinds).size(), 5 * kFrames);
    EXPECT_TRUE(files_in(folder_ / "through", kinds) == files_in(folder_ / "steps", kinds));
    EXPECT_EQ(contents(folder_ / "through" / "top.png"), contents(folder_ / "steps" / "top.png"));
}

} // namespace engine_job_refinement_test
} // namespace semrover
