// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover generate GRID -m MODEL -o OUT: fills a semantic grid with points; with --along, the tiles along a trajectory
#include "tools/cli/run_job.h"
#include "tools/cli/value_options.h"
#include "tools/commands/generate_runs.h"

#include <CLI/CLI.hpp>

namespace semrover {

namespace {

Status generate(const std::shared_ptr<GenerateArguments>& o, const Globals& globals)
{
    std::unique_ptr<GenerateRun> run;
    if (o->along.empty())
        run = std::make_unique<GridRun>(*o, globals);
    else
        run = std::make_unique<TilesRun>(*o, globals);
    SR_TRY(bool done, run->begin());
    while (!done) {
        const Result<bool> step =
            interrupt_requested() ? fail(ErrorCode::interrupted, "") : run->world().step(JobBudget::one_submit());
        if (!step)
            return stopped(step.error(), run->kept_in());
        SR_CHECK(run->check_step());
        done = *step;
    }
    return run->end();
}

} // namespace

void add_generate(CLI::App& app, const Globals& globals, Run& run)
{
    const auto o = std::make_shared<GenerateArguments>();
    CLI::App* c = app.add_subcommand("generate", "semantic grid to coloured points, region by region");
    c->add_option(
         "GRID", o->grid,
         ".sgrid, .npz, .label, .vox or .ply (voxels that have points are kept as they are), or a folder of tiles")
        ->required();
    add_scene_input_options(*c, o->input);
    c->add_option("-m,--model", o->generation.options.model, "model folder")->required();
    c->add_option("-o,--output", o->output,
                  ".sgrid to write, with --along a folder of tiles; OUTPUT.run beside it keeps the run's state");
    add_seed(*c, "-s,--seed", o->seed, "noise seed");
    c->add_option(
        "--objects", o->objects,
        "boxes and colours that condition the model: objects.json, auto (guessed from the labels and the seed) "
        "or none; they are written beside OUTPUT");
    add_generation_options(*c, o->generation);
    add_choice(
        *c, "--strategy", {"rim", "complete", "paper"},
        "which voxels make a region: new ones and a rim of known ones; the nearest; or as Algorithm 1 is printed "
        "(may leave voxels empty)",
        [o](const std::string& text) {
            for (const auto s : {RegionStrategy::rim, RegionStrategy::complete, RegionStrategy::paper})
                if (text == region_strategy_name(s))
                    o->generation.options.strategy = s;
        });
    add_number(*c, "--first-cell", o->generation.options.first_cell, "index of the voxel to start from", 0, 1ll << 40);
    c->add_option("--ply", o->ply.points, "also write the points with colour and label as PLY");
    c->add_option("--ply-3dgs", o->ply.splats_3d, "also write the splats as a 3DGS PLY");
    c->add_option("--ply-2dgs", o->ply.splats_2d, "also write the splats as a 2DGS PLY");
    CLI::Option* along = c->add_option("--along", o->along,
                                       "trajectory: generate the tiles near it, in the order of tiles, into a folder "
                                       "of tiles, with memory that does not grow");
    add_placement_options(*c, o->placement);
    add_number(*c, "--horizon", o->horizon, "--along: metres from the path, seen from above, that are generated", 0.1,
               1000)
        ->needs(along);
    add_choice(*c, "--order", {"scene", "tiles"},
               "of regions: one over the whole scene, or tile by tile, where the points of a place depend on the "
               "labels near it alone",
               o->order);
    add_number(*c, "--tile-size", o->tile_size,
               "metres of a tile's edge in the order of tiles; another value gives other points", 0.01, 1e6);
    c->callback([o, &globals, &run] { run = resuming(std::bind_front(generate, o, std::cref(globals))); });
}

} // namespace semrover
