// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/commands/generation_options.h"

#include "tools/cli/progress.h"
#include "tools/cli/session.h"
#include "tools/cli/value_options.h"

#include <CLI/CLI.hpp>

namespace semrover {

Result<GivenObjects> given_objects(const std::string& option)
{
    if (option == "auto")
        return GivenObjects();
    if (option == "none")
        return GivenObjects(std::in_place);
    return read_objects(option).map(
        [](std::vector<SceneObject>&& objects) { return GivenObjects(std::move(objects)); });
}

void add_generation_options(CLI::App& c, GenerationArguments& a)
{
    GenerationOptions& o = a.options;
    add_number(c, "--steps", o.steps, "denoising steps", 1, 10000);
    add_number(c, "--cfg-scale", o.guidance_scale, "guidance towards the labels; 1: none", 0, 1000);
    add_number(c, "--cfg-from", o.guidance_from, "timestep below which steps are not guided, which halves their cost",
               0, kLastTimestep);
    add_number(c, "--cfg-until", o.guidance_until, "timestep above which steps are not guided", 0, kLastTimestep);
    add_number(c, "--cfg-radius", o.guidance_radius,
               "metres beyond which voxels without labels see no others: guidance towards what neighbors agree on", 0,
               kWholeRadius);
    add_choice(c, "--sampler", {"ddpm", "ddim", "dpm++2m"}, "of the noise schedule", o.sampler);
    c.add_option("--preset", o.preset, "of the model's, in place of its defaults (docs/models.md)");
    add_number(c, "--jump-length", o.jump_length, "RePaint: steps of a jump back", 0, 10000);
    add_number(c, "--jump-n-sample", o.jump_n_sample, "RePaint: passes over each jump", 1, 10000);
    add_choice(c, "--known-tokens", {"noised", "clean"},
               "how the network sees voxels that are there: as the model says, or",
               [&o](const std::string& text) { o.known = text == "clean" ? KnownTokens::clean : KnownTokens::noised; });
    add_number(c, "--batch", o.batch, "regions at a time; any value gives the same bytes", 1u, 1024u);
    add_number(c, "--region-size", o.region_size, "voxels of a region", 1, 4096);
    add_number(c, "--coverage-threshold", o.coverage_threshold, "new voxels that a region must have", 1, 4096);
    add_precision_option(c, o.precision);
    c.add_option("--profile", a.profile, "write device times as a Chrome trace");
    c.add_flag("--dry-run", a.dry_run, "only say how many regions, how much memory, how long");
}

void print_estimate(const Json& e, const Globals& globals)
{
    const auto count = [&e](const char* name) { return e[name].get<size_t>(); };
    if (globals.session)
        globals.session->results = e;
    else if (globals.json)
        fmt::print("{}\n", json_text(e));
    else
        fmt::print(
            "{} voxels in {} regions, {} at a time, {} network steps each\npeak device memory {}\nabout {} on {}\n",
            count("cells"), count("regions"), count("batch"), count("steps"), bytes_text(count("peak_device_bytes")),
            duration_text(e["seconds"]), e["device"].get<std::string>());
}

void print_results(const Json& results, const Globals& globals)
{
    if (globals.session)
        globals.session->results = results;
    else if (globals.json)
        fmt::print("{}\n", json_text(results));
    else if (!globals.quiet)
        for (const Json& output : results.value("outputs", Json::array()))
            fmt::print("{}\n", output["output"].get<std::string>());
}

} // namespace semrover
