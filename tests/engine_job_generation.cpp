// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
// worlds in the order of the scene, taken a piece at a time
#include "engine/job/outputs.h"
#include "engine/world/world.h"
#include "tests/support/json_text.h"
#include "tests/support/scratch_folder.h"

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

// the golden cases' model: two layers; regions of a few dozen voxels, two at a time
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

WorldRequest request(uint64_t seed = 0)
{
    return {.settings = *resolve_generation(options()), .seed = seed};
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

// steps a world until it is done; how many steps that took
size_t run(World& world, const JobBudget& budget = JobBudget::one_submit())
{
    size_t steps = 0;
    for (bool done = false; !done; ++steps) {
        const auto step = world.step(budget);
        EXPECT_TRUE(step) << step.error().message;
        done = !step || *step;
    }
    return steps;
}

// the same, at most `steps` times; true: it was done before that
bool run_some(World& world, size_t steps)
{
    for (size_t i = 0; i < steps; ++i) {
        const auto step = world.step(JobBudget::one_submit());
        EXPECT_TRUE(step) << step.error().message;
        if (!step || *step)
            return true;
    }
    return false;
}

std::unique_ptr<World> begin(WorldRequest request, const JobCallbacks& callbacks = {}, RunFolder* run = nullptr,
                             VoxelGrid grid = street())
{
    auto world = open_world(device(), std::move(request), labels_of_grid(std::move(grid)), callbacks);
    EXPECT_TRUE(world) << world.error().message;
    EXPECT_TRUE((*world)->everywhere(run));
    return std::move(*world);
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
        const auto world = begin(request(seed));
        EXPECT_EQ(run(*world, JobBudget::unlimited()), 1u);
        grids[seed] = world->scene();
        EXPECT_EQ(std::ranges::count(grids[seed].generated, 1), int64_t(street().cells.size()));
    }
    return grids[seed];
}

// ---- generation

TEST(engine_job_generation, a_submit_at_a_time_gives_the_bytes_of_all_at_once)
{
    const auto world = begin(request());
    const size_t steps = run(*world);
    EXPECT_GE(steps, 3 * size_t(world->results()["regions"]) / 2); // first noise and two denoising steps a batch
    expect_same(world->scene(), whole());
}

TEST(engine_job_generation, two_worlds_take_turns_on_one_device)
{
    const auto a = begin(request(1)), b = begin(request(2));
    for (bool a_done = false, b_done = false; !a_done || !b_done;) {
        a_done = a_done || run_some(*a, 1);
        b_done = b_done || run_some(*b, 2);
    }
    expect_same(a->scene(), whole(1));
    expect_same(b->scene(), whole(2));
    EXPECT_FALSE(whole(1).points == whole(2).points);
}

TEST(engine_job_generation, dropped_at_any_step_what_is_finished_is_whole)
{
    for (size_t steps = 0;; ++steps) {
        const auto world = begin(request());
        const bool done = run_some(*world, steps);
        const VoxelGrid& cut = world->scene();
        for (size_t c = 0; c < cut.cells.size(); ++c)
            if (cut.generated[c]) {
                EXPECT_TRUE(std::equal(&cut.points[c * 60], &cut.points[c * 60] + 60, &whole().points[c * 60]));
            }
        if (done)
            break;
        ASSERT_LT(steps, 100u);
    }
}

TEST(engine_job_generation, a_run_folder_gives_back_what_was_finished_before_the_world_was_dropped)
{
    const ScratchFolder folder;
    const size_t all = run(*begin(request()));
    for (size_t steps = 0; steps <= all; ++steps) {
        const Path output = folder / fmt::format("{}.run", steps);
        {
            RunFolder kept = *open_run(output, Json::object(), false);
            run_some(*begin(request(), {}, &kept), steps); // and is dropped, as when the process dies
        }
        JobProgress first{};
        JobCallbacks callbacks;
        callbacks.progress = [&](const JobProgress& p) { first = first.total ? first : p; };
        RunFolder kept = *open_run(output, Json::object(), false);
        const auto again = begin(request(), callbacks, &kept);
        EXPECT_EQ(first.done_before > 0, steps >= 3) << steps; // a batch takes three submits
        run(*again);
        EXPECT_EQ(again->results()["cells"], whole().cells.size());
        expect_same(again->scene(), whole(), steps);
    }
}

