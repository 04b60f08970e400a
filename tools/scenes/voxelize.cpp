// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover voxelize MESH -o OUT.sgrid: a textured mesh as a grid of labelled cells and points
#include "engine/format/ply.h"
#include "engine/job/version.h"
#include "engine/mesh/mesh_files.h"
#include "engine/mesh/voxelizer.h"
#include "engine/scene/palette.h"
#include "engine/scene/scene_points.h"
#include "runtime/base/json.h"
#include "runtime/base/quote.h"
#include "tools/cli/camera_options.h"
#include "tools/cli/commands.h"
#include "tools/cli/open_device.h"
#include "tools/cli/print_stderr.h"
#include "tools/cli/value_options.h"
#include "tools/scenes/placement_option.h"

#include <CLI/CLI.hpp>

namespace semrover {

namespace {

struct VoxelizeArguments {
    std::string mesh, output, labels = "auto", map, default_label, up, origin, missing_textures, ply;
    VoxelizeOptions voxelize;
    double scale = 1;
    bool opaque = false;
};

LabelSource source_of(const std::string& name)
{
    return name == "material"  ? LabelSource::material
           : name == "texture" ? LabelSource::texture
           : name == "face"    ? LabelSource::face
                               : LabelSource::automatic;
}

Status check_outputs(const VoxelizeArguments& o, const Globals& globals)
{
    for (const std::string& path : {o.output, o.ply})
        if (!path.empty() && is_there(path) && !globals.yes)
            return fail(ErrorCode::usage, "{} exists; -y replaces it", quote_path(path));
    return {};
}

// a key that a map could have
std::string name_for_map(const std::vector<UnlabelledFaces>& unknown)
{
    for (const UnlabelledFaces& faces : unknown)
        if (!faces.name.empty())
            return printable(faces.name, 40);
    return "NAME";
}

// what says no label: an error, or a warning where there is a default
Status label_mesh(Mesh& mesh, const VoxelizeArguments& o, const MeshLabelMap& map, const Globals& globals)
{
    const std::vector<UnlabelledFaces> unknown = label_faces(mesh, source_of(o.labels), map);
    if (unknown.empty())
        return {};
    if (o.voxelize.default_label == kNoLabel)
        return fail(
            ErrorCode::bad_input,
            "{}: no class is known for {}; --map gives classes to names (a file with {{\"{}\": \"building\"}} or the "
            "like), --default-label one to the rest",
            quote_path(o.mesh), unlabelled_text(unknown), name_for_map(unknown));
    if (!globals.quiet)
        print_stderr("semrover: warning: labelled {}: {}\n", kPalette[o.voxelize.default_label].name,
                     unlabelled_text(unknown));
    return {};
}

// far from the origin, files and commands that hold floats do not have what the grid has
Status check_place(const Mesh& mesh, const std::array<double, 3>& origin, const VoxelizeArguments& o,
                   const Globals& globals)
{
    if (mesh.origin == std::array<double, 3>{})
        return {};
    const auto& at = mesh.origin;
    const std::string move =
        fmt::format("--origin={:.0f},{:.0f},{:.0f}", origin[0] - at[0], origin[1] - at[1], origin[2] - at[2]);
    if (!o.ply.empty())
        return fail(ErrorCode::bad_input,
                    "{}: lies about ({:.0f}, {:.0f}, {:.0f}) m, where the 32-bit floats of --ply "
                    "are too coarse; {} moves it to the origin",
                    quote_path(o.mesh), at[0], at[1], at[2], move);
    if (!globals.quiet)
        print_stderr("semrover: warning: {}: lies about ({:.0f}, {:.0f}, {:.0f}) m; the grid holds it to 1 mm, but "
                     "drawing has 32-bit floats: {} moves it to the origin\n",
                     quote_path(o.mesh), at[0], at[1], at[2], move);
    return {};
}

Result<Mesh> load_mesh(const VoxelizeArguments& o, const Globals& globals)
{
    MeshReadOptions options{.scale = o.scale, .opaque = o.opaque};
    if (!o.map.empty()) {
        SR_TRY(options.map, MeshLabelMap::read(o.map));
    }
    options.up = o.up == "y" ? UpAxis::y : o.up == "z" ? UpAxis::z : UpAxis::file;
    SR_TRY(options.origin, origin_from(o.origin));
    options.labels = o.labels == "auto" || o.labels == "face";
    if (o.missing_textures == "white")
        options.missing_textures = MissingTextures::white;
    SR_TRY(Mesh mesh, read_mesh(o.mesh, options));
    print_warnings(mesh.warnings, globals);
    SR_CHECK(label_mesh(mesh, o, options.map, globals));
    SR_CHECK(check_place(mesh, options.origin, o, globals));
    return mesh;
}

Status write_points(const std::string& path, const VoxelGrid& grid)
{
    const ScenePoints points = points_of(grid);
    Splats s;
    s.position = points.positions;
    s.color = points.colors;
    s.label.assign(points.labels.begin(), points.labels.end());
    return write_points_ply(path, s);
}

void report(const VoxelizeArguments& o, const Globals& globals, const VoxelizedMesh& v, const Mesh& mesh)
{
    std::array<size_t, kClassCount> counts{};
    for (const uint8_t label : v.grid.labels)
        ++counts[label];
    double area = 0;
    for (const float a : v.area)
        area += a;
    if (globals.json) {
        Json labels = Json::object();
        for (size_t i = 0; i < kClassCount; ++i)
            if (counts[i])
                labels[std::string(kPalette[i].name)] = counts[i];
        fmt::print("{}\n", Json{{"cells", v.grid.cells.size()},
                                {"points", v.grid.cells.size() * size_t(v.grid.points_per_voxel)},
                                {"faces", mesh.faces.size()},
                                {"area", area},
                                {"labels", labels}}
                               .dump());
    } else if (!globals.quiet) {
        fmt::print("{}: {} voxels of {} m, {} points each, {:.6g} m^2 of {} faces\n", printable(o.output),
                   v.grid.cells.size(), v.grid.voxel_size, v.grid.points_per_voxel, area, mesh.faces.size());
        for (size_t i = 0; i < kClassCount; ++i)
            if (counts[i])
                fmt::print("  {:<14}{:>9}\n", kPalette[i].name, counts[i]);
    }
}

Status run_voxelize(VoxelizeArguments o, const Globals& globals)
{
    SR_CHECK(check_outputs(o, globals));
    if (!o.default_label.empty()) {
        SR_TRY(o.voxelize.default_label, class_option("--default-label", o.default_label));
    }
    SR_TRY(const Mesh mesh, load_mesh(o, globals));
    o.voxelize.name = quote_path(o.mesh);
    SR_TRY(const auto device, open_device(globals));
    SR_TRY(VoxelizedMesh v, voxelize(*device, mesh, o.voxelize));
    v.grid.metadata["frame"] = "x forward, y left, z up, metres";
    v.grid.metadata["source"] = printable(Path(o.mesh).filename().string());
    v.grid.metadata["seed"] = std::to_string(o.voxelize.seed);
    v.grid.metadata["tool"] = kProgram;
    SR_CHECK(write_grid(o.output, v.grid));
    if (!o.ply.empty())
        SR_CHECK(write_points(o.ply, v.grid));
    report(o, globals, v, mesh);
    return {};
}

} // namespace

void add_voxelize(CLI::App& app, const Globals& globals, Run& run)
{
    auto o = std::make_shared<VoxelizeArguments>();
    CLI::App* c = app.add_subcommand("voxelize", "a textured mesh as a grid of labelled voxels and coloured points");
    c->add_option("MESH", o->mesh, ".obj, .ply, .stl, .off, .glb or .gltf")->required();
    c->add_option("-o,--output", o->output, ".sgrid")->required();
    add_number(*c, "--voxel-size", o->voxelize.voxel_size, "metres (0.6)", 0.001, 1000.0);
    add_number(*c, "--points", o->voxelize.points_per_voxel, "of a voxel (20)", 1, 4096);
    add_seed(*c, "--seed", o->voxelize.seed, "of the points (0)");
    add_placement(*c, o->voxelize);
    add_number(*c, "--min-area", o->voxelize.min_area,
               "surface of an occupied cell, in squares of the voxel size (0.0001)", 0.0, 1.0);
    add_choice(*c, "--up", {"y", "z"}, "axis of the file that points up (glTF: y, others: z)", o->up);
    add_number(*c, "--scale", o->scale, "metres in a unit of the file (1)", 1e-6, 1e6);
    add_choice(*c, "--labels", {"auto", "material", "texture", "face"},
               "where labels come from (auto: faces, material names, label textures)", o->labels);
    add_origin(*c, o->origin);
    add_choice(*c, "--missing-textures", {"refuse", "white"},
               "what a texture that is missing or cannot be read does (refuse)", o->missing_textures);
    c->add_flag("--opaque", o->opaque, "transparent parts are a surface, too");
    c->add_option("--map", o->map,
                  "a table by name, or JSON: material name, pattern with * or number -> class name or number");
    c->add_option("--default-label", o->default_label, "class of what has none");
    c->add_option("--ply", o->ply, "also the points, as PLY");
    c->callback([o, &globals, &run] { run = [o, &globals] { return run_voxelize(*o, globals); }; });
}

} // namespace semrover
