// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover fuse DIR -o OUT: depth, poses, labels and colours of frames to a mesh, a semantic grid and a voxfield grid
#include "engine/fusion/fuse.h"
#include "engine/fusion/fusion_folder.h"
#include "engine/job/version.h"
#include "engine/mesh/mesh_files.h"
#include "engine/mesh/voxelizer.h"
#include "engine/scene/palette.h"
#include "runtime/base/quote.h"
#include "runtime/base/json.h"
#include "tools/cli/commands.h"
#include "tools/cli/open_device.h"
#include "tools/cli/progress.h"

#include <algorithm>
#include <charconv>
#include <CLI/CLI.hpp>
#include <optional>

namespace semrover {

namespace {

namespace fs = std::filesystem;

struct FuseArguments {
    std::string folder, output, poses, map, default_label, mesh_format = "glb";
    std::vector<std::string> exclude;
    FusionFolderOptions input;
    FusionOptions fusion;
    std::optional<double> max_depth;
    VoxelizeOptions voxels;
};

struct Outputs {
    Path mesh, semantic, voxfield, run;

    explicit Outputs(const FuseArguments& o)
        : mesh(Path(o.output) / ("mesh." + o.mesh_format)), semantic(Path(o.output) / "semantic.sgrid"),
          voxfield(Path(o.output) / "voxfield.sgrid"), run(Path(o.output) / "run.json")
    {
    }
    std::array<Path, 4> all() const { return {mesh, semantic, voxfield, run}; }
};

// a class by its name or number
Result<uint8_t> class_option(const char* option, const std::string& text)
{
    if (const auto label = class_of_name(text))
        return *label;
    uint32_t number = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    if (error == std::errc() && end == text.data() + text.size() && number < kClassCount)
        return uint8_t(number);
    return fail(ErrorCode::usage, "{}: {} is no class, expected a name such as 'car' or a number from 0 to {}", option,
                quote(text), kClassCount - 1);
}

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
    o.input.map = o.map;
    std::error_code error;
    if (fs::exists(o.output, error) && !fs::is_directory(o.output, error))
        return fail(ErrorCode::usage, "{} is a file, expected a folder", quote_path(o.output));
    for (const Path& path : Outputs(o).all())
        if (fs::exists(path, error) && !globals.yes)
            return fail(ErrorCode::usage, "{} exists; -y replaces it", quote_path(path));
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
            {"map", o.map},
            {"tsdf_voxel", o.fusion.voxel},
            {"truncation", o.fusion.truncation},
            {"max_depth", o.fusion.max_depth},
            {"depth_scale", o.fusion.depth_scale},
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
    return {{"frames", folder.cameras().size()},    {"labelled_frames", folder.labelled()},
            {"colored_frames", folder.colored()},   {"blocks", fused.figures.blocks},
            {"chunks", fused.figures.chunks},       {"vertices", fused.mesh.positions.size()},
            {"faces", fused.mesh.faces.size()},     {"unlabelled_faces", fused.figures.unlabelled_faces},
            {"cells", grids.semantic.cells.size()}, {"peak_device_bytes", device.peak_bytes()}};
}

Status write_outputs(const FuseArguments& o, const FusedMesh& fused, const Grids& grids, const Json& run)
{
    const Outputs out(o);
    SR_CHECK(o.mesh_format == "ply" ? write_mesh_ply(out.mesh, fused.mesh) : write_glb(out.mesh, fused.mesh));
    SR_CHECK(write_grid(out.semantic, grids.semantic));
    SR_CHECK(write_grid(out.voxfield, grids.voxfield));
    return write_file_atomically(out.run, run.dump(1) + "\n");
}

// all of them or none; a folder that was there before stays
Status write_all(const FuseArguments& o, const FusedMesh& fused, const Grids& grids, const Json& run)
{
    std::error_code error;
    const bool made = fs::create_directories(o.output, error);
    if (error)
        return fail(ErrorCode::bad_input, "cannot create {}: {}", quote_path(o.output), error.message());
    const Status status = write_outputs(o, fused, grids, run);
    if (!status) {
        for (const Path& path : Outputs(o).all())
            fs::remove(path, error);
        if (made)
            fs::remove(o.output, error);
    }
    return status;
}

void print_warnings(const FusionFolder& folder, const FusedMesh& fused)
{
    if (folder.labelled() < folder.cameras().size())
        fmt::print(stderr, "semrover: warning: {} of {} frames have no labels\n",
                   folder.cameras().size() - folder.labelled(), folder.cameras().size());
    if (fused.figures.unlabelled_faces)
        fmt::print(stderr, "semrover: warning: {} of {} faces have no label\n", fused.figures.unlabelled_faces,
                   fused.mesh.faces.size());
}

Status run_fuse(FuseArguments o, const Globals& globals)
{
    SR_CHECK(resolve(o, globals));
    SR_TRY(FusionFolder folder, FusionFolder::open(o.folder, o.input));
    SR_CHECK(folder.check_labels());
    o.fusion.max_depth = o.max_depth.value_or(suitable_max_depth(folder.cameras(), o.fusion.voxel));
    SR_TRY(const auto device, open_device(globals));
    FuseProgress progress(globals, *device);
    SR_TRY(const FusedMesh fused, fuse(*device, folder.frames(), o.fusion, std::ref(progress)));
    progress.finish();
    SR_TRY(const Grids grids, make_grids(o, fused, *device));
    const Json figures = figures_of(folder, fused, grids, *device);
    SR_CHECK(write_all(o, fused, grids,
                       {{"settings", settings_of(o)},
                        {"version", kVersion},
                        {"device", device->name()},
                        {"state", "finished"},
                        {"results", figures}}));
    if (!globals.quiet)
        print_warnings(folder, fused);
    if (globals.json)
        fmt::print("{}\n", figures.dump());
    else
        fmt::print("{} frames: {} faces, {} cells in {}\n", folder.cameras().size(), fused.mesh.faces.size(),
                   grids.semantic.cells.size(), quote_path(o.output));
    return {};
}

void add_camera_options(CLI::App& c, FusionFolderOptions& o)
{
    const auto positive = CLI::Range(1e-3, 1e6);
    c.add_option("--fx", o.fx, "focal length in pixels, in place of what files say")->check(positive);
    c.add_option("--fy", o.fy, "likewise; as --fx")->check(positive);
    c.add_option("--cx", o.cx, "pixels from the left; the middle")->check(CLI::Range(-1e5, 1e5));
    c.add_option("--cy", o.cy, "pixels from the top; the middle")->check(CLI::Range(-1e5, 1e5));
    c.add_option("--fov-x", o.fov_x, "field of view across the width, degrees")->check(CLI::Range(1.0, 179.0));
}

void add_fusion_options(CLI::App& c, FusionOptions& o)
{
    c.add_option("--depth-scale", o.depth_scale, "metres of one unit of depth; 0.001")->check(CLI::Range(1e-6, 10.0));
    c.add_option("--tsdf-voxel", o.voxel, "metres, of the distance field; 0.1")->check(CLI::Range(0.005, 10.0));
    c.add_option("--truncation", o.truncation, "voxels, of the distance field; 4")->check(CLI::Range(3.5, 32.0));
    c.add_option("--max-jump", o.max_jump,
                 "voxels between distances in a cell: more is the edge of a shadow, not a surface; 3.2 (16: keep all)")
        ->check(CLI::Range(1.8, 1000.0));
    c.add_option("--min-weight", o.min_weight, "of a voxel; a frame adds at most 1 / (1 + depth); 0")
        ->check(CLI::Range(0.0, 1e6));
    c.add_option("--min-views", o.min_views, "frames that must have seen a piece of surface; 2")
        ->check(CLI::Range(0, 7));
}

} // namespace

