// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover inpaint GRID -m MODEL -o OUT --box ...: regenerates chosen cells, the rest staying byte for byte
#include "engine/scene/edit_script.h"
#include "runtime/base/hash.h"
#include "runtime/base/quote.h"
#include "tools/cli/commands.h"
#include "tools/regeneration.h"

#include <algorithm>
#include <CLI/CLI.hpp>

namespace semrover {

namespace {

struct InpaintArguments {
    std::string grid, label, box, sphere, object, mask;
    RegenerationOptions out;
};

Result<CellSelection> selection_of(const InpaintArguments& o)
{
    CellSelection s;
    if (!o.label.empty()) {
        SR_TRY(s.label, parse_class(o.label));
    }
    if (!o.box.empty()) {
        SR_TRY(s.box, parse_box(o.box));
    }
    if (!o.sphere.empty()) {
        SR_TRY(s.sphere, parse_sphere(o.sphere));
    }
    if (!o.object.empty()) {
        SR_TRY(s.object, parse_cell(o.object));
    }
    return s;
}

// the cells that a second grid has, too
Status keep_masked(std::vector<uint32_t>& cells, const VoxelGrid& grid, const Path& path)
{
    SR_TRY(const VoxelGrid mask, read_grid(path));
    if (mask.voxel_size != grid.voxel_size)
        return fail(ErrorCode::bad_input, "{} has cells of {} m, the grid has cells of {} m", quote_path(path),
                    mask.voxel_size, grid.voxel_size);
    std::erase_if(cells, [&](uint32_t c) { return !find_cell(mask, grid.cells[c]); });
    return {};
}

Status inpaint(const InpaintArguments& o, const Globals& globals)
{
    SR_TRY(const CellSelection where, selection_of(o));
    if (!where.any() && o.mask.empty())
        return fail(ErrorCode::usage, "say which cells: --box, --sphere, --class, --object or --mask");
    SR_CHECK(check_outputs(o.grid, o.out, globals));
    Regeneration what;
    what.command = "inpaint";
    what.input = o.grid;
    SR_TRY(what.before, read_grid(o.grid));
    SR_TRY(what.targets, select_cells(what.before, where));
    what.request = {{"where", selection_json(where)}};
    if (!o.mask.empty()) {
        SR_CHECK(keep_masked(what.targets, what.before, o.mask));
        SR_TRY(const uint64_t hash, hash_file(o.mask));
        what.request["mask"] = hash_text(hash);
    }
    if (what.targets.empty())
        return fail(ErrorCode::bad_input, "no cell of {} is selected", quote(o.grid));
    what.grid = what.before;
    what.counts = {{"cells", what.grid.cells.size()}, {"regenerated", what.targets.size()}};
    return regenerate(what, o.out, globals);
}

} // namespace

void add_inpaint(CLI::App& app, const Globals& globals, Run& run)
{
    auto o = std::make_shared<InpaintArguments>();
    CLI::App* c = app.add_subcommand("inpaint", "regenerate chosen cells, all others staying as they are");
    c->add_option("GRID", o->grid, ".sgrid")->required();
    c->add_option("--class", o->label, "cells of this class");
    c->add_option("--box", o->box, "x0,y0,z0:x1,y1,z1 in metres: cells whose centres lie inside");
    c->add_option("--sphere", o->sphere, "x,y,z,radius in metres, likewise");
    c->add_option("--object", o->object, "i,j,k: the connected cells of one label that hold this cell");
    c->add_option("--mask", o->mask, "cells that this .sgrid has, too; of several conditions all must hold");
    add_regeneration_options(*c, o->out);
    c->get_option("--model")->required();
    c->callback([o, &globals, &run] { run = [o, &globals] { return inpaint(*o, globals); }; });
}

} // namespace semrover
