// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover fuse DIR -o OUT: depth, poses, labels and colours of frames to a mesh, a semantic grid and a voxfield grid
#include "engine/fusion/fuse.h"
#include "engine/job/version.h"
#include "engine/mesh/mesh_files.h"
#include "engine/mesh/voxelizer.h"
#include "engine/scene/palette.h"
#include "runtime/base/final_name.h"
#include "runtime/base/json.h"
#include "runtime/base/quote.h"
#include "tools/cli/camera_options.h"
#include "tools/cli/commands.h"
#include "tools/cli/open_device.h"
#include "tools/cli/output_folder.h"
#include "tools/cli/print_stderr.h"
#include "tools/cli/progress.h"
#include "tools/cli/value_options.h"
#include "tools/fuse/fusion_folder.h"

#include <algorithm>
#include <CLI/CLI.hpp>
#include <optional>

namespace semrover {

namespace {

namespace fs = std::filesystem;

struct FuseArguments {
    std::string folder, output, poses, map, default_label, mesh_format = "glb";
    std::vector<std::string> exclude;
    FusionFolderOptions input;
    PathOptions placement;
    FusionOptions fusion;
    std::optional<double> max_depth;
    VoxelizeOptions voxels;
};

struct Outputs {
    Path mesh, semantic, voxfield, run;

    Outputs(const Path& folder, const std::string& mesh_format)
        : mesh(folder / ("mesh." + mesh_format)), semantic(folder / "semantic.sgrid"),
          voxfield(folder / "voxfield.sgrid"), run(folder / "run.json")
    {
    }
    std::array<Path, 4> all() const { return {mesh, semantic, voxfield, run}; }
};

Status resolve(FuseArguments& o, const Globals& globals)
{
    for (const std::string& text : o.exclude) {
        SR_TRY(const uint8_t label, class_option("--exclude", text));
        o.fusion.excluded |= 1u << label;
    }
    if (!o.default_label.empty()) {
        SR_TRY(o.voxels.default_label, class_option("--default-label", o.default_label));
    }
    o.input.poses = o.poses;
    SR_TRY(o.input.placement, placement_of(o.placement));
    o.input.map = o.map;
    SR_CHECK(has_folder(o.output).map([](bool) {}));
    for (const Path& path : Outputs(o.output, o.mesh_format).all())
        SR_CHECK(refuse_existing(path, globals.yes));
    return {};
}

// one line for each stage; stops when the user asks for it
class FuseProgress {
  public:
    FuseProgress(const Globals& globals, const Device& device) : globals_(globals), device_(device) {}

    Status operator()(const char* stage, size_t done, size_t total)
    {
        if (stage != stage_) {
            finish();
            stage_ = stage;
            line_.emplace(progress_to_stderr(globals_), stage, "frames", total);
        }
        line_->update(done, device_.allocated_bytes());
        if (interrupt_requested())
            return fail(ErrorCode::interrupted, "interrupted after {} of {} frames; nothing was written", done, total);
        return {};
    }
    void finish()
    {
        if (line_)
            line_->finish();
        line_.reset();
    }