TEST(engine_job_generation, targets_are_made_anew_and_nothing_else_from_any_run_folder)
{
    const ScratchFolder folder;
    WorldRequest r = request(3);
    for (uint32_t c = 0; c < street().cells.size(); ++c)
        if (street().cells[c][0] < 5 && street().cells[c][1] < 2)
            r.targets.push_back(c);
    const auto expected = begin(r, {}, nullptr, whole());
    const size_t all = run(*expected);
    for (size_t c = 0, t = 0; c < whole().cells.size(); ++c) {
        const bool target = t < r.targets.size() && r.targets[t] == c;
        t += target;
        EXPECT_NE(target,
                  std::equal(&whole().points[c * 60], &whole().points[c * 60] + 60, &expected->scene().points[c * 60]));
    }
    for (size_t steps = 0; steps < all; ++steps) {
        const Path output = folder / fmt::format("{}.run", steps);
        {
            RunFolder kept = *open_run(output, Json::object(), false);
            run_some(*begin(r, {}, &kept, whole()), steps);
        }
        RunFolder kept = *open_run(output, Json::object(), false);
        const auto again = begin(r, {}, &kept, whole());
        run(*again);
        expect_same(again->scene(), expected->scene(), steps);
    }
}

TEST(engine_job_generation, time_is_a_budget_too)
{
    const auto hasty = begin(request());
    const size_t steps = run(*hasty, {~0u, 1}); // a microsecond: one submit at a time
    const auto other = begin(request());
    EXPECT_EQ(steps, run(*other));
    expect_same(hasty->scene(), whole());
    const auto patient = begin(request());
    EXPECT_EQ(run(*patient, {~0u, 3'600'000'000ull}), 1u);
    expect_same(patient->scene(), whole());
    const auto both = begin(request());
    EXPECT_EQ(run(*both, {2, 3'600'000'000ull}), (steps + 1) / 2);
}

TEST(engine_job_generation, progress_is_told_once_before_and_once_after_all)
{
    std::vector<JobProgress> heard;
    JobCallbacks callbacks;
    callbacks.progress = [&](const JobProgress& p) { heard.push_back(p); };
    const auto world = begin(request(), callbacks);
    ASSERT_EQ(heard.size(), 1u);
    EXPECT_EQ(heard.front().done, 0u);
    EXPECT_EQ(heard.front().total, street().cells.size());
    const size_t steps = run(*world);
    ASSERT_EQ(heard.size(), steps + 2);
    EXPECT_EQ(heard[1].part, 1. / 3);
    EXPECT_GT(heard[1].device_bytes, 0u);
    for (size_t i = 1; i < heard.size(); ++i) {
        EXPECT_GE(heard[i].done, heard[i - 1].done);
        EXPECT_EQ(heard[i].ended, i + 1 == heard.size());
    }
    EXPECT_EQ(heard.back().done, heard.back().total);
}

void expect_refusal(WorldRequest request, ErrorCode code, std::string_view text, const VoxelGrid& grid = street())
{
    const auto world = open_world(device(), std::move(request), labels_of_grid(grid));
    ASSERT_FALSE(world);
    EXPECT_EQ(world.error().code, code);
    EXPECT_NE(world.error().message.find(text), std::string::npos) << world.error().message;
}

TEST(engine_job_generation, what_cannot_be_is_refused_before_any_work)
{
    WorldRequest odd = request();
    odd.settings.guidance.scale = -1;
    expect_refusal(odd, ErrorCode::usage, "guidance");
    odd = request();
    odd.settings.regions.region_size = 0;
    expect_refusal(odd, ErrorCode::bad_input, "region");
    VoxelGrid coarse = street();
    coarse.voxel_size = 1.2f;
    expect_refusal(request(), ErrorCode::bad_input, "1.2 m", coarse);
    GenerationOptions unknown = options();
    unknown.sampler = "heun";
    EXPECT_EQ(resolve_generation(unknown).error().code, ErrorCode::usage);
    const auto endless =
        open_world(device(), request(), labels_of_callback(0.6f, [](const auto&, auto&) { return Status(); }));
    ASSERT_FALSE(endless);
    EXPECT_EQ(endless.error().code, ErrorCode::usage);
}

TEST(engine_job_generation, a_budget_of_memory_is_kept_or_refused)
{
    auto world = open_world(device(), request(), labels_of_grid(street()));
    ASSERT_TRUE(world) << world.error().message;
    const auto report = (*world)->estimate();
    ASSERT_TRUE(report) << report.error().message;
    DeviceOptions small;
    small.max_bytes = uint64_t((*report)["peak_device_bytes"]) / 4;
    const auto tight = *Device::create(small);
    const auto refused = open_world(*tight, request(), labels_of_grid(street()));
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, ErrorCode::out_of_memory);
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

TEST(engine_job_generation, a_preset_is_other_defaults_and_another_adapter)
{
    const ScratchFolder folder;
    std::filesystem::copy(options().model, folder / "voxfield_transformer");
    folder.put("model_index.json", R"({
        "defaults": {"num_inference_steps": 4, "guidance_scale": 1, "distilled_steps": 4, "jump_length": 2},
        "presets": {"quality": {"adapter": "quality.safetensors", "num_inference_steps": 16, "guidance_scale": 2.25,
                                "distilled_steps": null}}})");
    const auto resolved = [&](const std::string& preset) {
        GenerationOptions o;
        o.model = folder.path();
        o.preset = preset;
        return resolve_generation(o);
    };
    EXPECT_EQ(resolved("")->steps, 4);
    EXPECT_TRUE(resolved("")->model.adapter.empty());
    const auto none = resolved("fast"), missing = resolved("quality");
    ASSERT_FALSE(none || missing);
    EXPECT_EQ(none.error().code, ErrorCode::usage);
    EXPECT_EQ(none.error().message, "no preset of the model is called 'fast'; choose from quality");
    EXPECT_EQ(missing.error().code, ErrorCode::bad_input);
    folder.put("voxfield_transformer/quality.safetensors", "");
    const auto quality = resolved("quality");
    ASSERT_TRUE(quality) << quality.error().message;
    EXPECT_EQ(quality->model.adapter, folder / "voxfield_transformer/quality.safetensors");
    EXPECT_EQ(quality->steps, 16);
    EXPECT_EQ(quality->guidance.scale, 2.25f);
    EXPECT_EQ(quality->repaint.jump_length, 2) << "as in the defaults";
    EXPECT_TRUE(quality->model.warnings.empty()) << "it is not distilled";
    std::filesystem::create_directory(folder / "voxfield_scheduler");
    folder.put("voxfield_scheduler/scheduler_config.json",
               R"({"_class_name": "DDPMScheduler", "prediction_type": "sample", "variance_type": "analytic",
                   "prediction_errors": [[0, 0.25, 0.5]]})");
    folder.put("model_index.json", R"({"defaults": {"prediction_error_scale": 2}})");
    EXPECT_EQ(resolved("")->model.scheduler.prediction_errors[0].places, 0.5);
    EXPECT_EQ(resolved("")->model.scheduler.prediction_errors[0].colors, 1);
    for (const char* odd :
         {R"({"presets": {"quality": {"adapter": "../quality.safetensors"}}})", "[]", R"({"presets": 3})",
          R"({"presets": {"quality": 3}})", R"({"presets": {"quality": {"adapter": 3}}})",
          R"({"defaults": 3, "presets": {"quality": {}}})"}) {
        folder.put("model_index.json", odd);
        const auto refused = resolved("quality");
        ASSERT_FALSE(refused) << odd;
        EXPECT_EQ(refused.error().code, ErrorCode::bad_input) << odd;
    }
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
    EXPECT_NE(scale[0].find("guided already, and `cfg_scale` 2 guides it twice"), std::string::npos) << scale[0];
    const auto steps = warnings([](GenerationOptions& o) { o.steps = 5; });
    ASSERT_EQ(steps.size(), 1u);
    EXPECT_EQ(steps[0], "the model was distilled for 4 steps of ddpm, not 5 of ddpm");
    const auto sampler = warnings([](GenerationOptions& o) { o.sampler = "ddim"; });
    ASSERT_EQ(sampler.size(), 1u);
    EXPECT_EQ(sampler[0], "the model was distilled for 4 steps of ddpm, not 4 of ddim");
    folder.put("model_index.json",
               R"({"defaults": {"num_inference_steps": 4, "guidance_scale": 1, "distilled_steps": 6}})");
    EXPECT_TRUE(warnings([](GenerationOptions&) {}).empty());
    EXPECT_TRUE(warnings([](GenerationOptions& o) { o.steps = 6; }).empty());
    for (const int odd : {3, 7}) {
        const auto said = warnings([&](GenerationOptions& o) { o.steps = odd; });
        ASSERT_EQ(said.size(), 1u);
        EXPECT_EQ(said[0], fmt::format("the model was distilled for 4 to 6 steps of ddpm, not {} of ddpm", odd));
    }
}

} // namespace engine_job_generation_test
} // namespace semrover
