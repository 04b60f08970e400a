// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover tile GRID -o DIR: cuts a grid into tiles; semrover tile DIR --join -o GRID: puts them together again
#include "engine/job/outputs.h"
#include "engine/scene/tiles.h"
#include "runtime/base/quote.h"
#include "tools/cli/commands.h"
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
        fmt::print("{}\n", Json{{"tiles", folder.tiles().size()}, {"cells", grid.cells.size()}}.dump());
    return {};
}

Status cut(const TileArguments& o, const Globals& globals)
{
    namespace fs = std::filesystem;
    std::error_code error;
    if (is_there(o.output) && !is_folder(o.output))
        return fail(ErrorCode::usage, "'{}' is a file; tiles are written to a folder", o.output);
    if (is_there(o.output) && !fs::is_empty(o.output, error))
        return fail(ErrorCode::usage, "'{}' is not empty: tiles of two scenes must not mix", o.output);
    SR_TRY(const VoxelGrid grid, read_grid(o.input));
    SR_TRY(const int32_t edge, tile_cells_of(o.tile_size, grid.voxel_size));
    const bool existed = is_there(o.output);
    if (const Status written = write_tiles(o.output, grid, edge); !written) {
        if (!existed)
            fs::remove_all(o.output, error);
        return written;
    }
    if (globals.json)
        fmt::print("{}\n", Json{{"tiles", cut_tiles(grid, edge).size()}, {"cells", grid.cells.size()}}.dump());
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
