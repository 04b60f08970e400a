// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover tile GRID -o DIR: cuts a grid into tiles; semrover tile DIR --join -o GRID: puts them together again
#include "engine/job/outputs.h"
#include "engine/scene/tiles.h"
#include "runtime/base/final_name.h"
#include "runtime/base/quote.h"
#include "tools/cli/commands.h"
#include "tools/cli/output_folder.h"
#include "tools/cli/value_options.h"

#include <CLI/CLI.hpp>

namespace semrover {

namespace {

struct TileArguments {
    std::string input, output;
    double tile_size = 38.4;
    bool join = false;
};

Status join(const TileArguments& o, const Globals& globals)
{
    SR_CHECK(check_writable(o.output, globals.yes));
    SR_TRY(const TileFolder folder, TileFolder::open(o.input));
    SR_TRY(const VoxelGrid grid, folder.read_all());
    SR_CHECK(write_grid(o.output, grid));
    if (globals.json)
        fmt::print("{}\n", json_text(Json{{"tiles", folder.tiles().size()}, {"cells", grid.cells.size()}}));
    return {};
}

// an empty folder may be there: the tiles' own takes its place, whole
Status make_room(const Path& output)
{
    namespace fs = std::filesystem;
    SR_TRY(const bool there, has_folder(output));
    if (!there)
        return output.has_parent_path() ? make_folder(output.parent_path()) : Status();
    std::error_code error;
    const bool empty = fs::is_empty(output, error);
    if (!error && !empty)
        return fail(ErrorCode::usage, "{} is not empty: tiles of two scenes must not mix", quote_path(output));
    if (!error)
        fs::remove(output, error);
    if (error)
        return fail(ErrorCode::bad_input, "cannot write to {}: {}", quote_path(output), error.message());
    return {};
}

Status cut(const TileArguments& o, const Globals& globals)
{
    SR_TRY(const VoxelGrid grid, read_grid(o.input));
    SR_TRY(const int32_t edge, tile_cells_of(o.tile_size, grid.voxel_size));
    SR_CHECK(make_room(o.output));
    SR_TRY(OutputFolder out, OutputFolder::create(o.output, false));
    SR_CHECK(write_tiles(out.path(), grid, edge));
    SR_CHECK(out.commit());
    if (globals.json)
        fmt::print("{}\n", json_text(Json{{"tiles", cut_tiles(grid, edge).size()}, {"cells", grid.cells.size()}}));
    return {};
}

} // namespace

void add_tile(CLI::App& app, const Globals& globals, Run& run)
{
    auto o = std::make_shared<TileArguments>();
    CLI::App* c = app.add_subcommand("tile", "cut a grid into a folder of tiles, or join one");
    c->add_option("INPUT", o->input, ".sgrid, or with --join a folder of tiles")->required();
    c->add_option("-o,--output", o->output, "folder, or with --join a .sgrid")->required();
    CLI::Option* size =
        add_number(*c, "--tile-size", o->tile_size, "metres of a tile's edge, rounded to whole voxels", 0.01, 1e6);
    c->add_flag("--join", o->join, "put tiles together to one grid")->excludes(size);
    c->callback(
        [o, &globals, &run] { run = [o, &globals] { return o->join ? join(*o, globals) : cut(*o, globals); }; });
}

} // namespace semrover
