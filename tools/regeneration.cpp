// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/regeneration.h"

#include "engine/scene/edit_undo.h"
#include "engine/voxfield/sub_grid.h"
#include "runtime/base/hash.h"
#include "tools/cli/open_device.h"
#include "tools/cli/version.h"

#include <algorithm>
#include <CLI/CLI.hpp>

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
    const auto run = read_json(run_folder_of(output) / "run.json");
    if (!run || !run->is_object() || run->value("state", Json()) != "finished" ||
        (!settings.is_null() && run->value("settings", Json()) != settings) || !fs::exists(undo_of(output)))
        return std::nullopt;
    const auto hash = hash_file(output);
    const Json results = run->value("results", Json::object());
    if (!hash || !results.is_object() || results.value("xxh64", Json()) != hash_text(*hash))
        return std::nullopt;
    return results;
}

// the grid, then what takes it back
Result<Json> write_result(const Regeneration& what, const Path& output, const VoxelGrid& grid)
{
    SR_CHECK(write_grid(output, grid));
    SR_CHECK(write_undo(undo_of(output), what.input, what.before, output, grid));
    SR_TRY(const uint64_t hash, hash_file(output));
    return Json{{"output", output.filename().string()},
                {"undo", undo_of(output).filename().string()},
                {"xxh64", hash_text(hash)}};
}

void report(const Regeneration& what, const Json& outputs, const Globals& globals)
{
    if (globals.json) {
        Json all = what.counts;
        all["outputs"] = outputs;
        fmt::print("{}\n", all.dump());
    } else if (!globals.quiet) {
        for (const Json& output : outputs)
            fmt::print("{}\n", output["output"].get<std::string>());
    }
}

class SeedRuns {
  public:
    SeedRuns(const Regeneration& what, const RegenerationOptions& options, const Globals& globals)
        : what_(what), options_(options), globals_(globals), generation_(options.generation, globals)
    {
    }

    Status run();

  private:
    Status prepare();
    Result<Json> run_seed(uint64_t seed);

    const Regeneration& what_;
    const RegenerationOptions& options_;
    const Globals& globals_;
    Generation generation_;
    SubGrid part_;        // what a seed fills
    VoxelGrid part_grid_; // as it was before
    RegionOptions regions_;
    Json settings_;
};

Status SeedRuns::prepare()
{
    SR_CHECK(generation_.resolve());
    SR_CHECK(generation_.open());
    regions_ = generation_.settings().regions;
    SR_TRY(part_, cut_sub_grid(what_.grid, what_.targets, regions_.region_size));
    part_grid_ = part_.grid;
    regions_.from_known = true;
    SR_TRY(const uint64_t grid, hash_file(what_.input));
    SR_TRY(settings_, generation_.settings_json(what_.command, grid));
    settings_["request"] = what_.request;
    return {};
}

Result<Json> SeedRuns::run_seed(uint64_t seed)
{
    const Path output = output_of(options_, seed);
    Json settings = settings_;
    settings["seed"] = seed;
    if (const auto results = finished_before(output, settings);
        results && !globals_.yes && seeds_of(options_).size() > 1)
        return *results;
    if (fs::exists(output) && !globals_.yes)
        return fail(ErrorCode::usage, "'{}' exists; -y replaces it", output.string());
    part_.grid = part_grid_;
    SR_CHECK(generation_.begin(part_.grid, regions_));
    SR_CHECK(generation_.load(seed));
    SR_TRY(RunFolder run, open_run(run_folder_of(output), settings, globals_.yes));
    SR_CHECK(generation_.fill(run, output.string()));
    VoxelGrid grid = what_.grid;
    put_back(grid, part_, what_.targets);
    grid.metadata["tool"] = kProgram;
    grid.metadata[what_.command + "_seed"] = std::to_string(seed);
    grid.metadata[what_.command + "_model"] = settings["model"];
    SR_TRY(Json results, write_result(what_, output, grid));
    results["seed"] = seed;
    results.update(generation_.results_json());
    SR_CHECK(run.finish(results));
    return results;
}

