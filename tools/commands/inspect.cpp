// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover inspect FILE|DIR: what is in a model or a scene. The report is one JSON object; without --json it is printed
// as indented text.
#include "engine/conditioning/scene_objects.h"
#include "engine/model/ldm_config.h"
#include "engine/model/low_rank.h"
#include "engine/model/model_index.h"
#include "engine/model/renderer_model.h"
#include "engine/model/weight_blocks.h"
#include "engine/scene/palette.h"
#include "engine/scene/tiles.h"
#include "engine/splat/bounds.h"
#include "runtime/base/json.h"
#include "runtime/base/quote.h"
#include "runtime/base/safetensors.h"
#include "tools/cli/camera_options.h"
#include "tools/cli/commands.h"
#include "tools/cli/option_facts.h"
#include "tools/cli/progress.h"
#include "tools/commands/convert.h"
#include "tools/commands/inspect_path.h"
#include "tools/commands/scene_input.h"
#include "tools/trajectory/camera_path.h"

#include <algorithm>
#include <CLI/CLI.hpp>
#include <cmath>

namespace semrover {

namespace {

// "a: 1" lines; objects indent, arrays of objects are a line an entry
void append_text(std::string& out, const Report& report, size_t indent)
{
    size_t width = 0;
    for (const auto& item : report.items())
        width = std::max(width, std::min<size_t>(item.key().size(), 40));
    const auto scalar = [](const Report& value) {
        return printable(value.is_string() ? value.get<std::string>() : json_text(value, -1, true), 1000);
    };
    for (const auto& item : report.items()) {
        const Report& value = item.value();
        const std::string key = printable(item.key(), 1000);
        out += fmt::format("{:{}}", "", indent);
        if (value.is_object() && !value.empty()) {
            out += key + "\n";
            append_text(out, value, indent + 2);
        } else if (value.is_array() && !value.empty() && value[0].is_object()) {
            out += key + "\n";
            for (const Report& entry : value) {
                out += fmt::format("{:{}}", "", indent + 2);
                for (const auto& field : entry.items())
                    out += fmt::format("{}  ", scalar(field.value()));
                out.resize(out.size() - 2);
                out += "\n";
            }
        } else if (key == "bytes" && value.is_number_unsigned()) {
            out += fmt::format("{:{}}  {} ({})\n", key, width, scalar(value), bytes_text(value.get<uint64_t>()));
        } else {
            out += fmt::format("{:{}}  {}\n", key, width, scalar(value));
        }
    }
}

// ---- weights

struct Totals {
    uint64_t parameters = 0, bytes = 0;
};

Report tensor_list(const SafetensorsSet& set)
{
    Report list = Report::array();
    for (const TensorInfo& t : set.tensors())
        list.push_back({{"name", t.name}, {"dtype", dtype_name(t.dtype)}, {"shape", t.shape}});
    for (const UnsupportedTensor& t : set.unsupported())
        list.push_back({{"name", t.name}, {"dtype", t.dtype}, {"shape", t.shape}, {"note", "not supported"}});
    return list;
}

uint64_t parameters_of(const SafetensorsSet& set, std::string_view prefix)
{
    uint64_t sum = 0;
    for (const TensorInfo& t : set.tensors())
        if (t.name.starts_with(prefix) && !is_scales(t.name))
            sum += t.elements();
    return sum;
}

// whether a UNet of so many input channels can render, and what to do if not
std::string renderer_text(uint64_t in_channels, bool video)
{
    const uint32_t expected = renderer_channels({}, video);
    if (in_channels == expected)
        return fmt::format("ready{} ({} input channels)", video ? ", of videos" : "", in_channels);
    if (in_channels == (video ? 2 : 1) * VaeConfig().latent_channels)
        return fmt::format("no: a plain UNet{} ({} input channels); semrover convert IN OUT --{}-init adds the others",
                           video ? " of videos" : "", in_channels, video ? "vsd" : "asd");
    return fmt::format("no: {} input channels, expected {}", in_channels, expected);
}

// both networks of a single file, with the configs that its shapes give
void describe_ldm(Report& report, const SafetensorsSet& set)
{
    const auto unet = ldm_unet_config(set);
    const char* version = !unet                               ? ""
                          : unet->cross_attention_dim == 768  ? " 1.x"
                          : unet->cross_attention_dim == 1024 ? " 2.x"
                                                              : "-like";
    report["kind"] = unet && unet->video ? "Stable Video Diffusion single file (LDM)"
                                         : fmt::format("Stable Diffusion{} single file (LDM)", version);
    Report& u = report["unet"] = {{"parameters", parameters_of(set, kLdmUnet)}};
    if (unet) {
        u["deferred_renderer"] = renderer_text(unet->in_channels, unet->video);
        u["config"] = unet_config_json(*unet);
    } else {
        u["error"] = unet.error().message;
    }
    const std::string_view prefix = ldm_vae_prefix(set);
    if (prefix.empty()) {
        report["vae"] = "none";
        return;
    }
    Report& v = report["vae"] = {{"parameters", parameters_of(set, prefix)}};
    if (const auto vae = ldm_vae_config(set))
        v["config"] = vae_config_json(*vae);
    else
        v["error"] = vae.error().message;
}

// what the tensors' names say that a file is
void describe_kind(Report& report, const SafetensorsSet& set)
{
    if (is_ldm(set)) {
        describe_ldm(report, set);
    } else if (const TensorInfo* conv_in = set.find("conv_in.weight"); conv_in && conv_in->shape.size() == 4) {
        const bool video = set.find("add_embedding.linear_1.weight") != nullptr;
        report["kind"] = video ? "UNetSpatioTemporalConditionModel" : "UNet2DConditionModel";
        report["deferred_renderer"] = renderer_text(conv_in->shape[1], video);
    } else if (set.find("encoder.conv_in.weight") && set.find("decoder.conv_in.weight")) {
        report["kind"] = set.find("decoder.time_conv_out.weight") ? "AutoencoderKLTemporalDecoder" : "AutoencoderKL";
    } else if (set.find("semantic_embed.weight") && set.find("proj_in.weight")) {
        report["kind"] = "VoxfieldTransformer";
    } else if (set.find("encoder_hidden_states")) {
        report["kind"] = "text conditioning";
    }
}

Report describe_weights(const SafetensorsSet& set, bool with_tensors, Totals& totals)
{
    Totals own;
    std::map<std::string, uint64_t> dtypes;
    for (const TensorInfo& t : set.tensors()) {
        own.parameters += is_scales(t.name) ? 0 : t.elements();
        own.bytes += t.bytes();
        ++dtypes[dtype_name(t.dtype)];
    }
    for (const UnsupportedTensor& t : set.unsupported()) {
        own.bytes += t.end - t.begin;
        ++dtypes[t.dtype];
    }
    totals.parameters += own.parameters;
    totals.bytes += own.bytes;
    Report report = {{"file", set.path().filename().string()}};
    describe_kind(report, set);
    if (set.shards().size() > 1)
        report["shards"] = set.shards().size();
    report["tensors"] = set.tensors().size() + set.unsupported().size();
    report["parameters"] = own.parameters;
    report["bytes"] = own.bytes;
    report["dtypes"] = dtypes;
    const Status finite = check_finite(set);
    report["finite"] = finite ? "yes" : finite.error().message;
    if (set.shards().size() == 1 && !set.shards()[0].metadata().empty())
        report["metadata"] = set.shards()[0].metadata();
    if (with_tensors)
        report["list"] = tensor_list(set);
    return report;
}

// ---- a model's folder

// the component's weights, whatever their base name; none for a folder without (a scheduler, a tokenizer)
Result<std::optional<SafetensorsSet>> open_weights(const Path& folder)
{
    SR_TRY(const std::vector<Path> all, list_files(folder));
    std::vector<Path> files;
    bool pickle = false;
    for (const Path& file : all) {
        const Path extension = file.extension();
        if (extension == ".safetensors")
            files.push_back(file);
        pickle = pickle || extension == ".bin" || extension == ".pt" || extension == ".ckpt";
    }
    if (files.empty() && !pickle)
        return std::optional<SafetensorsSet>();
    const bool diffusers = std::ranges::any_of(
        files, [](const Path& file) { return file.filename().string().starts_with("diffusion_pytorch_model"); });
    if (files.empty() || diffusers) {
        SR_TRY(SafetensorsSet set, SafetensorsSet::open_folder(folder));
        return std::optional(std::move(set));
    }
    SR_TRY(SafetensorsSet set, is_there(folder / "model.safetensors.index.json")
                                   ? SafetensorsSet::open(folder / "model.safetensors.index.json")
                                   : SafetensorsSet::open(files.front()));
    return std::optional(std::move(set));
}

Result<Report> describe_component(const Path& folder, bool with_tensors, Totals& totals)
{
    Report report = Report::object();
    for (const char* name : {"config.json", "scheduler_config.json"})
        if (is_there(folder / name)) {
            SR_TRY(const Json config, read_json(folder / name));
            report["config"] = config;
        }
    SR_TRY(const std::optional<SafetensorsSet> weights, open_weights(folder));
    if (weights)
        report["weights"] = describe_weights(*weights, with_tensors, totals);
    if (const Path adapter = folder / kAdapterFile; is_there(adapter)) {
        SR_TRY(const SafetensorsSet set, SafetensorsSet::open(adapter));
        report["adapter"] = describe_weights(set, with_tensors, totals);
    }
    return report;
}

// a component's name becomes a path
bool is_folder_name(std::string_view name)
{
    return !name.empty() && name[0] != '.' && name.find_first_of("/\\") == std::string_view::npos;
}

Result<Report> describe_components(const Path& folder, const Json& index, bool with_tensors, Totals& totals)
{
    Report components = Report::object();
    for (const auto& [name, value] : index.items()) {
        // [library, class]; anything else is a setting, [null, null] a component that was left out
        if (!value.is_array() || value.size() != 2 || !value[1].is_string())
            continue;
        if (!is_folder_name(name))
            return fail(ErrorCode::bad_input, "{}: {} is no name of a component's folder",
                        quote_path(folder / "model_index.json"), quote(name));
        Report component = {{"class", value[1].get<std::string>()}};
        if (is_there(folder / name)) {
            SR_TRY(const Report found, describe_component(folder / name, with_tensors, totals));
            component.update(found);
        } else {
            component["missing"] = fmt::format("there is no folder {}", quote_path(folder / name));
        }
        components[name] = std::move(component);
    }
    if (!components.contains("conditioning") && is_there(folder / "conditioning")) {
        SR_TRY(components["conditioning"], describe_component(folder / "conditioning", with_tensors, totals));
    }
    return components;
}

// of a renderer of videos: how `refine` cuts trajectories, and what conditions the network; nothing of others
void describe_video(Report& report, const Path& folder)
{
    const auto model = RendererModel::read(folder);
    if (!model || !model->video())
        return;
    const VideoDefaults& v = model->defaults.video;
    report["video"] = {{"window_frames", v.window_frames},
                       {"window_overlap", v.window_overlap},
                       {"frame_correlation", v.frame_correlation},
                       {"decode_frames", v.decode_frames},
                       {"guidance_scale", {v.first_guidance_scale, model->defaults.guidance_scale}},
                       {"num_inference_steps", model->defaults.num_inference_steps},
                       {"sampler", sampler_name(model->scheduler.sampler)}};
}

void count_tints(Report& usual)
{
    if (!usual.is_object())
        return;
    if (usual.contains("tints"))
        usual["tints"] = usual["tints"].size();
    if (usual.contains("parts"))
        count_tints(usual["parts"]);
}

// with the number of an object's colours in place of these
Report described_defaults(const Json& defaults)
{
    Report described = defaults;
    if (described.is_object() && described.contains("objects") && described["objects"].is_object())
        for (auto& [name, usual] : described["objects"].items())
            count_tints(usual);
    return described;
}

Result<Report> describe_folder(const Path& folder, bool with_tensors)
{
    Totals totals;
    Report report = {{"model", folder.string()}};
    if (is_there(folder / "model_index.json")) {
        SR_TRY(const Json index, read_model_index(folder));
        report["class"] = index.value("_class_name", Json());
        if (index.contains("defaults"))
            report["defaults"] = described_defaults(index["defaults"]);
        if (index.contains("presets"))
            report["presets"] = index["presets"];
        SR_TRY(report["components"], describe_components(folder, index, with_tensors, totals));
        describe_video(report, folder);
    } else if (is_there(folder / "config.json") || is_there(folder / "scheduler_config.json")) {
        SR_TRY(const Report component, describe_component(folder, with_tensors, totals));
        report.update(component);
    } else {
        return fail(ErrorCode::bad_input, "{}: expected a model, found neither model_index.json nor config.json",
                    quote_path(folder));
    }
    report["parameters"] = totals.parameters;
    report["bytes"] = totals.bytes;
    return report;
}

// ---- a grid

void add_input(Report& report, const SceneInput& input)
{
    if (input.format == SceneFormat::sgrid)
        return;
    report["format"] = facts_of(input.format).name;
    for (const std::string& warning : input.warnings)
        report["warnings"].push_back({{"warning", warning}});
}

Report describe_splats(const Path& path, const SceneInput& input)
{
    const Splats& s = *input.splats;
    const Bounds bounds = bounds_of(s);
    Report report = {{"splats", path.string()}, {"count", s.position.size()}};
    report["labelled"] = s.label.size() - static_cast<size_t>(std::ranges::count(s.label, kNoLabel));
    report["extent"] = {{"min_m", metres(bounds.low)}, {"max_m", metres(bounds.high)}};
    add_input(report, input);
    return report;
}

Report counted_by_class(const std::array<uint64_t, kClassCount>& counts)
{
    Report report = Report::object();
    for (size_t i = 0; i < kClassCount; ++i)
        if (counts[i])
            report[std::string(kPalette[i].name)] = counts[i];
    return report;
}

Report describe_grid(const Path& path, const SceneInput& input)
{
    const VoxelGrid& grid = *input.grid;
    const Bounds bounds = bounds_of(grid);
    const double edge = grid.voxel_size;
    std::array<uint64_t, kClassCount> counts{};
    for (const uint8_t label : grid.labels)
        ++counts[label];
    Report report = {{"grid", path.string()}, {"cells", grid.cells.size()}};
    report["voxel_size"] = std::round(edge * 1e6) / 1e6; // metres; the float's own digits mean nothing
    report["points_per_voxel"] = grid.points_per_voxel;
    report["points"] = grid.points.size() / 3;
    report["generated"] = grid.generated.size() - static_cast<size_t>(std::ranges::count(grid.generated, 0));
    report["extent"] = {{"min_m", metres(bounds.low)}, {"max_m", metres(bounds.high)}};
    report["labels"] = counted_by_class(counts);
    if (const Path objects = objects_beside(path); is_there(objects))
        report["objects"] = objects.string();
    report["metadata"] = grid.metadata;
    add_input(report, input);
    return report;
}

// boxes and colours by class
Result<Report> describe_objects(const Path& path)
{
    SR_TRY(const std::vector<SceneObject> objects, read_objects(path));
    std::array<uint64_t, kClassCount> counts{};
    for (const SceneObject& o : objects)
        counts[o.label] += !o.part;
    Report report = {{"objects", path.string()}, {"count", objects.size()}};
    report["parts"] = std::ranges::count(objects, true, &SceneObject::part);
    report["tinted"] = std::ranges::count_if(objects, [](const SceneObject& o) { return o.tint.has_value(); });
    report["classes"] = counted_by_class(counts);
    return report;
}

Result<Report> describe_scene(const Path& path, const SceneInputOptions& options)
{
    SR_TRY(const SceneInput input, read_scene_input(path, options));
    return input.grid ? describe_grid(path, input) : describe_splats(path, input);
}

Result<Report> describe(const Path& path, const SceneInputOptions& input, const Globals& globals)
{
    if (is_folder(path)) {
        if (TileFolder::is_one(path))
            return describe_scene(path, input);
        if (!is_model(path))
            SR_CHECK(refuse_unknown_input(path));
        return describe_folder(path, globals.verbose || globals.json);
    }
    if (input.from.empty())
        SR_CHECK(refuse_colmap_file(path));
    if (path.extension() == ".json" && input.from.empty() && !path.string().ends_with(".index.json"))
        return describe_objects(path);
    // a .bin without labels beside it is a pickle
    const bool pickle = path.extension() == ".bin" && !is_there(Path(path).replace_extension(".label"));
    if (!input.from.empty() || (has_scene_extension(path) && !pickle))
        return describe_scene(path, input);
    if (!is_model(path))
        SR_CHECK(refuse_unknown_input(path));
    SR_TRY(const SafetensorsSet set, SafetensorsSet::open(path));
    Totals totals;
    return describe_weights(set, true, totals);
}

// ---- a trajectory, and whether it meets a grid

struct InspectArguments {
    std::string file, other, path; // `path`: --path, in place of one of the two
    SceneInputOptions input;
    LensOptions lens;
    PathOptions placement;
};

// which of the files is a path
struct InspectedFiles {
    Path path, other; // may be empty
};
Result<InspectedFiles> sort_out(const InspectArguments& o)
{
    if (!o.path.empty() && !o.other.empty())
        return fail(ErrorCode::usage, "--path, or two files, of which one is a trajectory");
    if (!o.path.empty())
        return InspectedFiles{o.path, o.file};
    bool first = false;
    if (o.input.from.empty()) {
        SR_TRY(const std::optional<FoundPath> found, find_path(o.file));
        first = found.has_value();
    }
    if (o.other.empty())
        return first ? InspectedFiles{o.file, {}} : InspectedFiles{{}, o.file};
    return first ? InspectedFiles{o.file, o.other} : InspectedFiles{o.other, o.file};
}

Result<Report> describe_both(const InspectArguments& o, const Globals& globals)
{
    SR_TRY(const InspectedFiles files, sort_out(o));
    if (files.path.empty()) {
        for (const auto names : {placement_options(), lens_options()})
            SR_CHECK(refuse_given(*o.input.command, names, "a file that is no trajectory"));
        return describe(files.other, o.input, globals);
    }
    SR_TRY(PathLens lens, path_lens_of(o.lens));
    lens.matters = o.lens.size_given; // without it, KITTI's calibration says no lens
    PathOptions placement = o.placement;
    std::optional<SceneInput> scene;
    if (!files.other.empty()) {
        SceneInputOptions input = o.input;
        input.origin_may_be_of_path = true;
        SR_TRY(scene, read_scene_input(files.other, input));
    }
    if (placement.origin.empty() && (!scene || !has_origin(scene->format)))
        placement.origin = o.input.origin;
    SR_TRY(const PathPlacement place, placement_of(placement));
    SR_TRY(const CameraPath path, read_camera_path(files.path, lens, place));
    Report report = describe_path(files.path, path);
    if (!scene)
        return report;
    Report both = {{"path", report}};
    both["scene"] = scene->grid ? describe_grid(files.other, *scene) : describe_splats(files.other, *scene);
    both["meeting"] = describe_meeting(files.path, path, *scene);
    return both;
}

Status inspect(const InspectArguments& o, const Globals& globals)
{
    SR_TRY(const Report report, describe_both(o, globals));
    std::string text;
    if (globals.json)
        text = json_text(report) + "\n";
    else
        append_text(text, report, 0);
    fmt::print("{}", text);
    return {};
}

} // namespace

void add_inspect(CLI::App& app, const Globals& globals, Run& run)
{
    CLI::App* command = app.add_subcommand(
        "inspect", "show what is in a model, a scene or a trajectory, and whether a path and a scene meet");
    const auto o = std::make_shared<InspectArguments>();
    command
        ->add_option("FILE|DIR", o->file,
                     "a .safetensors file or index, a model's folder, a scene in any format, its objects (.json), or a "
                     "trajectory")
        ->required();
    command->add_option("OTHER", o->other, "a scene for a trajectory, or a path for a scene: whether they meet");
    command->add_option("--path", o->path, "a trajectory, likewise");
    add_scene_input_options(*command, o->input);
    add_lens_options(*command, o->lens);
    add_placement_options(*command, o->placement);
    command->callback([=, &globals, &run] { run = [=, &globals] { return inspect(*o, globals); }; });
}

} // namespace semrover