void add_fuse(CLI::App& app, const Globals& globals, Run& run)
{
    auto o = std::make_shared<FuseArguments>();
    CLI::App* c = app.add_subcommand("fuse", "depth, poses, labels and colours of frames to a mesh and grids");
    c->add_option("DIR", o->folder, "[CAMERA/]{depth,label,color}/000000.png and transforms.json")->required();
    c->add_option("-o,--output", o->output, "folder for mesh.glb, semantic.sgrid, voxfield.sgrid, run.json")
        ->required();
    c->add_option("--poses", o->poses, "a camera path; DIR/transforms.json");
    add_camera_options(*c, o->input);
    add_fusion_options(*c, o->fusion);
    c->add_option("--max-depth", o->max_depth, "metres; where a pixel is 0.55 voxels wide, 30 at most")
        ->check(CLI::Range(0.1, 1000.0));
    c->add_option("--map", o->map, "JSON: label number or name to class, or null for pixels to leave out");
    c->add_option("--exclude", o->exclude, "classes whose pixels are left out, such as car,person; sky always is")
        ->delimiter(',');
    c->add_option("--default-label", o->default_label, "class of what has no label; none: not in the grids");
    c->add_option("--voxel-size", o->voxels.voxel_size, "metres, of the grids; 0.6")->check(CLI::Range(0.05, 100.0));
    c->add_option("--points", o->voxels.points_per_voxel, "points of a cell; 20")->check(CLI::Range(1, 4096));
    c->add_option("-s,--seed", o->voxels.seed, "of the points; 0");
    c->add_option("--mesh-format", o->mesh_format, "glb or ply; glb")->check(CLI::IsMember({"glb", "ply"}));
    c->callback([o, &globals, &run] { run = [o, &globals] { return run_fuse(*o, globals); }; });
}

} // namespace semrover
