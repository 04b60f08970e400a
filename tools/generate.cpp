// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover generate GRID -m MODEL -o OUT.sgrid: fills a semantic grid with points, region by region
#include "runtime/base/hash.h"
#include "tools/cli/commands.h"
#include "tools/cli/open_device.h"
#include "tools/cli/version.h"
#include "tools/export_ply.h"
#include "tools/generate_along.h"
#include "tools/generation.h"
#include "tools/scene_input.h"

#include <CLI/CLI.hpp>

namespace semrover {

namespace {

struct GenerateArguments {
    std::string grid, output;
    uint64_t seed = 0;
    GenerationOptions generation;
    PlyExports ply;
    SceneInputOptions input;
    AlongOptions along;
};

// of the file, or of what another program's file became: that depends on options and on other files
Result<uint64_t> hash_input(const GenerateArguments& o, const VoxelGrid& grid)
{
    if (o.input.from.empty() && Path(o.grid).extension() == ".sgrid")
        return hash_file(o.grid);
    Hash hash;
    hash.add(fmt::format("{}", grid.voxel_size));
    hash.add(std::as_bytes(std::span(grid.cells)));
    hash.add(std::as_bytes(std::span(grid.labels)));
    hash.add(std::as_bytes(std::span(grid.points)));
    hash.add(std::as_bytes(std::span(grid.colors)));
    hash.add(std::as_bytes(std::span(grid.generated)));
    return hash.value();
}

Status finish(const GenerateArguments& o, Generation& g, VoxelGrid& grid, RunFolder& run, const std::string& model_hash,
              const Globals& globals)
{
    grid.metadata["seed"] = std::to_string(o.seed);
    grid.metadata["tool"] = kProgram;
    grid.metadata["model"] = model_hash;
    if (o.ply.any())
        SR_CHECK(export_ply(g.device(), grid, o.ply));
    SR_CHECK(write_grid(o.output, grid));
    SR_TRY(const uint64_t hash, hash_file(o.output));
    Json results = g.results_json();
    results["output"] = Path(o.output).filename().string();
    results["xxh64"] = hash_text(hash);
    SR_CHECK(run.finish(results));
    SR_CHECK(g.write_profile());
    if (globals.json)
        fmt::print("{}\n", results.dump());
    return {};
}

Status check_output(const GenerateArguments& o, const Globals& globals)
{
    if (o.output.empty())
        return fail(ErrorCode::usage, "-o/--output is required");
    for (const std::string& path : {o.output, o.ply.points, o.ply.splats_3d, o.ply.splats_2d})
        if (!path.empty())
            SR_CHECK(check_writable(path, globals));
    return {};
}

Status generate(const GenerateArguments& o, const Globals& globals)
{
    if (!o.along.path.empty()) {
        if (o.ply.any())
            return fail(ErrorCode::usage, "--ply and its like have no meaning with --along: convert what it writes");
        return generate_along({o.grid, o.output, o.seed}, o.along, o.generation, globals);
    }
    if (!o.generation.dry_run)
        SR_CHECK(check_output(o, globals));
    Generation g(o.generation, globals);
    SR_CHECK(g.resolve());
    SR_TRY(VoxelGrid grid, load_grid(o.grid, o.input, globals));
    SR_TRY(const uint64_t grid_hash, hash_input(o, grid));
    SR_CHECK(g.open());
    SR_CHECK(g.begin(grid, g.settings().regions));
    SR_CHECK(g.load(o.seed));
    if (o.generation.dry_run)
        return g.report_dry_run();
    SR_TRY(Json settings, g.settings_json("generate", grid_hash));
    settings["seed"] = o.seed;
    // -y starts over only what is finished: an interrupted run with these settings goes on
    SR_TRY(RunFolder run, open_run(o.output + ".run", settings, globals.yes));
    SR_CHECK(g.fill(run, o.output));
    return finish(o, g, grid, run, settings["model"], globals);
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
    c->add_option("-m,--model", o->generation.model, "model folder")->required();
    c->add_option("-o,--output", o->output, ".sgrid to write; OUTPUT.run beside it keeps the run's state");
    c->add_option("-s,--seed", o->seed, "noise seed");
    add_generation_options(*c, o->generation);
    c->add_option("--strategy", o->generation.strategy,
                  "complete, or paper (Algorithm 1 as printed: may leave cells empty)")
        ->check(CLI::IsMember({"complete", "paper"}));
    c->add_option("--first-cell", o->generation.first_cell, "index of the cell to start from");
    c->add_option("--ply", o->ply.points, "also write the points with colour and label as PLY");
    c->add_option("--ply-3dgs", o->ply.splats_3d, "also write the splats as a 3DGS PLY");
    c->add_option("--ply-2dgs", o->ply.splats_2d, "also write the splats as a 2DGS PLY");
    add_along_options(*c, o->along);
    c->callback([o, &globals, &run] { run = [o, &globals] { return generate(*o, globals); }; });
}

} // namespace semrover
