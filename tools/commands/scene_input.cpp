// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/commands/scene_input.h"

#include "engine/scene/palette.h"
#include "engine/scene/tiles.h"
#include "runtime/base/quote.h"
#include "tools/cli/camera_options.h"
#include "tools/cli/option_facts.h"
#include "tools/cli/print_stderr.h"
#include "tools/cli/value_options.h"

#include <algorithm>
#include <array>
#include <CLI/CLI.hpp>
#include <cmath>

namespace semrover {

namespace {

std::string names_of_formats()
{
    std::string names;
    for (const SceneFormatFacts& f : scene_formats())
        names += fmt::format("{}{}", names.empty() ? "" : ", ", f.name);
    return names;
}

// what the options mean for a format, beside --from
std::vector<std::string_view> options_of(SceneFormat format)
{
    switch (format) {
    case SceneFormat::npz:
    case SceneFormat::array:
        return {"--map", "--voxel-size", "--file-voxel-size", "--origin", "--min-fill"};
    case SceneFormat::semantickitti:
        return {"--map", "--voxel-size", "--origin", "--min-fill"};
    case SceneFormat::occ3d_nuscenes:
    case SceneFormat::occ3d_waymo:
        return {"--map", "--voxel-size", "--origin", "--min-fill", "--mask"};
    case SceneFormat::vox:
        return {"--map", "--voxel-size", "--origin", "--nearest-color", "--file-voxel-size", "--min-fill"};
    case SceneFormat::points_ply:
    case SceneFormat::carla_points:
        return {"--map", "--voxel-size", "--origin", "--label", "--labels-only", "--points-per-voxel"};
    default: // our own grids, and splats, are read as they are
        return {};
    }
}

// `what`: the input, for the message
Status check_options(const SceneInputOptions& o, SceneFormat format, std::string_view what)
{
    if (!o.command)
        return {};
    const std::vector<std::string_view> meant = options_of(format);
    for (const std::string_view name : scene_input_options())
        if (name != "--from" && std::ranges::find(meant, name) == meant.end() &&
            !(name == "--origin" && o.origin_may_be_of_path))
            SR_CHECK(refuse_given(*o.command, {&name, 1}, what));
    return {};
}

Result<SceneGridOptions> grid_options(const SceneInputOptions& o)
{
    SceneGridOptions g;
    g.map = o.map;
    g.voxel_size = o.voxel_size;
    SR_TRY(g.origin, origin_of(o));
    g.file_voxel_size = o.file_voxel_size;
    g.min_fill = o.min_fill;
    g.mask = o.mask;
    g.points_per_voxel = o.points_per_voxel;
    g.seed = o.seed;
    g.labels_only = o.labels_only;
    g.nearest_color = o.nearest_color;
    if (!o.label.empty()) {
        SR_TRY(g.default_label, class_option("--label", o.label));
    }
    return g;
}

} // namespace

bool has_origin(SceneFormat format)
{
    return std::ranges::count(options_of(format), "--origin") > 0;
}

Result<std::array<double, 3>> origin_of(const SceneInputOptions& options)
{
    return origin_from(options.origin);
}

void add_scene_input_options(CLI::App& c, SceneInputOptions& o)
{
    o.command = &c;
    c.add_option("--from", o.from, "format of the input, instead of by its extension: " + names_of_formats());
    c.add_option(
        "--map", o.map,
        "a table by name, or JSON: label of the input (number or name) to class (name or number), null: left out");
    add_number(c, "--voxel-size", o.voxel_size, "metres, of a voxel; 0.6, of a .npz its own", 0.001f, 100.f);
    add_number(c, "--file-voxel-size", o.file_voxel_size,
               "metres of a voxel of a .vox, .npy or .npz that does not say it; as --voxel-size", 0.0001, 100);
    add_origin(c, o.origin);
    add_number(c, "--min-fill", o.min_fill, "share of a cell that smaller voxels must fill; 0: any", 0.0, 1.0);
    c.add_option("--mask", o.mask, "array of an Occ3D .npz that says which voxels count: mask_camera, mask_lidar, ...");
    add_number(c, "--points-per-voxel", o.points_per_voxel, "of a grid made of points with colours", 1, 4096);
    c.add_flag("--labels-only", o.labels_only, "points with colours make a grid of labels too");
    c.add_flag("--nearest-color", o.nearest_color, "a .vox colour that no class has counts as the nearest one's");
    c.add_option("--label", o.label, "class of points without a label");
}

std::span<const std::string_view> scene_input_options()
{
    static constexpr std::array<std::string_view, 11> kNames = {
        "--from", "--map",   "--voxel-size",       "--file-voxel-size", "--origin",       "--min-fill",
        "--mask", "--label", "--points-per-voxel", "--labels-only",     "--nearest-color"};
    return kNames;
}

Result<SceneInput> read_scene_input(const Path& path, const SceneInputOptions& o)
{
    SceneInput input;
    SR_TRY(const SceneGridOptions options, grid_options(o));
    if (is_folder(path)) {
        SR_CHECK(check_options(o, SceneFormat::sgrid, "a folder of tiles"));
        SR_TRY(input.grid, read_grid_or_tiles(path));
        return input;
    }
    if (!o.from.empty()) {
        const auto format = scene_format_of_name(o.from);
        if (!format)
            return fail(ErrorCode::usage, "--from: there is no format {}; formats are {}", quote(o.from, 60),
                        names_of_formats());
        input.format = *format;
    } else {
        SR_TRY(input.format, detect_scene_format(path));
    }
    const SceneFormatFacts& facts = facts_of(input.format);
    const std::string what = fmt::format("{} of {}", facts.splats ? "splats" : "a grid", facts.name);
    SR_CHECK(check_options(o, input.format, what));
    if (facts.splats) {
        SR_TRY(SplatFile file, read_splats(path, input.format));
        input.splats = std::move(file.splats);
        input.warnings = std::move(file.warnings);
        input.dropped = file.dropped;
    } else {
        SR_TRY(SceneGrid scene, read_scene_grid(path, options, input.format));
        for (const auto& [field, reason] : scene.unused) {
            const std::string option = option_of(field);
            const std::string_view name = option;
            if (o.command)
                SR_CHECK(refuse_given(*o.command, {&name, 1}, fmt::format("{} ({})", what, reason)));
        }
        input.grid = std::move(scene.grid);
        input.warnings = std::move(scene.warnings);
        input.dropped = scene.dropped;
    }
    return input;
}

Result<VoxelGrid> load_grid(const Path& path, const SceneInputOptions& options, const Globals& globals)
{
    SR_TRY(SceneInput input, read_scene_input(path, options));
    if (!input.grid)
        return fail(ErrorCode::bad_input, "{}: holds splats ({}), expected a grid", quote_path(path),
                    facts_of(input.format).name);
    print_warnings(input.warnings, globals);
    return std::move(*input.grid);
}

} // namespace semrover
