// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/regeneration.h"

#include "engine/job/grid_filling.h"
#include "engine/job/outputs.h"
#include "engine/job/version.h"
#include "engine/scene/edit_undo.h"
#include "engine/voxfield/sub_grid.h"
#include "runtime/base/hash.h"

#include <algorithm>

namespace semrover {

namespace {

namespace fs = std::filesystem;

Path run_folder_of(const Path& output)
{
    return output.string() + ".run";
}

Path undo_of(const Path& output)
{
    return output.string() + ".undo";
}

// a seed of several that an earlier start of the same command has finished; its results
std::optional<Json> finished_before(const Path& output, const Json& settings)
{
    const auto results = finished_results(run_folder_of(output), settings);
    const auto hash = hash_file(output);
    if (!results || !hash || results->value("xxh64", Json()) != hash_text(*hash) || !fs::exists(undo_of(output)))
        return std::nullopt;
    return results;
}

// the grid with its objects, then what takes it back
Result<Json> write_result(const Regeneration& what, const Path& output, const VoxelGrid& grid,
                          std::span<const SceneObject> objects)
{
    const Together one_result;
    SR_CHECK(write_grid(output, grid));
    if (!objects.empty())
        SR_CHECK(write_objects(objects_beside(output), objects));
    SR_CHECK(write_undo(undo_of(output), what.input, what.before, output, grid));
    SR_TRY(const uint64_t hash, hash_file(output));
    return Json{{"output", output.filename().string()},
                {"undo", undo_of(output).filename().string()},
                {"xxh64", hash_text(hash)}};
}

class SeedRuns : public Job {
  public:
    SeedRuns(Device& device, Regeneration what, const RegenerationOutputs& outputs, const GenerationSettings& settings,
             const JobCallbacks& callbacks)
        : what_(std::move(what)), outputs_(outputs), generation_(settings), callbacks_(callbacks),
          filling_(device, generation_)
    {
    }

    Status prepare();
    Status begin();
    Result<Json> estimate();

    Result<bool> step(const JobBudget& budget) override;
    Result<Json> finish() override;
    void cancel() override { (void)filling_.cancel(); } // what fails then will fail again
    Path kept_in() const override { return all_done() ? Path() : run_folder_of(output()); }

  private:
    uint64_t seed() const { return outputs_.seeds[at_]; }
    Path output() const { return outputs_.of(seed()); }
    bool all_done() const { return at_ == outputs_.seeds.size(); }
    Status begin_seed();
    Status finish_seed();

