// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/scene_input.h"

#include "engine/scene/palette.h"
#include "engine/scene/tiles.h"
#include "runtime/base/quote.h"

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

Result<SceneGridOptions> grid_options(const SceneInputOptions& o)
{
    SceneGridOptions g;
    g.map = o.map;
    g.voxel_size = o.voxel_size;
    SR_TRY(g.origin, origin_of(o));
    g.min_fill = o.min_fill;
    g.mask = o.mask;
    g.points_per_voxel = o.points_per_voxel;
    g.seed = o.seed;
    g.semantic = o.labels_only;
    g.nearest_color = o.nearest_color;
    if (!o.label.empty()) {
        g.default_label = class_of_name(o.label);
        if (!g.default_label)
            return fail(ErrorCode::usage, "--label: there is no class {}", quote(o.label, 60));
    }
    return g;
}

} // namespace

Result<std::array<double, 3>> origin_of(const SceneInputOptions& options)
{
    const std::string& text = options.origin;
    std::array<double, 3> origin{};
    int used = 0;
    if (text.empty())
        return origin;
    if (std::sscanf(text.c_str(), "%lf,%lf,%lf%n", &origin[0], &origin[1], &origin[2], &used) != 3 ||
        size_t(used) != text.size() || !std::isfinite(origin[0] + origin[1] + origin[2]))
        return fail(ErrorCode::usage, "--origin takes X,Y,Z in metres, not {}", quote(text, 60));
    return origin;
}

void add_scene_input_options(CLI::App& c, SceneInputOptions& o)
{
    c.add_option("--from", o.from, "format of the input, instead of by its extension: " + names_of_formats());
    c.add_option("--map", o.map, "JSON: label of the input (number or name) to class (name or number), null: left out");
    c.add_option("--voxel-size", o.voxel_size, "metres, of a grid made of another program's voxels or points")
        ->check(CLI::Range(0.001f, 100.f));
    c.add_option("--origin", o.origin, "X,Y,Z: where the input's origin lies in the world, metres");
}

void add_all_scene_input_options(CLI::App& c, SceneInputOptions& o)
{
    add_scene_input_options(c, o);
    c.add_option("--min-fill", o.min_fill, "share of a cell that smaller voxels must fill; 0: any")
        ->check(CLI::Range(0.0, 1.0));
    c.add_option("--mask", o.mask, "array of an Occ3D .npz that says which voxels count: mask_camera, mask_lidar, ...");
    c.add_option("--points-per-voxel", o.points_per_voxel, "of a grid made of points with colours")
        ->check(CLI::Range(1, 4096));
    c.add_option("--seed", o.seed, "which points stay where a cell has more; of objects, which are guessed");
    c.add_flag("--labels-only", o.labels_only, "points with colours make a grid of labels too");
    c.add_flag("--nearest-color", o.nearest_color, "a .vox colour that no class has counts as the nearest one's");
    c.add_option("--label", o.label, "class of points without a label");
}

Result<SceneInput> read_scene_input(const Path& path, const SceneInputOptions& o)
{
    SceneInput input;
    SR_TRY(const SceneGridOptions options, grid_options(o));
    std::error_code ignored;
    if (std::filesystem::is_directory(path, ignored)) {
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
    if (facts_of(input.format).splats) {
        SR_TRY(SplatFile file, read_splats(path, input.format));
        input.splats = std::move(file.surfels);
        input.warnings = std::move(file.warnings);
        input.dropped = file.dropped;
    } else {
        SR_TRY(SceneGrid scene, read_scene_grid(path, options, input.format));
        input.grid = std::move(scene.grid);
        input.warnings = std::move(scene.warnings);
        input.dropped = scene.dropped;
    }
    return input;
}

void print_warnings(const std::vector<std::string>& warnings, const Globals& globals)
{
    for (const std::string& warning : warnings)
        if (!globals.quiet)
            fmt::print(stderr, "semrover: warning: {}\n", warning);
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
