// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/commands/regeneration.h"

#include "engine/job/outputs.h"
#include "engine/job/version.h"
#include "runtime/base/final_name.h"
#include "runtime/base/hash.h"
#include "runtime/base/quote.h"
#include "tools/cli/open_device.h"
#include "tools/cli/run_job.h"
#include "tools/cli/value_options.h"
#include "tools/editing/editing.h"

#include <algorithm>
#include <CLI/CLI.hpp>

namespace semrover {

namespace {

namespace fs = std::filesystem;

std::vector<uint64_t> seeds_of(const RegenerationArguments& o)
{
    return o.seeds.empty() ? std::vector<uint64_t>{o.seed.value_or(0)} : o.seeds;
}

Path output_of(const RegenerationArguments& o, uint64_t seed)
{
    Path output = o.output;
    if (o.seeds.size() > 1)
        output.replace_filename(fmt::format("{}-seed{}{}", output.stem().string(), seed, output.extension().string()));
    return output;
}

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
    return is_there(undo_of(output)) ? finished_results(run_folder_of(output), settings, output) : std::nullopt;
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

// what edit and inpaint do without a model: the targets are left without points
Result<Json> leave_without_points(const Regeneration& what, const RegenerationArguments& o, const Globals& globals)
{
    Json results = what.counts;
    for (const uint64_t seed : seeds_of(o)) {
        SR_CHECK(refuse_existing(output_of(o, seed), globals.yes));
        VoxelGrid grid = what.grid;
        for (const uint32_t target : what.targets)
            if (grid.has_points())
                grid.generated[target] = 0;
        grid.metadata["tool"] = kProgram;
        SR_TRY(const Json result,
               write_result(what, output_of(o, seed), grid, what.objects.value_or(std::vector<SceneObject>())));
        results["outputs"].push_back(result);
    }
    return results;
}

// one seed: begin, then steps of the world until it is done, then end
class SeedRun {
  public:
    // transformer: the model's, shared by all seeds. settings: what decides the bytes of any of them
    SeedRun(const Regeneration& what, const GenerationSettings& generation, Device& device,
            std::shared_ptr<const Transformer> transformer, Json settings, uint64_t seed)
        : what_(what), generation_(generation), device_(device), transformer_(std::move(transformer)), seed_(seed),
          settings_(std::move(settings))
    {
        settings_["seed"] = seed_;
    }

    const Json& settings() const { return settings_; }
    Status open(const JobCallbacks& callbacks);
    Status keep_in(const Path& folder, bool replace);
    World& world() { return *world_; }
    Result<Json> end(const Path& output);

