// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover eval seams GRID: how far colours differ from one voxel to the next, across the borders of tiles and inside
#include "engine/scene/tiles.h"
#include "engine/world/generation_settings.h"
#include "runtime/base/json.h"
#include "runtime/base/quote.h"
#include "tools/cli/value_options.h"
#include "tools/eval/color_steps.h"
#include "tools/measure/eval.h"

#include <CLI/CLI.hpp>

namespace semrover {

namespace {

struct EvalSeamsArguments {
    std::string grid;
    double tile_size = kUsualTileSize;
};

Json steps_json(const ColorSteps& s)
{
    return {{"pairs", s.pairs}, {"mean", s.mean()}, {"deviation", s.deviation()}};
}

Status eval_seams(const EvalSeamsArguments& o, const Globals& globals)
{
    SR_TRY(const VoxelGrid grid, read_grid_or_tiles(o.grid));
    SR_TRY(const int32_t edge, tile_cells_of(o.tile_size, grid.voxel_size));
    const SeamSteps s = seam_steps(grid, edge);
    if (!s.inside.pairs || !s.across.pairs)
        return fail(ErrorCode::bad_input, "{}: no neighbours with points on both sides of a border of tiles",
                    quote_path(o.grid));
    const double ratio = s.inside.mean() > 0 ? s.across.mean() / s.inside.mean() : 0;
    if (globals.json)
        fmt::print("{}\n", json_text(Json{{"metric", "seams"},
                                          {"tile_cells", edge},
                                          {"across", steps_json(s.across)},
                                          {"inside", steps_json(s.inside)},
                                          {"ratio", ratio}}));
    else
        fmt::print("across borders {:.2f} ({} pairs), inside tiles {:.2f} ({} pairs), ratio {:.3f}\n", s.across.mean(),
                   s.across.pairs, s.inside.mean(), s.inside.pairs, ratio);
    return {};
}

} // namespace

void add_eval_seams(CLI::App& eval, const Globals& globals, Run& run)
{
    auto o = std::make_shared<EvalSeamsArguments>();
    CLI::App* c = eval.add_subcommand("seams", "steps of colour between neighbouring voxels, across tiles and inside");
    c->add_option("GRID", o->grid, ".sgrid with points, or a folder of tiles")->required();
    add_number(*c, "--tile-size", o->tile_size, "metres of a tile's edge (9.6)", 0.01, 1e6);
    c->callback([o, &globals, &run] { run = [o, &globals] { return eval_seams(*o, globals); }; });
}

} // namespace semrover
