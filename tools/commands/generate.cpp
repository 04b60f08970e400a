// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover generate GRID -m MODEL -o OUT.sgrid: fills a semantic grid with points, region by region; with --along,
// grows it along a camera path into a folder of tiles
#include "engine/job/generation.h"
#include "engine/job/growth.h"
#include "engine/job/outputs.h"
#include "runtime/base/hash.h"
#include "tools/cli/choice.h"
#include "tools/cli/number_option.h"
#include "tools/cli/option_meaning.h"
#include "tools/cli/path_options.h"
#include "tools/cli/run_job.h"
#include "tools/commands/generation_options.h"
#include "tools/commands/scene_input.h"

#include <CLI/CLI.hpp>

namespace semrover {

namespace {

struct GenerateArguments {
    std::string grid, output, objects = "auto", order = "scene";
    std::optional<double> tile_size;
    uint64_t seed = 0;
    GenerationArguments generation;
    PlyExports ply;
    SceneInputOptions input;
    GrowthRequest along;   // with a path: --along
    PathOptions placement; // of it
};

Status generate_along(const GenerateArguments& o, const Globals& globals)
{
    if (o.ply.any())
        return fail(ErrorCode::usage, "--ply and its like have no meaning with --along: convert what it writes");
    if (o.order == "tiles")
        return fail(ErrorCode::usage, "--order tiles has no meaning with --along");
    for (const std::string_view& name : scene_input_options())
        if (name != "--origin") // the path's: the scaffold has its place
            SR_CHECK(refuse_given(*o.input.command, {&name, 1}, "--along, whose scaffold is a grid of ours"));
    PathOptions placement = o.placement;
    if (placement.origin.empty())
        placement.origin = o.input.origin;
    GrowthRequest request = o.along;
    SR_TRY(request.placement, placement_of(placement));
    request.generation = o.generation.options;
    request.tile_size = o.tile_size.value_or(request.tile_size);
    request.scaffold = o.grid;
    request.output = o.output;
    request.seed = o.seed;
    SR_TRY(request.objects, given_objects(o.objects));
    request.replace = globals.yes;
    SR_TRY(GrowthPlan plan, plan_growth(request, !o.generation.dry_run));
    return run_on_device(
        o.generation, globals, [&](Device& d, const JobCallbacks& c) { return begin_growth(d, std::move(plan), c); },
        [&](Device& d, const JobCallbacks& c) { return estimate_growth(d, std::move(plan), c); });
}

Status generate(const GenerateArguments& o, const Globals& globals)
{
    if (o.output.empty() && !o.generation.dry_run)
        return fail(ErrorCode::usage, "-o/--output is required");
    if (o.along.path.empty() && o.order == "scene" && o.tile_size)
        return fail(ErrorCode::usage, "--tile-size has a meaning with --order tiles and --along");
    if (!o.along.path.empty())
        return generate_along(o, globals);
    SR_CHECK(refuse_given(*o.input.command, placement_options(), "a grid without --along"));
    GenerationRequest request{.settings = {}, .seed = o.seed, .output = o.output, .ply = o.ply, .replace = globals.yes};
    if (!o.generation.dry_run && !finished_results(o.output + ".run", Json())) // that one may be the same
        SR_CHECK(check_generation_outputs(request));
    GenerationOptions options = o.generation.options;
    if (o.order == "tiles")
        options.tile_size = o.tile_size.value_or(kUsualTileSize);
    SR_TRY(request.settings, resolve_generation(options));
    SR_TRY(request.objects, given_objects(o.objects));
    SR_TRY(VoxelGrid grid, load_grid(o.grid, o.input, globals));
    // what another program's file became depends on options and on other files
    if (o.input.from.empty() && Path(o.grid).extension() == ".sgrid") {
        SR_TRY(request.grid_hash, hash_file(o.grid));
    }
    return run_on_device(
        o.generation, globals,
        [&](Device& d, const JobCallbacks& c) { return begin_generation(d, std::move(grid), request, c); },
        [&](Device& d, const JobCallbacks& c) { return estimate_generation(d, std::move(grid), request, c); });
}

} // namespace

void add_generate(CLI::App& app, const Globals& globals, Run& run)
{
    auto o = std::make_shared<GenerateArguments>();
    CLI::App* c = app.add_subcommand("generate", "semantic grid to coloured points, region by region");
    c->add_option(
         "GRID", o->grid,
         ".sgrid, .npz, .label, .vox or .ply (cells that have points are kept as they are), or a folder of tiles")
        ->required();
    add_scene_input_options(*c, o->input);
    c->add_option("-m,--model", o->generation.options.model, "model folder")->required();
    c->add_option("-o,--output", o->output, ".sgrid to write; OUTPUT.run beside it keeps the run's state");
    add_seed(*c, "-s,--seed", o->seed, "noise seed");
    c->add_option(
        "--objects", o->objects,
        "boxes and colours that condition the model: objects.json, auto (guessed from the labels and the seed) "
        "or none; they are written beside OUTPUT");
    add_generation_options(*c, o->generation);
    add_choice(*c, "--strategy", {"rim", "complete", "paper"},
               "which cells make a region: new ones and a rim of known ones; the nearest; or as Algorithm 1 is printed "
               "(may leave cells empty)",
               [o](const std::string& text) {
                   for (const auto s : {RegionStrategy::rim, RegionStrategy::complete, RegionStrategy::paper})
                       if (text == region_strategy_name(s))
                           o->generation.options.strategy = s;
               });
    add_number(*c, "--first-cell", o->generation.options.first_cell, "index of the cell to start from", 0, 1ll << 40);
    c->add_option("--ply", o->ply.points, "also write the points with colour and label as PLY");
    c->add_option("--ply-3dgs", o->ply.splats_3d, "also write the splats as a 3DGS PLY");
    c->add_option("--ply-2dgs", o->ply.splats_2d, "also write the splats as a 2DGS PLY");
    CLI::Option* along =
        c->add_option("--along", o->along.path,
                      "camera path: grow the scaffold along it into a folder of tiles, with memory that does not grow");
    add_placement_options(*c, o->placement);
    add_number(*c, "--horizon", o->along.horizon, "--along: metres from the path, seen from above, that are generated",
               0.1, 1000)
        ->needs(along);
    add_number(*c, "--window", o->along.window, "--along: metres of path at a time; another value gives another world",
               0.1, 1000);
    add_choice(*c, "--order", {"scene", "tiles"},
               "of regions: one over the whole scene, or tile by tile, where the points of a place depend on the "
               "labels near it alone",
               o->order);
    add_number(*c, "--tile-size", o->tile_size,
               "metres of a tile's edge: --order tiles (9.6; another value gives other points), --along (38.4), "
               "when the scaffold is one .sgrid",
               0.01, 1e6);
    c->callback([o, &globals, &run] { run = resuming(globals, [o, &globals] { return generate(*o, globals); }); });
}

} // namespace semrover
