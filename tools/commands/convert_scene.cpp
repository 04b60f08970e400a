// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/commands/convert.h"

#include "engine/scene/palette.h"
#include "engine/splat/blocks.h"
#include "runtime/base/quote.h"
#include "tools/cli/open_device.h"
#include "tools/cli/option_facts.h"
#include "tools/commands/trajectory_options.h"

namespace semrover {

namespace {

namespace fs = std::filesystem;

Result<SceneFormat> output_format(const ConvertSceneOptions& o, const SceneInput& input)
{
    if (o.to.empty()) {
        SR_TRY(const SceneFormat format, scene_format_to_write(o.out));
        // a .ply of splats stays one
        return format == SceneFormat::points_ply && input.splats ? SceneFormat::gaussian_3d : format;
    }
    const auto format = scene_format_of_name(o.to);
    if (!format || !facts_of(*format).writable) {
        std::string names;
        for (const SceneFormatFacts& f : scene_formats())
            if (f.writable)
                names += fmt::format("{}{}", names.empty() ? "" : ", ", f.name);
        return fail(ErrorCode::usage, "--to: {} cannot be written; formats are {}", quote(o.to, 60), names);
    }
    return *format;
}

// options that do nothing with this input and this output
Status check_meaning(const ConvertSceneOptions& o, const SceneInput& input, SceneFormat to)
{
    const CLI::App& c = *o.input.command;
    static constexpr std::array<std::string_view, 1> kSeed = {"--seed"}, kLabels = {"--splat-labels"};
    static constexpr std::array<std::string_view, 2> kSplats = {"--splat-radius", "--opacity"};
    const std::string what = fmt::format("{} to {}", facts_of(input.format).name, facts_of(to).name);
    if (input.format != SceneFormat::points_ply && input.format != SceneFormat::carla_points)
        SR_CHECK(refuse_given(c, kSeed, what));
    if (to != SceneFormat::gaussian_3d && to != SceneFormat::gaussian_2d)
        SR_CHECK(refuse_given(c, kLabels, what));
    if (input.splats || !facts_of(to).splats || !input.grid->has_points())
        SR_CHECK(refuse_given(c, kSplats, what));
    return {};
}

std::vector<Path> files_of(const Path& out, SceneFormat format)
{
    if (format != SceneFormat::semantickitti)
        return {out};
    return {Path(out).replace_extension(".label"), Path(out).replace_extension(".bin")};
}

// what cannot be written is refused before anything is computed
Status check_output(const ConvertSceneOptions& o, SceneFormat format, const Globals& globals)
{
    for (const Path& file : files_of(o.out, format)) {
        std::error_code ignored;
        if (fs::equivalent(o.in, file, ignored))
            return fail(ErrorCode::usage, "IN and OUT are the same, {}", quote_path(file));
        if (is_there(file) && !globals.yes)
            return fail(ErrorCode::usage, "{} exists; -y replaces it", quote_path(file));
        SR_CHECK(AtomicFile::create(file).map([](const AtomicFile&) {}));
    }
    return {};
}

// normals come from the device; the blocks of a grid without points need none
Result<Splats> splats_of(const ConvertSceneOptions& o, const VoxelGrid& grid, const Globals& globals)
{
    const ScenePoints points = points_of(grid);
    if (points.size() == 0)
        return block_splats(grid).splats;
    SR_TRY(const PointSplatOptions options, point_splat_options(o.splat_radius, o.opacity));
    SR_TRY(const auto device, open_device(globals));
    SR_TRY(const SplatScene scene, SplatScene::create(*device, points, options));
    return scene.read();
}

Json labels_of(std::span<const uint8_t> labels)
{
    Json counts = Json::object();
    std::array<size_t, 256> count{};
    for (const uint8_t label : labels)
        ++count[label];
    for (size_t i = 0; i < count.size(); ++i)
        if (count[i])
            counts[i < kClassCount ? std::string(kPalette[i].name) : fmt::format("{}", i)] = count[i];
    return counts;
}

Json summary(const ConvertSceneOptions& o, const SceneInput& input, SceneFormat to)
{
    Json json{{"input", o.in},           {"output", o.out},          {"from", facts_of(input.format).name},
              {"to", facts_of(to).name}, {"dropped", input.dropped}, {"warnings", input.warnings}};
    if (input.grid) {
        json["cells"] = input.grid->cells.size();
        json["points"] = input.grid->points.size() / 3;
        json["voxel_size"] = short_number(input.grid->voxel_size);
        json["labels"] = labels_of(input.grid->labels);
    }
    if (input.splats)
        json["splats"] = input.splats->position.size();
    return json;
}

void print_summary(const SceneInput& input, const Json& json, SceneFormat to)
{
    fmt::print("{} to {}: {}\n", facts_of(input.format).name, facts_of(to).name,
               input.grid ? fmt::format("{} voxels, {} points", json["cells"].dump(), json["points"].dump())
                          : fmt::format("{} splats", json["splats"].dump()));
    if (!input.grid)
        return;
    const auto counts = json["labels"];
    for (const SemanticClass& c : kPalette)
        if (const auto count = counts.find(c.name); count != counts.end())
            fmt::print("  {:<13} {:>9} voxels\n", c.name, count->get<size_t>());
}

Status write_output(const ConvertSceneOptions& o, SceneInput& input, SceneFormat to, const Globals& globals)
{
    const bool as_splats = facts_of(to).splats;
    if (input.grid && !as_splats) {
        const Together files_of_one_result;
        return write_scene_grid(o.out, *input.grid, to, input.warnings);
    }
    if (!input.splats) {
        SR_TRY(input.splats, splats_of(o, *input.grid, globals));
    }
    return write_splats(o.out, o.up == "y" ? turned_for_viewers(*input.splats) : *input.splats, to, o.splat_labels);
}

} // namespace

Status convert_scene(const ConvertSceneOptions& o, const Globals& globals)
{
    SR_CHECK(point_splat_options(o.splat_radius, o.opacity).map([](const PointSplatOptions&) {}));
    SR_TRY(SceneInput input, read_scene_input(o.in, o.input));
    SR_TRY(const SceneFormat to, output_format(o, input));
    if (!o.up.empty() && (!facts_of(to).splats || to == SceneFormat::gltf_splats))
        return fail(ErrorCode::usage, "--up is for splats as .ply or .splat; {} has axes of its own",
                    facts_of(to).name);
    if (input.splats && !facts_of(to).splats && to != SceneFormat::points_ply)
        return fail(ErrorCode::usage, "{} holds splats; {} holds a grid: write points-ply first, and grid that",
                    quote_path(o.in), facts_of(to).name);
    SR_CHECK(check_meaning(o, input, to));
    if (!o.dry_run) {
        SR_CHECK(check_output(o, to, globals));
        SR_CHECK(write_output(o, input, to, globals));
    }
    print_warnings(input.warnings, globals);
    const Json json = summary(o, input, to);
    if (globals.json)
        fmt::print("{}\n", json.dump(-1, ' ', false, Json::error_handler_t::replace));
    else if (!globals.quiet)
        print_summary(input, json, to);
    return {};
}

} // namespace semrover
