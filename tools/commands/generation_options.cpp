// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/commands/generation_options.h"

#include "tools/cli/choice.h"
#include "tools/cli/number_option.h"
#include "tools/cli/open_device.h"
#include "tools/cli/progress.h"
#include "tools/cli/run_job.h"

#include <CLI/CLI.hpp>

namespace semrover {

namespace {

RegenerationOutputs outputs_of(const RegenerationArguments& o, const Globals& globals)
{
    return {o.output, o.seeds.empty() ? std::vector<uint64_t>{o.seed.value_or(0)} : o.seeds, globals.yes};
}

void print_estimate(const Json& e, const Globals& globals)
{
    const auto count = [&e](const char* name) { return e[name].get<size_t>(); };
    if (globals.json)
        fmt::print("{}\n", e.dump());
    else if (e.contains("metres"))
        fmt::print("{:.0f} m in {} windows: {} cells in {} regions\npeak device memory {} at most\n",
                   e["metres"].get<double>(), count("windows"), count("cells"), count("regions"),
                   bytes_text(count("peak_device_bytes")));
    else
        fmt::print(
            "{} cells in {} regions, {} at a time, {} network steps each\npeak device memory {}\nabout {} on {}\n",
            count("cells"), count("regions"), count("batch"), count("steps"), bytes_text(count("peak_device_bytes")),
            duration_text(e["seconds"]), e["device"].get<std::string>());
}

void report(const Json& results, const Globals& globals)
{
    if (globals.json)
        fmt::print("{}\n", results.dump());
    else if (!globals.quiet)
        for (const Json& output : results.value("outputs", Json::array()))
            fmt::print("{}\n", output["output"].get<std::string>());
}

} // namespace

Result<GivenObjects> given_objects(const std::string& option)
{
    if (option == "auto")
        return GivenObjects();
    if (option == "none")
        return GivenObjects(std::in_place);
    return read_objects(option).map(
        [](std::vector<SceneObject>&& objects) { return GivenObjects(std::move(objects)); });
}

Result<GivenObjects> objects_of(const Path& grid, const RegenerationArguments& o)
{
    std::error_code ignored;
    const Path beside = objects_beside(grid);
    if (!o.objects.empty())
        return given_objects(o.objects);
    return given_objects(std::filesystem::exists(beside, ignored) ? beside.string() : "auto");
}

void add_generation_options(CLI::App& c, GenerationArguments& a)
{
    GenerationOptions& o = a.options;
    add_number(c, "--steps", o.steps, "denoising steps", 1, 10000);
    add_number(c, "--cfg-scale", o.guidance_scale, "guidance towards the labels; 1: none", 0, 1000);
    add_number(c, "--cfg-from", o.guidance_from, "timestep below which steps are not guided, which halves their cost", 0,
               kLastTimestep);
    add_number(c, "--cfg-until", o.guidance_until, "timestep above which steps are not guided", 0, kLastTimestep);
    add_number(c, "--cfg-radius", o.guidance_radius,
               "metres beyond which cells without labels see no others: guidance towards what neighbors agree on", 0,
               kWholeRadius);
    add_choice(c, "--sampler", {"ddpm", "ddim", "dpm++2m"}, "of the noise schedule", o.sampler);
    add_choice(c, "--preset", {"fast", "standard", "paper"},
               "fast (20 steps), standard (50, RePaint 5/2), paper (250, RePaint 10/10, DDPM)", o.preset);
    add_number(c, "--jump-length", o.jump_length, "RePaint: steps of a jump back", 0, 10000);
    add_number(c, "--jump-n-sample", o.jump_n_sample, "RePaint: passes over each jump", 1, 10000);
    add_choice(c, "--known-tokens", {"noised", "clean"},
               "how the network sees cells that are there: as the model says, or",
               [&o](const std::string& text) { o.known = text == "clean" ? KnownTokens::clean : KnownTokens::noised; });
    add_number(c, "--batch", o.batch, "regions at a time; any value gives the same bytes", 1u, 1024u);
    add_number(c, "--region-size", o.region_size, "cells of a region", 1, 4096);
    add_number(c, "--coverage-threshold", o.coverage_threshold, "new cells that a region must have", 1, 4096);
    add_precision_option(c, o.precision);
    c.add_option("--profile", a.profile, "write device times as a Chrome trace");
    c.add_flag("--dry-run", a.dry_run, "only say how many regions, how much memory, how long");
}

Status run_on_device(const GenerationArguments& o, const Globals& globals, const BeginOnDevice& begin,
                     const EstimateOnDevice& estimate)
{
    SR_TRY(const auto device, open_device(globals, o.profile));
    if (o.dry_run) {
        SR_TRY(const Json expected, estimate(*device, JobDisplay(globals).callbacks()));
        print_estimate(expected, globals);
        return {};
    }
    SR_TRY(const Json results, run_job(globals, [&](const JobCallbacks& c) { return begin(*device, c); }));
    SR_CHECK(write_profile(*device, o.profile, globals));
    report(results, globals);
    return {};
}

void add_regeneration_options(CLI::App& c, RegenerationArguments& o)
{
    c.add_option("-m,--model", o.generation.options.model, "model folder");
    c.add_option("-o,--output", o.output, "what to write; OUTPUT.undo beside it takes it back");
    c.add_option(
        "--objects", o.objects,
        "boxes and colours that condition the model: objects.json, auto (guessed from the labels and the seed) "
        "or none; by default the file beside GRID, or else auto");
    add_seed(c, "-s,--seed", o.seed, "noise seed");
    add_seeds(c, "--seeds", o.seeds, "several seeds, such as 1,2,3: writes OUTPUT-seedN.sgrid for each");
    add_generation_options(c, o.generation);
}

Status check_outputs(const Path& input, const RegenerationArguments& o, const Globals& globals)
{
    if (!o.seeds.empty() && o.seed)
        return fail(ErrorCode::usage, "--seed and --seeds exclude each other");
    SR_CHECK(check_seeds(o.seeds));
    if (o.generation.options.model.empty() && (!o.seeds.empty() || o.seed || o.generation.dry_run))
        return fail(ErrorCode::usage, "--seed, --seeds and --dry-run need a model: without -m nothing is generated");
    return o.generation.dry_run ? Status() : check_regeneration_outputs(input, outputs_of(o, globals));
}

Status regenerate(Regeneration what, const RegenerationArguments& o, const Globals& globals)
{
    const GenerationArguments& g = o.generation;
    const RegenerationOutputs outputs = outputs_of(o, globals);
    if (g.options.model.empty() || what.targets.empty()) {
        if (g.dry_run) {
            fmt::print("nothing to generate\n");
            return {};
        }
        SR_TRY(const Json results, leave_without_points(what, outputs));
        report(results, globals);
        return {};
    }
    SR_TRY(const GenerationSettings settings, resolve_generation(g.options));
    return run_on_device(
        g, globals,
        [&](Device& d, const JobCallbacks& c) { return begin_regeneration(d, std::move(what), outputs, settings, c); },
        [&](Device& d, const JobCallbacks& c) {
            return estimate_regeneration(d, std::move(what), outputs, settings, c);
        });
}

} // namespace semrover
