// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// jobs that generate, taken a piece at a time: generation, growth along a path, regeneration
#include "engine/job/generation.h"

#include "engine/job/editing.h"
#include "engine/job/growth.h"
#include "runtime/base/hash.h"
#include "tests/json_text.h"
#include "tests/scratch_folder.h"

#include <algorithm>
#include <gtest/gtest.h>
#include <map>

namespace semrover {
namespace engine_job_generation_test {

Device& device()
{
    static const std::unique_ptr<Device> d = std::move(*Device::create({}));
    return *d;
}

// the golden cases' model: two layers; regions of a few dozen cells, two at a time
GenerationOptions options()
{
    GenerationOptions o;
    o.model = SEMROVER_SOURCE_DIR "/tests/golden/sampling_ddpm/model";
    o.steps = 2;
    o.region_size = 40;
    o.coverage_threshold = 12;
    o.batch = 2;
    return o;
}

GenerationRequest request(uint64_t seed = 0, const Path& output = {})
{
    GenerationRequest r;
    r.settings = *resolve_generation(options());
    r.seed = seed;
    r.output = output;
    return r;
}

// a road along x with a wall beside it
VoxelGrid street(int32_t length = 12)
{
    VoxelGrid grid;
    grid.voxel_size = 0.6f;
    for (int32_t i = 0; i < length; ++i)
        for (int32_t j = -4; j < 4; ++j)
            for (int32_t k = 0; k < (j == 3 ? 3 : 1); ++k) {
                grid.cells.push_back({i, j, k});
                grid.labels.push_back(j == 3 ? 2 : 0);
            }
    sort_cells(grid);
    return grid;
}

// steps a job until it is done; how many steps that took
size_t run(Job& job, const JobBudget& budget = JobBudget::one_submit())
{
    size_t steps = 0;
    for (bool done = false; !done; ++steps) {
        const auto step = job.step(budget);
        EXPECT_TRUE(step) << step.error().message;
        done = !step || *step;
    }
    return steps;
}

// the same, at most `steps` times; true: it was done before that
bool run_some(Job& job, size_t steps)
{
    for (size_t i = 0; i < steps; ++i) {
        const auto step = job.step(JobBudget::one_submit());
        EXPECT_TRUE(step) << step.error().message;
        if (!step || *step)
            return true;
    }
    return false;
}

Json finish(Job& job)
{
    const auto results = job.finish();
    EXPECT_TRUE(results) << results.error().message;
    return results.value_or(Json());
}

std::unique_ptr<GenerationJob> begin(const GenerationRequest& request, const JobCallbacks& callbacks = {})
{
    auto job = begin_generation(device(), street(), request, callbacks);
    EXPECT_TRUE(job) << job.error().message;
    return std::move(*job);
}

void expect_same(const VoxelGrid& a, const VoxelGrid& b, size_t when = 0)
{
    EXPECT_TRUE(a.points == b.points && a.colors == b.colors && a.generated == b.generated) << "at step " << when;
}

// of a run that was given all it needed at once
const VoxelGrid& whole(uint64_t seed = 0)
{
    static std::map<uint64_t, VoxelGrid> grids;
    if (!grids.contains(seed)) {
        const auto job = begin(request(seed));
        EXPECT_EQ(run(*job, JobBudget::unlimited()), 1u);
        finish(*job);
        grids[seed] = job->grid();
        EXPECT_EQ(std::ranges::count(grids[seed].generated, 1), int64_t(street().cells.size()));
    }
    return grids[seed];
}

// ---- generation

TEST(engine_job_generation, a_submit_at_a_time_gives_the_bytes_of_all_at_once)
{
    const auto job = begin(request());
    const size_t steps = run(*job);
    EXPECT_GE(steps, 3 * size_t(finish(*job)["regions"]) / 2); // first noise and two denoising steps a batch
    expect_same(job->grid(), whole());
}

TEST(engine_job_generation, two_jobs_take_turns_on_one_device)
{
    const auto a = begin(request(1)), b = begin(request(2));
    for (bool a_done = false, b_done = false; !a_done || !b_done;) {
        a_done = a_done || run_some(*a, 1);
        b_done = b_done || run_some(*b, 2);
    }
    expect_same(a->grid(), whole(1));
    expect_same(b->grid(), whole(2));
    EXPECT_FALSE(whole(1).points == whole(2).points);
}

TEST(engine_job_generation, cancelled_at_any_step_it_is_begun_again_to_the_same_bytes)
{
    for (size_t steps = 0;; ++steps) {
        const auto job = begin(request());
        const bool done = run_some(*job, steps);
        job->cancel();
        const VoxelGrid& cut = job->grid(); // what is finished is whole
        for (size_t c = 0; c < cut.cells.size(); ++c)
            if (cut.generated[c]) {
                EXPECT_TRUE(std::equal(&cut.points[c * 60], &cut.points[c * 60] + 60, &whole().points[c * 60]));
            }
        const auto again = begin(request());
        run(*again);
        expect_same(again->grid(), whole(), steps);
        if (done)
            break;
        ASSERT_LT(steps, 100u);
    }
}

TEST(engine_job_generation, a_run_folder_gives_back_what_was_finished_before_the_job_was_dropped)
{
    const ScratchFolder folder;
    const auto other = begin(request(0, folder / "whole.sgrid"));
    const size_t all = run(*other);
    const Json results = finish(*other);
    const uint64_t expected = *hash_file(folder / "whole.sgrid");
    for (size_t steps = 0; steps <= all; ++steps) {
        const Path output = folder / fmt::format("{}.sgrid", steps);
        {
            const auto job = begin(request(0, output));
            EXPECT_EQ(job->kept_in(), Path(output.string() + ".run"));
            run_some(*job, steps); // and is dropped, as when the process dies
        }
        JobProgress first{};
        JobCallbacks callbacks;
        callbacks.progress = [&](const JobProgress& p) { first = first.total ? first : p; };
        const auto again = begin(request(0, output), callbacks);
        EXPECT_EQ(first.done_before > 0, steps >= 3) << steps; // a batch takes three submits
        run(*again);
        const Json report = finish(*again);
        EXPECT_EQ(report["cells"], results["cells"]);
        EXPECT_EQ(*hash_file(output), expected) << "at step " << steps;
        EXPECT_FALSE(is_there(output.string() + ".run/regions"));
    }
}

TEST(engine_job_generation, time_is_a_budget_too)
{
    const auto job = begin(request());
    const size_t steps = run(*job, {~0u, 1}); // a microsecond: one submit at a time
    const auto other = begin(request());
    EXPECT_EQ(steps, run(*other));
    expect_same(job->grid(), whole());
    const auto patient = begin(request());
    EXPECT_EQ(run(*patient, {~0u, 3'600'000'000ull}), 1u);
    expect_same(patient->grid(), whole());
    const auto both = begin(request());
    EXPECT_EQ(run(*both, {2, 3'600'000'000ull}), (steps + 1) / 2);
}

TEST(engine_job_generation, progress_is_told_once_before_and_once_after_all)
{
    std::vector<JobProgress> heard;
    JobCallbacks callbacks;
    callbacks.progress = [&](const JobProgress& p) { heard.push_back(p); };
    const auto job = begin(request(), callbacks);
    ASSERT_EQ(heard.size(), 1u);
    EXPECT_EQ(heard.front().done, 0u);
    EXPECT_EQ(heard.front().total, street().cells.size());
    const size_t steps = run(*job);
    ASSERT_EQ(heard.size(), steps + 2);
    EXPECT_EQ(heard[1].part, 1. / 3);
    EXPECT_GT(heard[1].device_bytes, 0u);
    for (size_t i = 1; i < heard.size(); ++i) {
        EXPECT_GE(heard[i].done, heard[i - 1].done);
        EXPECT_EQ(heard[i].ended, i + 1 == heard.size());
    }
    EXPECT_EQ(heard.back().done, heard.back().total);
}

void expect_refusal(const GenerationRequest& request, ErrorCode code, std::string_view text,
                    const VoxelGrid& grid = street())
{
    const auto job = begin_generation(device(), grid, request);
    ASSERT_FALSE(job);
    EXPECT_EQ(job.error().code, code);
    EXPECT_NE(job.error().message.find(text), std::string::npos) << job.error().message;
}

TEST(engine_job_generation, what_cannot_be_is_refused_before_any_work)
{
    const ScratchFolder folder;
    folder.put("there.sgrid", "");
    const size_t entries = folder.entries();
    expect_refusal(request(0, folder / "there.sgrid"), ErrorCode::usage, "-y replaces it");
    expect_refusal(request(0, folder / "no/such/folder.sgrid"), ErrorCode::bad_input, "no/such");
    GenerationRequest odd = request(0, folder / "out.sgrid");
    odd.settings.guidance.scale = -1;
    expect_refusal(odd, ErrorCode::usage, "guidance");
    odd = request(0, folder / "out.sgrid");
    odd.settings.regions.region_size = 0;
    expect_refusal(odd, ErrorCode::bad_input, "region");
    VoxelGrid coarse = street();
    coarse.voxel_size = 1.2f;
    expect_refusal(request(0, folder / "out.sgrid"), ErrorCode::bad_input, "1.2 m", coarse);
    EXPECT_EQ(folder.entries(), entries);
    GenerationOptions unknown = options();
    unknown.sampler = "heun";
    EXPECT_EQ(resolve_generation(unknown).error().code, ErrorCode::usage);
}

TEST(engine_job_generation, a_budget_of_memory_is_kept_or_refused)
{
    const uint64_t bytes = [] {
        const auto report = estimate_generation(device(), street(), request());
        EXPECT_TRUE(report) << report.error().message;
        return uint64_t((*report)["peak_device_bytes"]);
    }();
    DeviceOptions small;
    small.max_bytes = bytes / 4;
    const auto tight = *Device::create(small);
    const auto refused = begin_generation(*tight, street(), request());
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, ErrorCode::out_of_memory);
}

// ---- growth along a path

class engine_job_growth : public testing::Test {
  protected:
    engine_job_growth()
    {
        EXPECT_TRUE(write_grid(folder_ / "road.sgrid", street(24)));
        folder_.put("path.tum", "0 1 0 1 0 0 0 1\n1 12 0 1 0 0 0 1\n");
    }
    GrowthRequest request(std::string_view output) const
    {
        GrowthRequest r;
        r.generation = options();
        r.generation.steps = 1;
        r.scaffold = folder_ / "road.sgrid";
        r.path = folder_ / "path.tum";
        r.output = folder_ / output;
        r.horizon = 2;
        r.window = 4;
        r.tile_size = 6;
        return r;
    }
    std::unique_ptr<Job> begin(std::string_view output) const
    {
        auto plan = plan_growth(request(output));
        EXPECT_TRUE(plan) << plan.error().message;
        auto job = begin_growth(device(), std::move(*plan));
        EXPECT_TRUE(job) << job.error().message;
        return std::move(*job);
    }
    uint64_t tiles(std::string_view output) const { return *hash_folder(folder_ / output); }

    ScratchFolder folder_;
};

TEST_F(engine_job_growth, cut_off_at_any_step_it_grows_the_same_world)
{
    size_t all = 0;
    {
        const auto job = begin("whole");
        while (!run_some(*job, 1))
            ++all;
        EXPECT_EQ(finish(*job)["windows"], 3);
    }
    for (size_t steps = 0; steps <= all; ++steps) {
        const std::string output = fmt::format("cut{}", steps);
        {
            const auto job = begin(output);
            run_some(*job, steps);
            if (steps % 2)
                job->cancel();
        }
        const auto again = begin(output);
        run(*again, JobBudget::unlimited());
        finish(*again);
        EXPECT_EQ(tiles(output), tiles("whole")) << "at step " << steps;
    }
}

TEST_F(engine_job_growth, cancelled_before_anything_is_done_it_leaves_nothing)
{
    const size_t entries = folder_.entries();
    begin("out")->cancel();
    EXPECT_EQ(folder_.entries(), entries);
}

// ---- some cells anew, for several seeds

TEST(engine_job_regeneration, cut_off_at_any_step_it_gives_every_seed_its_bytes)
{
    const ScratchFolder folder;
    ASSERT_TRUE(write_grid(folder / "in.sgrid", whole()));
    InpaintRequest inpaint{.grid = folder / "in.sgrid", .where = {}, .mask = {}};
    inpaint.where.box = *parse_box("0,-2,0:3,1,1");
    const auto begin = [&](std::string_view name) {
        auto what = select_for_inpainting(inpaint);
        EXPECT_TRUE(what) << what.error().message;
        const RegenerationOutputs outputs{folder / name, {3, 4}, false};
        auto job = begin_regeneration(device(), std::move(*what), outputs, *resolve_generation(options()));
        EXPECT_TRUE(job) << job.error().message;
        return std::move(*job);
    };
    size_t all = 0;
    {
        const auto job = begin("whole.sgrid");
        all = run(*job);
        EXPECT_EQ(finish(*job)["outputs"].size(), 2u);
    }
    for (size_t steps = 0; steps < all; ++steps) {
        const std::string name = fmt::format("cut{}", steps);
        {
            const auto job = begin(name + ".sgrid");
            run_some(*job, steps);
            job->cancel();
        }
        const auto again = begin(name + ".sgrid");
        run(*again);
        finish(*again);
        for (const int seed : {3, 4})
            EXPECT_EQ(*hash_file(folder / fmt::format("{}-seed{}.sgrid", name, seed)),
                      *hash_file(folder / fmt::format("whole-seed{}.sgrid", seed)))
                << "at step " << steps;
    }
}

TEST(engine_job_generation, warns_where_points_were_placed_in_another_way_than_the_models)
{
    VoxfieldModel model;
    VoxelGrid grid;
    std::vector<std::string> said;
    const JobCallbacks callbacks{
        .progress = {}, .warning = [&](std::string_view text) { said.emplace_back(text); }, .detail = {}};
    model.config.placement = "canonical";
    grid.generated = {0, 0};
    warn_of_placement(model, grid, callbacks);
    EXPECT_TRUE(said.empty()) << "no points yet";
    grid.generated = {0, 1};
    warn_of_placement(model, grid, callbacks);
    ASSERT_EQ(said.size(), 1u);
    EXPECT_NE(said[0].find("shifted, the model makes canonical"), std::string::npos) << said[0];
    grid.metadata["placement"] = "canonical";
    warn_of_placement(model, grid, callbacks);
    grid.metadata.clear();
    model.config.placement = "mixed";
    warn_of_placement(model, grid, callbacks);
    EXPECT_EQ(said.size(), 1u);
}

TEST(engine_job_generation, warns_where_a_distilled_model_is_sampled_in_another_way_than_it_was_trained_for)
{
    const ScratchFolder folder;
    std::filesystem::copy(options().model, folder / "voxfield_transformer");
    folder.put("model_index.json",
               R"({"defaults": {"num_inference_steps": 4, "guidance_scale": 1, "distilled_steps": 4}})");
    const auto warnings = [&](const auto& change) {
        GenerationOptions o;
        o.model = folder.path();
        change(o);
        return resolve_generation(o)->model.warnings;
    };
    EXPECT_TRUE(warnings([](GenerationOptions&) {}).empty());
    EXPECT_TRUE(warnings([](GenerationOptions& o) { o.steps = 4, o.guidance_scale = 1.f; }).empty());
    const auto scale = warnings([](GenerationOptions& o) { o.guidance_scale = 2.f; });
    ASSERT_EQ(scale.size(), 1u);
    EXPECT_NE(scale[0].find("guided already, and --cfg-scale 2 guides it twice"), std::string::npos) << scale[0];
    const auto steps = warnings([](GenerationOptions& o) { o.steps = 5; });
    ASSERT_EQ(steps.size(), 1u);
    EXPECT_EQ(steps[0], "the model was distilled for 4 steps of ddpm, not 5 of ddpm");
    const auto sampler = warnings([](GenerationOptions& o) { o.sampler = "ddim"; });
    ASSERT_EQ(sampler.size(), 1u);
    EXPECT_EQ(sampler[0], "the model was distilled for 4 steps of ddpm, not 4 of ddim");
}

} // namespace engine_job_generation_test
} // namespace semrover