  private:
    const Regeneration& what_;
    const GenerationSettings& generation_;
    Device& device_;
    std::shared_ptr<const Transformer> transformer_;
    uint64_t seed_;
    std::vector<SceneObject> objects_; // that condition the model
    Json settings_;
    std::optional<RunFolder> run_;
    std::unique_ptr<World> world_;
};

Status SeedRun::open(const JobCallbacks& callbacks)
{
    objects_ = what_.objects.value_or(std::vector<SceneObject>());
    const bool conditioned = what_.needs_objects || !generation_.model.config.condition.empty();
    if (conditioned) {
        SR_TRY(objects_, conditioning_objects(generation_.model, what_.objects, what_.grid, seed_));
    }
    WorldRequest request{.settings = generation_, .transformer = transformer_, .seed = seed_};
    request.objects = conditioned ? objects_ : std::vector<SceneObject>();
    request.targets = what_.targets;
    SR_TRY(world_, open_world(device_, std::move(request), labels_of_grid(what_.grid), callbacks));
    return {};
}

Status SeedRun::keep_in(const Path& folder, bool replace)
{
    SR_TRY(RunFolder run, open_run(folder, settings_, replace));
    run_.emplace(std::move(run));
    semrover::keep_in(folder);
    return world_->everywhere(&*run_);
}

Result<Json> SeedRun::end(const Path& output)
{
    VoxelGrid grid = world_->scene();
    grid.metadata["tool"] = kProgram;
    grid.metadata[what_.command + "_seed"] = std::to_string(seed_);
    grid.metadata[what_.command + "_model"] = settings_["model"];
    SR_TRY(Json results, write_result(what_, output, grid, objects_));
    results["seed"] = seed_;
    results.update(world_->results());
    SR_CHECK(run_->finish(results));
    return results;
}

// steps a seed to its end, unless it was finished before
Result<Json> run_to_end(SeedRun run, const Path& output, bool several, bool warns, const Globals& globals)
{
    JobDisplay display(globals);
    JobCallbacks callbacks = display.callbacks();
    if (!warns) // of the model, as before
        callbacks.warning = {};
    const Path folder = run_folder_of(output);
    if (const auto results = finished_before(output, run.settings()); results && !globals.yes && several)
        return *results;
    SR_CHECK(refuse_existing(output, globals.yes || goes_on(folder, run.settings())));
    SR_CHECK(run.open(callbacks));
    SR_CHECK(run.keep_in(folder, globals.yes));
    SR_CHECK(step_to_end(run.world(), folder));
    return run.end(output);
}

Result<Json> generate_targets(const Regeneration& what, const RegenerationArguments& o, const Globals& globals)
{
    SR_TRY(const GenerationSettings generation, resolve_generation(o.generation.options));
    SR_TRY(const auto device, open_device(globals, o.generation.profile));
    SR_TRY(std::shared_ptr<const Transformer> transformer,
           Transformer::load(*device, generation.model.transformer, generation.precision, generation.model.adapter));
    SR_TRY(const uint64_t input, hash_file(what.input));
    SR_TRY(Json settings, settings_json(generation, *device, what.command, input));
    settings["request"] = what.request;
    if (what.objects && !what.objects->empty())
        settings["objects"] = hash_text(hash_objects(*what.objects));
    const auto run_of = [&](uint64_t seed) { return SeedRun(what, generation, *device, transformer, settings, seed); };
    const std::vector<uint64_t> seeds = seeds_of(o);
    if (o.generation.dry_run) {
        SeedRun run = run_of(seeds[0]);
        SR_CHECK(run.open({}));
        return run.world().estimate(seeds.size());
    }
    JobDisplay display(globals);
    warn_of_placement(generation.model, what.grid, display.callbacks());
    Json results = what.counts;
    for (const uint64_t seed : seeds) {
        SR_TRY(const Json one,
               run_to_end(run_of(seed), output_of(o, seed), seeds.size() > 1, seed == seeds[0], globals));
        results["outputs"].push_back(one);
    }
    SR_CHECK(write_profile(*device, o.generation.profile, globals));
    return results;
}

} // namespace

void add_regeneration_options(CLI::App& c, RegenerationArguments& o)
{
    CLI::Option* model = c.add_option("-m,--model", o.generation.options.model, "model folder");
    c.add_option("-o,--output", o.output, "what to write; OUTPUT.undo beside it takes it back");
    c.add_option(
        "--objects", o.objects,
        "boxes and colours that condition the model: objects.json, auto (guessed from the labels and the seed) "
        "or none; by default the file beside GRID, or else auto");
    const size_t others = c.get_options().size();
    add_seed(c, "-s,--seed", o.seed, "noise seed");
    add_seeds(c, "--seeds", o.seeds, "several seeds, such as 1,2,3: writes OUTPUT-seedN.sgrid for each");
    add_generation_options(c, o.generation);
    const std::vector<CLI::Option*> options = c.get_options();
    for (CLI::Option* option : std::span(options).subspan(others))
        option->needs(model);
}

Status check_outputs(const Path& input, const RegenerationArguments& o, const Globals& globals)
{
    if (!o.seeds.empty() && o.seed)
        return fail(ErrorCode::usage, "--seed and --seeds exclude each other");
    for (const uint64_t seed : o.seeds)
        if (std::ranges::count(o.seeds, seed) > 1)
            return fail(ErrorCode::usage, "--seeds: {} is given twice", seed);
    if (o.generation.dry_run)
        return {};
    if (o.output.empty())
        return fail(ErrorCode::usage, "-o/--output is required");
    for (const uint64_t seed : seeds_of(o)) {
        const Path output = output_of(o, seed);
        std::error_code ignored;
        if (fs::equivalent(input, output, ignored)) // the record of what was there is made from it at the end
            return fail(ErrorCode::usage, "input and output are the same, '{}'", output.string());
        const Path run = run_folder_of(output);
        const bool ours = is_there(run) && !finished_results(run, Json()); // it may go on: its settings will say
        if (o.seeds.size() < 2 || !finished_before(output, Json()))
            for (const Path& path : {output, objects_beside(output)})
                SR_CHECK(check_writable(path, globals.yes || ours));
        if (!is_there(run)) // the record is not of a run of ours that goes on, or of one that is finished
            SR_CHECK(check_writable(undo_of(output), globals.yes));
    }
    return {};
}

Result<GivenObjects> objects_of(const Path& grid, const RegenerationArguments& o)
{
    const Path beside = objects_beside(grid);
    if (!o.objects.empty())
        return given_objects(o.objects);
    return given_objects(is_there(beside) ? beside.string() : "auto");
}

Status regenerate(const Regeneration& what, const RegenerationArguments& o, const Globals& globals)
{
    const bool generates = !o.generation.options.model.empty() && !what.targets.empty();
    if (!generates && o.generation.dry_run) {
        fmt::print("nothing to generate\n");
        return {};
    }
    SR_TRY(const Json results, generates ? generate_targets(what, o, globals) : leave_without_points(what, o, globals));
    if (o.generation.dry_run)
        print_estimate(results, globals);
    else
        print_results(results, globals);
    return {};
}

} // namespace semrover