Status SeedRuns::run()
{
    SR_CHECK(prepare());
    const std::vector<uint64_t> seeds = seeds_of(options_);
    if (options_.generation.dry_run) {
        SR_CHECK(generation_.begin(part_.grid, regions_));
        SR_CHECK(generation_.load(seeds.front()));
        return generation_.report_dry_run(seeds.size());
    }
    Json outputs = Json::array();
    for (const uint64_t seed : seeds) {
        SR_TRY(const Json results, run_seed(seed));
        outputs.push_back(results);
    }
    SR_CHECK(generation_.write_profile());
    report(what_, outputs, globals_);
    return {};
}

} // namespace

std::vector<uint64_t> seeds_of(const RegenerationOptions& options)
{
    return options.seeds.empty() ? std::vector<uint64_t>{options.seed.value_or(0)} : options.seeds;
}

Path output_of(const RegenerationOptions& options, uint64_t seed)
{
    const Path output = options.output;
    if (options.seeds.size() < 2)
        return output;
    Path named = output;
    named.replace_filename(fmt::format("{}-seed{}{}", output.stem().string(), seed, output.extension().string()));
    return named;
}

Status check_outputs(const Path& input, const RegenerationOptions& o, const Globals& globals)
{
    if (!o.seeds.empty() && o.seed)
        return fail(ErrorCode::usage, "--seed and --seeds exclude each other");
    for (size_t i = 0; i < o.seeds.size(); ++i)
        if (std::ranges::count(o.seeds, o.seeds[i]) > 1)
            return fail(ErrorCode::usage, "--seeds: {} is given twice", o.seeds[i]);
    if (o.generation.model.empty() && (!o.seeds.empty() || o.seed || o.generation.dry_run))
        return fail(ErrorCode::usage, "--seed, --seeds and --dry-run need a model: without -m nothing is generated");
    if (o.generation.dry_run)
        return {};
    if (o.output.empty())
        return fail(ErrorCode::usage, "-o/--output is required");
    for (const uint64_t seed : seeds_of(o)) {
        const Path output = output_of(o, seed);
        std::error_code ignored;
        if (fs::equivalent(input, output, ignored)) // the record of what was there is made from it at the end
            return fail(ErrorCode::usage, "input and output are the same, '{}'", output.string());
        if (o.seeds.size() < 2 || !finished_before(output, Json()))
            SR_CHECK(check_writable(output, globals));
        if (!fs::exists(run_folder_of(output))) // the record is not of a run of ours that goes on
            SR_CHECK(check_writable(undo_of(output), globals));
    }
    return {};
}

Status regenerate(const Regeneration& what, const RegenerationOptions& options, const Globals& globals)
{
    if (!options.generation.model.empty() && !what.targets.empty())
        return SeedRuns(what, options, globals).run();
    if (options.generation.dry_run) {
        fmt::print("nothing to generate\n");
        return {};
    }
    Json outputs = Json::array();
    for (const uint64_t seed : seeds_of(options)) {
        VoxelGrid grid = what.grid;
        for (const uint32_t target : what.targets)
            if (grid.has_points())
                grid.generated[target] = 0;
        grid.metadata["tool"] = kProgram;
        SR_TRY(const Json result, write_result(what, output_of(options, seed), grid));
        outputs.push_back(result);
    }
    report(what, outputs, globals);
    return {};
}

void add_regeneration_options(CLI::App& c, RegenerationOptions& o)
{
    c.add_option("-m,--model", o.generation.model, "model folder");
    c.add_option("-o,--output", o.output, "what to write; OUTPUT.undo beside it takes it back");
    c.add_option("-s,--seed", o.seed, "noise seed");
    c.add_option("--seeds", o.seeds, "several seeds, such as 1,2,3: writes OUTPUT-seedN.sgrid for each")
        ->delimiter(',');
    add_generation_options(c, o.generation);
}

} // namespace semrover