  private:
    const Globals& globals_;
    const Device& device_;
    std::string stage_;
    std::optional<Progress> line_;
};

// faces of a class only, unless those without are given one
Mesh labelled_part(const Mesh& mesh, uint8_t default_label)
{
    if (default_label != kNoLabel)
        return mesh;
    Mesh part = mesh;
    part.faces.clear();
    part.face_labels.clear();
    part.face_materials.clear();
    for (size_t f = 0; f < mesh.faces.size(); ++f)
        if (mesh.face_labels[f] != kNoLabel) {
            part.faces.push_back(mesh.faces[f]);
            part.face_labels.push_back(mesh.face_labels[f]);
            part.face_materials.push_back(mesh.face_materials[f]);
        }
    return part;
}

struct Grids {
    VoxelGrid semantic, voxfield;
};

Result<Grids> make_grids(const FuseArguments& o, const FusedMesh& fused, Device& device)
{
    const Mesh mesh = labelled_part(fused.mesh, o.voxels.default_label);
    if (mesh.faces.empty())
        return fail(ErrorCode::bad_input,
                    "{}: no face has a label, so there are no grids to make: expected label/*.png, or --default-label "
                    "CLASS for what has none",
                    quote_path(o.folder));
    SR_TRY(VoxelizedMesh voxelized, voxelize(device, mesh, o.voxels));
    Grids grids;
    grids.voxfield = std::move(voxelized.grid);
    grids.voxfield.metadata["tool"] = kProgram;
    grids.voxfield.metadata["seed"] = std::to_string(o.voxels.seed);
    grids.semantic.voxel_size = grids.voxfield.voxel_size;
    grids.semantic.cells = grids.voxfield.cells;
    grids.semantic.labels = grids.voxfield.labels;
    grids.semantic.metadata["tool"] = kProgram;
    return grids;
}

Json settings_of(const FuseArguments& o)
{
    Json excluded = Json::array();
    for (size_t label = 0; label < kClassCount; ++label)
        if (o.fusion.excluded >> label & 1)
            excluded.push_back(kPalette[label].name);
    return {{"command", "fuse"},
            {"input", o.folder},
            {"poses", o.poses},
            {"path_placement", json_of(o.placement)},
            {"map", o.map},
            {"tsdf_voxel", o.fusion.voxel},
            {"truncation", o.fusion.truncation},
            {"max_depth", o.fusion.max_depth},
            {"depth_kind", name_of(o.input.depth.kind)},
            {"depth_scale", o.input.depth.unit ? Json(*o.input.depth.unit) : Json()},
            {"max_jump", o.fusion.max_jump},
            {"min_weight", o.fusion.min_weight},
            {"min_views", o.fusion.min_views},
            {"excluded", excluded},
            {"default_label", o.default_label},
            {"voxel_size", short_number(o.voxels.voxel_size)},
            {"points_per_voxel", o.voxels.points_per_voxel},
            {"seed", o.voxels.seed}};
}

Json figures_of(const FusionFolder& folder, const FusedMesh& fused, const Grids& grids, const Device& device)
{
    return {{"frames", folder.count()},
            {"labelled_frames", folder.labelled()},
            {"colored_frames", folder.colored()},
            {"blocks", fused.figures.blocks},
            {"chunks", fused.figures.chunks},
            {"vertices", fused.mesh.positions.size()},
            {"faces", fused.mesh.faces.size()},
            {"unlabelled_faces", fused.figures.unlabelled_faces},
            {"cells", grids.semantic.cells.size()},
            {"peak_device_bytes", device.peak_bytes()}};
}

// all of them or none; what else is in the folder stays
Status write_outputs(const FuseArguments& o, const FusedMesh& fused, const Grids& grids, const Json& run)
{
    SR_TRY(OutputFolder folder, OutputFolder::create(o.output, true)); // resolve() has looked at what is there
    const Outputs out(folder.path(), o.mesh_format);
    SR_CHECK(o.mesh_format == "ply" ? write_mesh_ply(out.mesh, fused.mesh) : write_glb(out.mesh, fused.mesh));
    SR_CHECK(write_grid(out.semantic, grids.semantic));
    SR_CHECK(write_grid(out.voxfield, grids.voxfield));
    SR_CHECK(write_file_atomically(out.run, json_text(run, 1) + "\n"));
    return folder.commit();
}

void print_warnings(const FusionFolder& folder, const FusedMesh& fused)
{
    if (folder.labelled() < folder.count() && !folder.has_sweeps())
        print_stderr("semrover: warning: {} of {} frames have no labels\n", folder.count() - folder.labelled(),
                     folder.count());
    if (fused.figures.unlabelled_faces)
        print_stderr("semrover: warning: {} of {} faces have no label\n", fused.figures.unlabelled_faces,
                     fused.mesh.faces.size());
}

Status run_fuse(FuseArguments o, const Globals& globals)
{
    SR_CHECK(resolve(o, globals));
    SR_TRY(FusionFolder folder, FusionFolder::open(o.folder, o.input));
    print_warnings(folder.warnings(), globals);
    SR_CHECK(folder.check_labels());
    o.fusion.max_depth = o.max_depth.value_or(suitable_max_depth(folder.cameras(), o.fusion.voxel));
    SR_TRY(const auto device, open_device(globals));
    FuseProgress progress(globals, *device);
    SR_TRY(const FusedMesh fused, fuse(*device, folder.frames(), o.fusion, std::ref(progress)));
    progress.finish();
    SR_TRY(const Grids grids, make_grids(o, fused, *device));
    const Json figures = figures_of(folder, fused, grids, *device);
    SR_CHECK(write_outputs(o, fused, grids,
                           {{"settings", settings_of(o)},
                            {"version", kVersion},
                            {"device", device->name()},
                            {"state", "finished"},
                            {"results", figures}}));
    if (!globals.quiet)
        print_warnings(folder, fused);
    if (globals.json)
        fmt::print("{}\n", json_text(figures));
    else
        fmt::print("{} frames: {} faces, {} voxels in {}\n", folder.count(), fused.mesh.faces.size(),
                   grids.semantic.cells.size(), quote_path(o.output));
    return {};
}

void add_camera_options(CLI::App& c, FusionFolderOptions& o)
{
    add_number(c, "--fx", o.fx, "focal length in pixels, in place of what files say", 1e-3, 1e6);
    add_number(c, "--fy", o.fy, "likewise; as --fx", 1e-3, 1e6);
    add_number(c, "--cx", o.cx, "pixels from the left; the middle", -1e5, 1e5);
    add_number(c, "--cy", o.cy, "pixels from the top; the middle", -1e5, 1e5);
    add_number(c, "--fov-x", o.fov_x, "field of view across the width, degrees", 1.0, 179.0);
}

void add_fusion_options(CLI::App& c, FusionOptions& o)
{
    add_number(c, "--tsdf-voxel", o.voxel, "metres, of the distance field; 0.1", 0.005, 10.0);
    add_number(c, "--truncation", o.truncation, "voxels, of the distance field; 4", 3.5, 32.0);
    add_number(c, "--max-jump", o.max_jump,
               "voxels between distances in a cell: more is the edge of a shadow, not a surface; 3.2 (16: keep all)",
               1.8, 1000.0);
    add_number(c, "--min-weight", o.min_weight, "of a voxel; a frame adds at most 1 / (1 + depth); 0", 0.0, 1e6);
    add_number(c, "--min-views", o.min_views, "frames that must have seen a piece of surface; 2", 0, 7);
}

} // namespace

void add_fuse(CLI::App& app, const Globals& globals, Run& run)
{
    auto o = std::make_shared<FuseArguments>();
    CLI::App* c = app.add_subcommand("fuse", "depth, poses, labels and colours of frames to a mesh and grids");
    c->add_option("DIR", o->folder,
                  "[CAMERA/]{depth,label,color}/000000.png, or LIDAR/sweeps.json, and transforms.json")
        ->required();
    c->add_option("-o,--output", o->output, "folder for mesh.glb, semantic.sgrid, voxfield.sgrid, run.json")
        ->required();
    c->add_option("--poses", o->poses, "a trajectory; DIR/transforms.json or groundtruth.txt");
    add_placement_options(*c, o->placement);
    add_camera_options(*c, o->input);
    add_depth_options(*c, o->input.depth);
    add_fusion_options(*c, o->fusion);
    add_number(*c, "--max-depth", o->max_depth, "metres; where a pixel is 0.55 voxels wide, 30 at most", 0.1, 1000.0);
    c->add_option("--map", o->map,
                  "a table by name, or JSON: label number or name to class, or null for pixels to leave out");
    c->add_option("--exclude", o->exclude, "classes whose pixels are left out, such as car,person; sky always is")
        ->delimiter(',');
    c->add_option("--default-label", o->default_label, "class of what has no label; none: not in the grids");
    add_number(*c, "--voxel-size", o->voxels.voxel_size, "metres, of the grids; 0.6", 0.05, 100.0);
    add_number(*c, "--points", o->voxels.points_per_voxel, "points of a voxel; 20", 1, 4096);
    add_seed(*c, "-s,--seed", o->voxels.seed, "of the points; 0");
    add_choice(*c, "--mesh-format", {"glb", "ply"}, "glb or ply; glb", o->mesh_format);
    c->callback([o, &globals, &run] { run = [o, &globals] { return run_fuse(*o, globals); }; });
}

} // namespace semrover
