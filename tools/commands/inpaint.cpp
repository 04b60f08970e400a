// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover inpaint GRID -m MODEL -o OUT --box ...: regenerates chosen voxels, the rest staying byte for byte
#include "tools/cli/run_job.h"
#include "tools/commands/regeneration.h"

#include <CLI/CLI.hpp>

namespace semrover {

namespace {

struct InpaintArguments {
    std::string grid, label, box, sphere, object, mask;
    RegenerationArguments out;
};

template <typename T, typename Parse>
Status parse_into(std::optional<T>& value, const std::string& text, Parse parse)
{
    if (text.empty())
        return {};
    SR_TRY(value, parse(text));
    return {};
}

Status inpaint(const InpaintArguments& o, const Globals& globals)
{
    InpaintRequest request{.grid = o.grid, .where = {}, .mask = o.mask, .objects = {}};
    SR_CHECK(parse_into(request.where.label, o.label, parse_class));
    SR_CHECK(parse_into(request.where.box, o.box, parse_box));
    SR_CHECK(parse_into(request.where.sphere, o.sphere, parse_sphere));
    SR_CHECK(parse_into(request.where.object, o.object, parse_cell));
    if (!request.where.any() && o.mask.empty())
        return fail(ErrorCode::usage, "say which voxels: --box, --sphere, --class, --object or --mask");
    SR_CHECK(check_outputs(o.grid, o.out, globals));
    SR_TRY(request.objects, objects_of(o.grid, o.out));
    SR_TRY(const Regeneration what, select_for_inpainting(request));
    return regenerate(what, o.out, globals);
}

} // namespace

void add_inpaint(CLI::App& app, const Globals& globals, Run& run)
{
    auto o = std::make_shared<InpaintArguments>();
    CLI::App* c = app.add_subcommand("inpaint", "regenerate chosen voxels, all others staying as they are");
    c->add_option("GRID", o->grid, ".sgrid")->required();
    c->add_option("--class", o->label, "voxels of this class");
    c->add_option("--box", o->box, "x0,y0,z0:x1,y1,z1 in metres: voxels whose centres lie inside");
    c->add_option("--sphere", o->sphere, "x,y,z,radius in metres, likewise");
    c->add_option("--object", o->object, "i,j,k: the connected voxels of one label that hold this voxel");
    c->add_option("--mask", o->mask, "voxels that this .sgrid has, too; of several conditions all must hold");
    add_regeneration_options(*c, o->out);
    c->get_option("--model")->required();
    c->callback([o, &globals, &run] { run = resuming([o, &globals] { return inpaint(*o, globals); }); });
}

} // namespace semrover
