// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover edit GRID -o OUT [-m MODEL] OPERATION...: changes labels or occupancy and regenerates only that and a halo
#include "engine/conditioning/scene_objects.h"
#include "engine/job/outputs.h"
#include "tools/cli/run_job.h"
#include "tools/cli/value_options.h"
#include "tools/commands/regeneration.h"
#include "tools/editing/editing.h"

#include <CLI/CLI.hpp>

namespace semrover {

namespace {

using Kind = EditOperation::Kind;

struct EditArguments {
    std::string grid, undo;
    RegenerationArguments out;
    EditRequest edit; // its operations as they come on the command line, scripts in their place
    bool cut = false;
    CellSelection cut_where;
};

template <typename T>
T parsed(Result<T> result, const char* option)
{
    if (!result)
        throw CLI::ValidationError(option, result.error().message);
    return std::move(*result);
}

EditOperation& last(EditArguments& o, const char* option)
{
    if (o.cut || o.edit.operations.empty())
        throw CLI::ValidationError(option, "comes after the operation that it belongs to");
    return o.edit.operations.back();
}

CellSelection& where(EditArguments& o, const char* option)
{
    return o.cut ? o.cut_where : last(o, option).where;
}

EditOperation& add(EditArguments& o, Kind kind)
{
    o.edit.operations.emplace_back().kind = kind;
    return o.edit.operations.back();
}

std::optional<uint8_t> class_or_all(const std::string& text, const char* option)
{
    return text == "all" ? std::nullopt : std::optional(parsed(parse_class(text), option));
}

// an option whose place on the command line counts: handled as it is met
struct OrderedOption {
    const char *name, *help;
    void (*handle)(EditArguments& o, const std::string& text, const char* name);
    bool flag = false;
};
using A = EditArguments;
using Text = const std::string;
using Name = const char*;

constexpr bool kFlag = true;
constexpr OrderedOption kOperations[] = {
    {"--remove", "class or all: voxels go, and the ground under them closes",
     [](A& o, Text& t, Name n) { add(o, Kind::remove).where.label = class_or_all(t, n); }},
    {"--remove-object", "i,j,k: removes the connected voxels of one label that hold this voxel",
     [](A& o, Text& t, Name n) { add(o, Kind::remove).where.object = parsed(parse_cell(t), n); }},
    {"--delete", "class or all: voxels go, nothing else",
     [](A& o, Text& t, Name n) { add(o, Kind::erase).where.label = class_or_all(t, n); }},
    {"--paint", "class that the selected voxels get",
     [](A& o, Text& t, Name n) { add(o, Kind::paint).label = parsed(parse_class(t), n); }},
    {"--tint", "#rrggbb: the colour of the objects that most of the selected voxels belong to",
     [](A& o, Text& t, Name n) { add(o, Kind::tint).color = parsed(parse_tint(t, n), n); }},
    {"--insert", "stamp (.sgrid) that is set --at x,y,z", [](A& o, Text& t, Name) { add(o, Kind::insert).stamp = t; }},
    {"--copy", "the selected voxels once more, moved --by x,y,z", [](A& o, Text&, Name) { add(o, Kind::copy); }, kFlag},
    {"--move", "the same, and they are removed where they were", [](A& o, Text&, Name) { add(o, Kind::move); }, kFlag},
    {"--cut", "write the selected voxels as a stamp instead", [](A& o, Text&, Name) { o.cut = true; }, kFlag},
    {"--script", "operations as JSON",
     [](A& o, Text& t, Name n) {
         std::ranges::move(parsed(read_edit_script(t), n), std::back_inserter(o.edit.operations));
     }},
    {"--class", "of the operation before it: only voxels of this class",
     [](A& o, Text& t, Name n) { where(o, n).label = class_or_all(t, n); }},
    {"--box", "x0,y0,z0:x1,y1,z1 in metres: only voxels whose centres lie inside",
     [](A& o, Text& t, Name n) { where(o, n).box = parsed(parse_box(t), n); }},
    {"--sphere", "x,y,z,radius in metres, likewise",
     [](A& o, Text& t, Name n) { where(o, n).sphere = parsed(parse_sphere(t), n); }},
    {"--object", "i,j,k: only the connected voxels of one label that hold this voxel",
     [](A& o, Text& t, Name n) { where(o, n).object = parsed(parse_cell(t), n); }},
    {"--fill", "of paint: empty places of the box or sphere become voxels too",
     [](A& o, Text&, Name n) { last(o, n).fill = true; }, kFlag},
    {"--at", "of insert: the voxel there (metres) gets the stamp's lowest corner",
     [](A& o, Text& t, Name n) { last(o, n).at = parsed(parse_point(t), n); }},
    {"--by", "of copy and move: metres, rounded to whole voxels",
     [](A& o, Text& t, Name n) { last(o, n).by = parsed(parse_point(t), n); }},
};
constexpr OrderedOption kPoints = {"--points",
                                   "of insert, copy and move: keep the points that come along, or regenerate (default)",
                                   [](A& o, Text& t, Name n) { last(o, n).keep_points = parsed(keeps_points(t), n); }};

void add_ordered(CLI::App& c, EditArguments* o, const OrderedOption& option)
{
    const auto handle = [o, option](const std::string& text) { option.handle(*o, text, option.name); };
    if (option.flag)
        c.add_flag_callback(
             option.name, [handle] { handle(""); }, option.help)
            ->trigger_on_parse();
    else
        c.add_option_function<std::string>(option.name, handle, option.help)->trigger_on_parse();
}

// what --undo and --cut ask before they look at their own
Status check_alone(const EditArguments& o, bool other, const char* refusal)
{
    if (!o.edit.operations.empty() || other || !o.out.generation.options.model.empty())
        return fail(ErrorCode::usage, "{}", refusal);
    if (o.out.output.empty())
        return fail(ErrorCode::usage, "-o/--output is required");
    return {};
}

Status undo(const EditArguments& o, const Globals& globals)
{
    SR_CHECK(check_alone(o, o.cut, "--undo stands alone: it takes back a whole edit"));
    SR_CHECK(check_writable(o.out.output, globals.yes));
    return undo_edit(o.undo, o.grid, o.out.output);
}

Status cut(const EditArguments& o, const Globals& globals)
{
    SR_CHECK(check_alone(o, false, "--cut stands alone: it writes a stamp and changes nothing"));
    if (!o.cut_where.any())
        return fail(ErrorCode::usage, "--cut: say which voxels: a class, a box, a sphere or an object");
    SR_CHECK(check_writable(o.out.output, globals.yes));
    SR_TRY(const Json stamp, write_stamp(o.grid, o.cut_where, o.out.output));
    if (globals.json)
        fmt::print("{}\n", json_text(stamp));
    return {};
}

Status edit(const EditArguments& o, const Globals& globals)
{
    if (!o.undo.empty())
        return undo(o, globals);
    if (o.cut)
        return cut(o, globals);
    if (o.edit.operations.empty())
        return fail(ErrorCode::usage, "no operation given (--remove, --delete, --paint, --tint, --insert, --copy, "
                                      "--move, --script; or --cut, --undo)");
    EditRequest request = o.edit;
    request.grid = o.grid;
    request.generates = !o.out.generation.options.model.empty();
    SR_CHECK(check_edit(request));
    SR_CHECK(check_outputs(o.grid, o.out, globals));
    SR_TRY(request.objects, objects_of(o.grid, o.out));
    SR_TRY(const Regeneration what, edit_grid(request));
    return regenerate(what, o.out, globals);
}

} // namespace

void add_edit(CLI::App& app, const Globals& globals, Run& run)
{
    auto o = std::make_shared<EditArguments>();
    CLI::App* c = app.add_subcommand("edit", "change labels or occupancy, regenerate only that and a halo around it");
    c->add_option("GRID", o->grid, ".sgrid")->required();
    for (const OrderedOption& option : kOperations)
        add_ordered(*c, o.get(), option);
    const auto rotate = [o = o.get()](double t) {
        last(*o, "--rotate").quarter_turns = parsed(quarter_turns(t), "--rotate");
    };
    add_number_function<double>(*c, "--rotate", rotate,
                                "of insert, copy and move: 0, 90, 180 or 270 degrees, counterclockwise seen from above",
                                {0, 270})
        ->trigger_on_parse();
    add_ordered(*c, o.get(), kPoints);
    add_number(*c, "--halo", o->edit.halo, "metres around what changed that are generated anew (with -m)", 0, 30);
    c->add_option("--undo", o->undo, "OUTPUT.undo of an edit: gives back the file that was edited");
    add_regeneration_options(*c, o->out);
    c->callback([o, &globals, &run] { run = resuming([o, &globals] { return edit(*o, globals); }); });
}

} // namespace semrover
