// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover edit GRID -o OUT [-m MODEL] OPERATION...: changes labels or occupancy and regenerates only that and a halo
#include "engine/scene/cell_reach.h"
#include "engine/scene/edit_script.h"
#include "engine/scene/edit_undo.h"
#include "engine/scene/stamp.h"
#include "runtime/base/hash.h"
#include "runtime/base/quote.h"
#include "tools/cli/commands.h"
#include "tools/cli/version.h"
#include "tools/regeneration.h"

#include <algorithm>
#include <CLI/CLI.hpp>

namespace semrover {

namespace {

using Kind = EditOperation::Kind;

constexpr double kWidestHalo = 30; // metres

struct EditArguments {
    std::string grid, undo;
    RegenerationOptions out;
    std::vector<EditOperation> operations; // as they come on the command line, scripts in their place
    bool cut = false;
    CellSelection cut_where;
    double halo = 3;
};

template <typename T>
T parsed(Result<T> result, const char* option)
{
    if (!result)
        throw CLI::ValidationError(option, result.error().message);
    return std::move(*result);
}

CellSelection& selection(EditArguments& o, const char* option)
{
    if (o.cut)
        return o.cut_where;
    if (o.operations.empty())
        throw CLI::ValidationError(option, "comes after the operation that it belongs to");
    return o.operations.back().where;
}

EditOperation& operation(EditArguments& o, const char* option)
{
    if (o.cut || o.operations.empty())
        throw CLI::ValidationError(option, "comes after the operation that it belongs to");
    return o.operations.back();
}

EditOperation& add(EditArguments& o, Kind kind)
{
    o.operations.emplace_back();
    o.operations.back().kind = kind;
    return o.operations.back();
}

using TextHandler = std::function<void(const std::string&)>;

// options whose order counts are handled as they are met
void add_text(CLI::App& c, const char* name, const char* help, TextHandler handler)
{
    c.add_option_function<std::string>(name, std::move(handler), help)->trigger_on_parse();
}

void add_word(CLI::App& c, const char* name, const char* help, std::function<void()> handler)
{
    c.add_flag_callback(name, std::move(handler), help)->trigger_on_parse();
}

std::optional<uint8_t> class_or_all(const std::string& text, const char* option)
{
    return text == "all" ? std::nullopt : std::optional(parsed(parse_class(text), option));
}

void add_operations(CLI::App& c, EditArguments* o)
{
    add_text(c, "--remove", "class or all: cells go, and the ground under them closes",
             [o](const std::string& t) { add(*o, Kind::remove).where.label = class_or_all(t, "--remove"); });
    add_text(
        c, "--remove-object", "i,j,k: removes the connected cells of one label that hold this cell",
        [o](const std::string& t) { add(*o, Kind::remove).where.object = parsed(parse_cell(t), "--remove-object"); });
    add_text(c, "--delete", "class or all: cells go, nothing else",
             [o](const std::string& t) { add(*o, Kind::erase).where.label = class_or_all(t, "--delete"); });
    add_text(c, "--paint", "class that the selected cells get",
             [o](const std::string& t) { add(*o, Kind::paint).label = parsed(parse_class(t), "--paint"); });
    add_text(c, "--insert", "stamp (.sgrid) that is set --at x,y,z",
             [o](const std::string& t) { add(*o, Kind::insert).stamp = t; });
    add_word(c, "--copy", "the selected cells once more, moved --by x,y,z", [o] { add(*o, Kind::copy); });
    add_word(c, "--move", "the same, and they are removed where they were", [o] { add(*o, Kind::move); });
    add_word(c, "--cut", "write the selected cells as a stamp instead", [o] { o->cut = true; });
    add_text(c, "--script", "operations as JSON", [o](const std::string& t) {
        for (EditOperation& operation : parsed(read_edit_script(t), "--script"))
            o->operations.push_back(std::move(operation));
    });
}

void add_modifiers(CLI::App& c, EditArguments* o)
{
    add_text(c, "--class", "of the operation before it: only cells of this class",
             [o](const std::string& t) { selection(*o, "--class").label = class_or_all(t, "--class"); });
    add_text(c, "--box", "x0,y0,z0:x1,y1,z1 in metres: only cells whose centres lie inside",
             [o](const std::string& t) { selection(*o, "--box").box = parsed(parse_box(t), "--box"); });
    add_text(c, "--sphere", "x,y,z,radius in metres, likewise",
             [o](const std::string& t) { selection(*o, "--sphere").sphere = parsed(parse_sphere(t), "--sphere"); });
    add_text(c, "--object", "i,j,k: only the connected cells of one label that hold this cell",
             [o](const std::string& t) { selection(*o, "--object").object = parsed(parse_cell(t), "--object"); });
    add_word(c, "--fill", "of paint: empty places of the box or sphere become cells too",
             [o] { operation(*o, "--fill").fill = true; });
    add_text(c, "--at", "of insert: the cell there (metres) gets the stamp's lowest corner",
             [o](const std::string& t) { operation(*o, "--at").at = parsed(parse_point(t), "--at"); });
    add_text(c, "--by", "of copy and move: metres, rounded to whole cells",
             [o](const std::string& t) { operation(*o, "--by").by = parsed(parse_point(t), "--by"); });
    c.add_option_function<double>(
         "--rotate",
         [o](const double& t) { operation(*o, "--rotate").quarter_turns = parsed(quarter_turns(t), "--rotate"); },
         "of insert, copy and move: 0, 90, 180 or 270 degrees, counterclockwise seen from above")
        ->trigger_on_parse();
    add_text(
        c, "--points", "of insert, copy and move: keep the points that come along, or regenerate (default)",
        [o](const std::string& t) { operation(*o, "--points").keep_points = parsed(keeps_points(t), "--points"); });
}

Status undo(const EditArguments& o, const Globals& globals)
{
    if (!o.operations.empty() || o.cut || !o.out.generation.model.empty())
        return fail(ErrorCode::usage, "--undo stands alone: it takes back a whole edit");
    if (o.out.output.empty())
        return fail(ErrorCode::usage, "-o/--output is required");
    SR_CHECK(check_writable(o.out.output, globals));
    return undo_edit(o.undo, o.grid, o.out.output);
}

Status cut(const EditArguments& o, const Globals& globals)
{
    if (!o.operations.empty() || !o.out.generation.model.empty())
        return fail(ErrorCode::usage, "--cut stands alone: it writes a stamp and changes nothing");
    if (o.out.output.empty())
        return fail(ErrorCode::usage, "-o/--output is required");
    if (!o.cut_where.any())
        return fail(ErrorCode::usage, "--cut: say which cells: a class, a box, a sphere or an object");
    SR_CHECK(check_writable(o.out.output, globals));
    SR_TRY(const VoxelGrid grid, read_grid(o.grid));
    SR_TRY(const std::vector<uint32_t> cells, select_cells(grid, o.cut_where));
    if (cells.empty())
        return fail(ErrorCode::bad_input, "cut: no cell of the grid is selected");
    VoxelGrid stamp = cut_stamp(grid, cells);
    stamp.metadata["tool"] = kProgram;
    SR_CHECK(write_grid(o.out.output, stamp));
    if (globals.json)
        fmt::print("{}\n", Json{{"cells", cells.size()}, {"origin", stamp.metadata["stamp_origin"]}}.dump());
    return {};
}

// everything that decides the bytes, stamps by their content
Result<Json> request_json(const EditArguments& o)
{
    Json operations = Json::array();
    for (const EditOperation& operation : o.operations) {
        Json json = operation_json(operation);
        if (operation.kind == Kind::insert) {
            SR_TRY(const uint64_t hash, hash_file(operation.stamp));
            json["stamp"] = hash_text(hash);
        }
        operations.push_back(json);
    }
    return Json{{"operations", operations}, {"halo", o.halo}};
}

std::vector<Cell> present(const VoxelGrid& grid, const std::vector<Cell>& cells)
{
    std::vector<Cell> out;
    for (const Cell& cell : cells)
        if (find_cell(grid, cell))
            out.push_back(cell);
    return out;
}

// what changed and what lies around it, but for points that came with a stamp
std::vector<uint32_t> targets_of(const EditedGrid& edited, double halo)
{
    std::vector<uint32_t> targets =
        cells_within(edited.grid.cells, edited.touched, reach_squared(halo, edited.grid.voxel_size));
    std::erase_if(targets, [&](uint32_t c) { return std::ranges::binary_search(edited.kept, edited.grid.cells[c]); });
    return targets;
}

Status edit(const EditArguments& o, const Globals& globals)
{
    if (!o.undo.empty())
        return undo(o, globals);
    if (o.cut)
        return cut(o, globals);
    if (o.operations.empty())
        return fail(ErrorCode::usage, "no operation given (--remove, --delete, --paint, --insert, --copy, --move, "
                                      "--script; or --cut, --undo)");
    if (!(o.halo >= 0 && o.halo <= kWidestHalo))
        return fail(ErrorCode::usage, "--halo: expected 0 to {} m, found {}", kWidestHalo, o.halo);
    for (const EditOperation& operation : o.operations)
        SR_CHECK(check_operation(operation, fmt::format("--{}", operation_name(operation.kind))));
    SR_CHECK(check_outputs(o.grid, o.out, globals));
    Regeneration what;
    what.command = "edit";
    what.input = o.grid;
    SR_TRY(what.before, read_grid(o.grid));
    GridEditor editor(what.before);
    for (const EditOperation& operation : o.operations)
        SR_CHECK(editor.apply(operation));
    EditedGrid edited = editor.finish();
    if (edited.grid.cells.empty())
        return fail(ErrorCode::bad_input, "the edit leaves no cell in {}", quote(o.grid));
    const bool model = !o.out.generation.model.empty();
    // without a model nothing around the change is thrown away: only cells that changed wait for points
    what.targets = targets_of(edited, model ? o.halo : 0);
    SR_TRY(what.request, request_json(o));
    const size_t left = present(edited.grid, edited.touched).size();
    what.counts = {{"cells", edited.grid.cells.size()},
                   {"changed", edited.touched.size()},
                   {"removed", edited.touched.size() - left},
                   {"regenerated", model ? what.targets.size() : 0}};
    what.grid = std::move(edited.grid);
    return regenerate(what, o.out, globals);
}

} // namespace

void add_edit(CLI::App& app, const Globals& globals, Run& run)
{
    auto o = std::make_shared<EditArguments>();
    CLI::App* c = app.add_subcommand("edit", "change labels or occupancy, regenerate only that and a halo around it");
    c->add_option("GRID", o->grid, ".sgrid")->required();
    add_operations(*c, o.get());
    add_modifiers(*c, o.get());
    c->add_option("--halo", o->halo, "metres around what changed that are generated anew (with -m)");
    c->add_option("--undo", o->undo, "OUTPUT.undo of an edit: gives back the file that was edited");
    add_regeneration_options(*c, o->out);
    c->callback([o, &globals, &run] { run = [o, &globals] { return edit(*o, globals); }; });
}

} // namespace semrover