    const Regeneration what_;
    const RegenerationOutputs outputs_;
    const GenerationSettings generation_;
    const JobCallbacks callbacks_;
    GridFilling filling_;
    SubGrid part_;        // what a seed fills
    VoxelGrid part_grid_; // as it was before
    RegionOptions regions_;
    std::vector<SceneObject> objects_; // that the model is told of
    Json settings_;                    // of the seed at work
    std::optional<RunFolder> run_;
    size_t at_ = 0; // seed at work
    Json done_ = Json::array();
};

Status SeedRuns::prepare()
{
    regions_ = generation_.regions;
    SR_TRY(part_, cut_sub_grid(what_.grid, what_.targets, cells_considered(regions_)));
    part_grid_ = part_.grid;
    regions_.from_known = true;
    SR_TRY(const uint64_t grid, hash_file(what_.input));
    SR_TRY(settings_, settings_json(generation_, filling_.device(), what_.command, grid));
    settings_["request"] = what_.request;
    if (what_.objects && !what_.objects->empty())
        settings_["objects"] = hash_text(hash_objects(*what_.objects));
    return {};
}

Status SeedRuns::begin()
{
    SR_CHECK(prepare());
    warn_of_placement(generation_.model, what_.grid, callbacks_);
    return begin_seed();
}

// nothing is begun for a seed that is done already: there is no run then
Status SeedRuns::begin_seed()
{
    settings_["seed"] = seed();
    if (const auto results = finished_before(output(), settings_);
        results && !outputs_.replace && outputs_.seeds.size() > 1) {
        done_.push_back(*results);
        return {};
    }
    if (fs::exists(output()) && !outputs_.replace)
        return fail(ErrorCode::usage, "'{}' exists; -y replaces it", output().string());
    part_.grid = part_grid_;
    objects_ = what_.objects.value_or(std::vector<SceneObject>());
    if (what_.needs_objects || !generation_.model.config.condition.empty()) {
        SR_TRY(objects_, told_objects(generation_.model, what_.objects, what_.grid, seed()));
    }
    SR_CHECK(filling_.cut(part_.grid, regions_, objects_));
    SR_CHECK(filling_.load(seed(), callbacks_));
    SR_TRY(RunFolder run, open_run(run_folder_of(output()), settings_, outputs_.replace));
    run_.emplace(std::move(run));
    SR_CHECK(filling_.start(&*run_));
    filling_.say(callbacks_);
    return {};
}

Result<bool> SeedRuns::step(const JobBudget& budget)
{
    if (all_done())
        return true;
    if (run_) {
        SR_TRY(const bool filled, filling_.step(budget, [this] { filling_.say(callbacks_); }));
        if (!filled)
            return false;
        filling_.say(callbacks_, true);
        SR_CHECK(finish_seed());
    }
    run_.reset();
    ++at_;
    if (!all_done())
        SR_CHECK(begin_seed());
    return all_done();
}

Status SeedRuns::finish_seed()
{
    VoxelGrid grid = what_.grid;
    put_back(grid, part_, what_.targets);
    grid.metadata["tool"] = kProgram;
    grid.metadata[what_.command + "_seed"] = std::to_string(seed());
    grid.metadata[what_.command + "_model"] = settings_["model"];
    SR_TRY(Json results, write_result(what_, output(), grid, objects_));
    results["seed"] = seed();
    results.update(filling_.results());
    SR_CHECK(run_->finish(results));
    done_.push_back(results);
    return {};
}

Result<Json> SeedRuns::finish()
{
    Json results = what_.counts;
    results["outputs"] = done_;
    return results;
}

Result<Json> SeedRuns::estimate()
{
    SR_CHECK(prepare());
    SR_CHECK(filling_.cut(part_.grid, regions_));
    SR_CHECK(filling_.load(seed(), callbacks_));
    return filling_.estimate(outputs_.seeds.size());
}

} // namespace

Path RegenerationOutputs::of(uint64_t seed) const
{
    if (seeds.size() < 2)
        return output;
    Path named = output;
    named.replace_filename(fmt::format("{}-seed{}{}", output.stem().string(), seed, output.extension().string()));
    return named;
}

Status check_seeds(const std::vector<uint64_t>& seeds)
{
    for (const uint64_t seed : seeds)
        if (std::ranges::count(seeds, seed) > 1)
            return fail(ErrorCode::usage, "--seeds: {} is given twice", seed);
    return {};
}

Status check_regeneration_outputs(const Path& input, const RegenerationOutputs& o)
{
    SR_CHECK(check_seeds(o.seeds));
    if (o.output.empty())
        return fail(ErrorCode::usage, "-o/--output is required");
    for (const uint64_t seed : o.seeds) {
        const Path output = o.of(seed);
        std::error_code ignored;
        if (fs::equivalent(input, output, ignored)) // the record of what was there is made from it at the end
            return fail(ErrorCode::usage, "input and output are the same, '{}'", output.string());
        if (o.seeds.size() < 2 || !finished_before(output, Json()))
            for (const Path& path : {output, objects_beside(output)})
                SR_CHECK(check_writable(path, o.replace));
        if (!fs::exists(run_folder_of(output))) // the record is not of a run of ours that goes on
            SR_CHECK(check_writable(undo_of(output), o.replace));
    }
    return {};
}

Result<std::unique_ptr<Job>> begin_regeneration(Device& device, Regeneration what, const RegenerationOutputs& outputs,
                                                const GenerationSettings& settings, const JobCallbacks& callbacks)
{
    SR_ASSERT(!outputs.seeds.empty() && !what.targets.empty(), "nothing to generate");
    SR_CHECK(check_regeneration_outputs(what.input, outputs));
    auto job = std::make_unique<SeedRuns>(device, std::move(what), outputs, settings, callbacks);
    SR_CHECK(job->begin());
    return job;
}

Result<Json> estimate_regeneration(Device& device, Regeneration what, const RegenerationOutputs& outputs,
                                   const GenerationSettings& settings, const JobCallbacks& callbacks)
{
    return SeedRuns(device, std::move(what), outputs, settings, callbacks).estimate();
}

Result<Json> leave_without_points(const Regeneration& what, const RegenerationOutputs& outputs)
{
    Json results = what.counts;
    results["outputs"] = Json::array();
    for (const uint64_t seed : outputs.seeds) {
        VoxelGrid grid = what.grid;
        for (const uint32_t target : what.targets)
            if (grid.has_points())
                grid.generated[target] = 0;
        grid.metadata["tool"] = kProgram;
        SR_TRY(const Json result,
               write_result(what, outputs.of(seed), grid, what.objects.value_or(std::vector<SceneObject>())));
        results["outputs"].push_back(result);
    }
    return results;
}

} // namespace semrover
