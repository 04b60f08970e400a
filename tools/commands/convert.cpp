// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover convert IN OUT: a model in another layout; or a scene, a trajectory or boxes in another format, as IN says
#include "tools/commands/convert.h"
#include "runtime/base/quote.h"
#include "tools/cli/option_facts.h"
#include "tools/cli/value_options.h"
#include "tools/trajectory/camera_path.h"

#include <array>
#include <CLI/CLI.hpp>

namespace semrover {

namespace {

struct ConvertArguments {
    ConvertModelOptions model;
    ConvertSceneOptions scene;
    ConvertPathOptions path;
    ConvertObjectsOptions objects;
    std::string guessing_model;        // of a grid whose OUT is objects
    const CLI::App* command = nullptr; // whose options they are
};

using Names = std::span<const std::string_view>;
constexpr std::array<std::string_view, 1> kDryRun = {"--dry-run"};
constexpr std::array<std::string_view, 7> kBoxNames = {"--from",  "--map",    "--origin",       "--calib",
                                                       "--frame", "--sample", "--vehicle-frame"};
constexpr std::array<std::string_view, 4> kModelNames = {"--dtype", "--weights", "--asd-init", "--vsd-init"};
constexpr std::array<std::string_view, 12> kPathNames = {"--path-format", "--camera", "--rig",          "--width",
                                                         "--height",      "--fov-x",  "--camera-model", "--distortion",
                                                         "--calib",       "--origin", "--points",       "--images"};
constexpr std::array<std::string_view, 2> kGuessNames = {"--model", "--seed"};
constexpr std::array<std::string_view, 6> kSceneNames = {"--to",      "--seed", "--splat-radius",
                                                         "--opacity", "--up",   "--splat-labels"};

// --from; else what leaves no doubt
std::optional<BoxFormat> box_format(const ConvertArguments& o)
{
    return o.scene.input.from.empty() ? detect_box_format(o.model.in) : box_format_of(o.scene.input.from);
}

Status convert_boxes(const ConvertArguments& o, BoxFormat format, const Globals& globals)
{
    SR_CHECK(refuse_others(*o.command, {kDryRun, kBoxNames}, "boxes"));
    SR_TRY(const Point3 origin, origin_of(o.scene.input));
    return convert_objects(
        {.in = o.model.in, .out = o.model.out, .map = o.scene.input.map, .origin = origin, .dry_run = o.model.dry_run},
        format, o.objects, globals);
}

Status check_from(const ConvertArguments& o)
{
    const std::string& from = o.scene.input.from;
    if (from.empty() || scene_format_of_name(from))
        return {};
    std::string names = names_of_box_formats();
    for (const SceneFormatFacts& f : scene_formats())
        names += fmt::format(", {}", f.name);
    return fail(ErrorCode::usage, "--from: there is no format {}; formats are {}", quote(from, 60), names);
}

// a .bin may be SemanticKITTI's, or a model's pickle
bool is_scene(const ConvertArguments& o)
{
    const Path in = o.model.in, out = o.model.out;
    if (!o.scene.input.from.empty() || !o.scene.to.empty())
        return true;
    if (is_folder(in) || (in.extension() == ".bin" && !has_scene_extension(out)))
        return false;
    return has_scene_extension(in) || has_scene_extension(out);
}

Status convert(ConvertArguments& o, const Globals& globals)
{
    if (const auto format = box_format(o))
        return convert_boxes(o, *format, globals);
    SR_CHECK(check_from(o));
    if (o.scene.input.from.empty())
        SR_CHECK(refuse_colmap_file(o.model.in));
    const auto refuse_but = [&](std::initializer_list<Names> meant, std::string_view kind) {
        return refuse_others(
            *o.command, meant,
            fmt::format("{}, which {} is taken for (--from says which format it has)", kind, quote_path(o.model.in)));
    };
    SR_TRY(const bool trajectory, is_camera_path(o.model.in));
    if (trajectory) {
        SR_CHECK(refuse_but({kDryRun, kPathNames, placement_options()}, "a trajectory"));
        o.path.placement.calibration = o.objects.calibration;
        if (o.path.placement.origin.empty())
            o.path.placement.origin = o.scene.input.origin;
        return convert_path(o.model.in, o.model.out, o.path, o.model.dry_run, globals);
    }
    if (!is_scene(o) && !is_model(o.model.in))
        return refuse_unknown_input(o.model.in);
    if (!is_scene(o)) {
        SR_CHECK(refuse_but({kDryRun, kModelNames}, "a model"));
        return convert_model(o.model, globals);
    }
    if (Path(o.model.out).extension() == ".json") {
        SR_CHECK(refuse_others(*o.command, {kDryRun, kGuessNames, scene_input_options()}, "objects that are guessed"));
        return guess_objects_of(
            {.in = o.model.in, .out = o.model.out, .map = {}, .origin = {}, .dry_run = o.model.dry_run}, o.scene.input,
            o.guessing_model, globals);
    }
    SR_CHECK(refuse_but({kDryRun, kSceneNames, scene_input_options()}, "a scene"));
    o.scene.in = o.model.in;
    o.scene.out = o.model.out;
    o.scene.dry_run = o.model.dry_run;
    return convert_scene(o.scene, globals);
}

} // namespace

void add_convert(CLI::App& app, const Globals& globals, Run& run)
{
    auto o = std::make_shared<ConvertArguments>();
    CLI::App* c = app.add_subcommand("convert", "write a model in the diffusers layout, or a scene in another format");
    c->add_option(
         "IN", o->model.in,
         "a single-file Stable Diffusion checkpoint (.safetensors) or a model folder; or a grid (.sgrid, .npz, "
         ".label, .vox, .ply) or splats (.ply, .glb, .splat); or boxes (KITTI, nuScenes, Waymo, CARLA)")
        ->required();
    c->add_option("OUT", o->model.out, "folder to write; or the scene's file, its format by the extension")->required();
    add_choice(*c, "--dtype", {"f32", "f16", "bf16"}, "precision of the weights; by default as in IN", o->model.dtype);
    add_choice(*c, "--weights", {"q8_0"},
               "store the weights of a UNet's and a transformer's blocks as int8 with a scale for 32: half the memory",
               o->model.weights);
    c->add_flag("--asd-init", o->model.asd_init,
                "make a plain UNet the start of a deferred renderer: 9 more input channels, with zero weights");
    c->add_flag("--vsd-init", o->model.vsd_init,
                "make a plain UNet of videos the start of one: its image channels see the splat buffer, 1 more the "
                "visibility, with zero weights")
        ->excludes("--asd-init");
    c->add_flag("--dry-run", o->model.dry_run, "check IN and say what would be written");
    c->add_option("--to", o->scene.to, "format of a scene's OUT: 3dgs, 2dgs, inria62 or points-ply for a .ply, ...");
    o->command = c;
    add_scene_input_options(*c, o->scene.input);
    add_seed(*c, "--seed", o->scene.input.seed,
             "which points stay where a voxel has more; of objects, which are guessed");
    c->add_option("--splat-radius", o->scene.splat_radius,
                  "grid to splats: standard deviation in metres, or auto: from the spacing of the points");
    add_number(*c, "--opacity", o->scene.opacity, "grid to splats: of every splat", 0.01f, 1.f);
    add_choice(*c, "--up", {"y", "z"},
               "axis that points up in .ply and .splat files of splats: z, as in the world, or y, for viewers",
               o->scene.up);
    c->add_flag("--splat-labels", o->scene.splat_labels, "a property label in .ply splats");
    add_box_options(*c, o->objects);
    add_path_options(*c, o->path);
    for (const auto& [name, more] : {std::pair{"--calib", "; of KITTI's poses, likewise (of the first frame without "
                                                          "--relative-to)"},
                                     {"--origin", "; of a trajectory, as --path-origin"}})
        c->get_option(name)->description(c->get_option(name)->get_description() + more);
    c->add_option(
        "-m,--model", o->guessing_model,
        "of a grid whose OUT is .json: objects are guessed, with the sizes and colours that this model knows");
    c->get_option("--from")->description(c->get_option("--from")->get_description() + ", " + names_of_box_formats());
    c->callback([o, &globals, &run] { run = [o, &globals] { return convert(*o, globals); }; });
}

} // namespace semrover
