// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover eval chamfer TRUTH [POINTS]: how far points of a grid or cloud are from a mesh, or from another cloud
#include "engine/mesh/chamfer.h"
#include "engine/mesh/mesh_files.h"
#include "engine/mesh/surface_blocks.h"
#include "engine/mesh/voxelizer.h"
#include "runtime/base/json.h"
#include "runtime/base/quote.h"
#include "tools/cli/camera_options.h"
#include "tools/cli/open_device.h"
#include "tools/cli/print_stderr.h"
#include "tools/cli/progress.h"
#include "tools/cli/value_options.h"
#include "tools/eval/sample_files.h"
#include "tools/measure/eval.h"

#include <charconv>
#include <CLI/CLI.hpp>

namespace semrover {

namespace {

struct EvalChamferArguments {
    std::string mesh, grid, sweep, csv, up, origin;
    VoxelizeOptions voxelize;
    ChamferOptions chamfer;
    double scale = 1;
};

struct Measure {
    size_t points; // of a voxel; of a cloud, in all
    size_t cells;  // of a cloud none
    Chamfer chamfer;
};

constexpr int kPaperPoints = 20;

// "2..64": doubled from 2 on, and the paper's 20; "2..64:2": every second one
Result<std::vector<int>> points_of_sweep(const std::string& text)
{
    int low = 0, high = 0, step = 0;
    const char *at = text.data(), *end = at + text.size();
    const auto number = [&](int& value) {
        const auto [next, error] = std::from_chars(at, end, value);
        at = next;
        return error == std::errc();
    };
    bool good = number(low) && end - at > 2 && at[0] == '.' && at[1] == '.';
    if (good) {
        at += 2;
        good = number(high) && (at == end || (*at++ == ':' && number(step) && step > 0 && at == end));
    }
    if (!good || low < 1 || high < low || high > 4096)
        return fail(ErrorCode::usage, "--sweep: expected FIRST..LAST or FIRST..LAST:STEP within 1 to 4096, found {}",
                    quote(text, 40));
    std::vector<int> list;
    for (int n = low; n <= high; n = step ? n + step : 2 * n)
        list.push_back(n);
    if (!step && low < kPaperPoints && kPaperPoints < high)
        list.push_back(kPaperPoints);
    std::ranges::sort(list);
    list.erase(std::unique(list.begin(), list.end()), list.end());
    return list;
}

Result<Mesh> load_surface(const EvalChamferArguments& o, const Globals& globals)
{
    // colours and labels do not matter here
    MeshReadOptions options{.scale = o.scale, .missing_textures = MissingTextures::white, .labels = false};
    options.up = o.up == "y" ? UpAxis::y : o.up == "z" ? UpAxis::z : UpAxis::file;
    SR_TRY(options.origin, origin_from(o.origin));
    SR_TRY(Mesh mesh, read_mesh(o.mesh, options));
    print_warnings(mesh.warnings, globals);
    return mesh;
}

bool is_mesh(const Path& path, bool cloud)
{
    return !cloud && path.extension() != ".sgrid" && !is_folder(path);
}

// of a grid, whose voxels may lie as those of a mesh, or of a cloud in metres
Result<MeasuredPoints> load_points(const std::string& path, double scale, const Globals& globals, Measure& m,
                                   const Mesh* mesh = nullptr)
{
    MeasuredPoints points;
    SR_TRY(const bool cloud, is_cloud(path));
    if (cloud) {
        SR_TRY(PointCloud read, read_cloud(path));
        if (read.dropped && !globals.quiet)
            print_stderr("semrover: warning: {}: {} points are not finite and left out\n", quote_path(path),
                         read.dropped);
        for (Point3& p : read.positions)
            for (double& x : p)
                x *= scale;
        points = measured_points(std::move(read.positions));
        m.points = points.positions.size();
    } else {
        SR_TRY(const VoxelGrid grid, read_grid(path));
        points = measured_points(grid, mesh ? cell_edge(*mesh, grid.voxel_size) : double(grid.voxel_size));
        m.points = size_t(grid.points_per_voxel);
        m.cells = grid.cells.size();
    }
    if (points.positions.empty())
        return fail(ErrorCode::bad_input, "{}: no voxel has points yet", quote_path(path));
    return points;
}

Result<Measure> measure_points(const EvalChamferArguments& o, const Globals& globals, Device& device)
{
    Measure m{}, unused{};
    SR_TRY(const bool cloud, is_cloud(o.mesh));
    if (is_mesh(o.mesh, cloud)) {
        SR_TRY(const Mesh mesh, load_surface(o, globals));
        SR_TRY(const MeasuredPoints points, load_points(o.grid, 1, globals, m, &mesh));
        SR_TRY(m.chamfer, chamfer(device, mesh, points, o.chamfer));
        return m;
    }
    SR_TRY(const MeasuredPoints points, load_points(o.grid, 1, globals, m));
    SR_TRY(const MeasuredPoints truth, load_points(o.mesh, o.scale, globals, unused));
    SR_TRY(m.chamfer, chamfer(device, truth, points));
    return m;
}

Result<std::vector<Measure>> measure_all(const EvalChamferArguments& o, const Globals& globals, Device& device)
{
    std::vector<Measure> measures;
    if (!o.grid.empty()) {
        SR_TRY(const Measure m, measure_points(o, globals, device));
        measures.push_back(m);
        return measures;
    }
    SR_TRY(const Mesh mesh, load_surface(o, globals));
    std::vector<int> list = {o.voxelize.points_per_voxel};
    if (!o.sweep.empty()) {
        SR_TRY(list, points_of_sweep(o.sweep));
    }
    Progress progress(progress_to_stderr(globals), "chamfer", "grids", list.size());
    for (const int n : list) {
        if (interrupt_requested())
            return fail(ErrorCode::interrupted, "interrupted after {} of {} grids", measures.size(), list.size());
        VoxelizeOptions options = o.voxelize;
        options.points_per_voxel = n;
        options.default_label = 0;
        SR_TRY(const VoxelizedMesh v, voxelize(device, mesh, options));
        SR_TRY(const Chamfer c,
               chamfer(device, mesh, measured_points(v.grid, cell_edge(mesh, v.grid.voxel_size)), o.chamfer));
        measures.push_back({size_t(n), v.grid.cells.size(), c});
        progress.update(measures.size(), device.allocated_bytes());
    }
    progress.finish();
    return measures;
}

void report(const EvalChamferArguments& o, const Globals& globals, const std::vector<Measure>& measures)
{
    if (globals.json) {
        Json list = Json::array();
        for (const Measure& m : measures)
            list.push_back({{"points", m.points},
                            {"cells", m.cells},
                            {"chamfer", m.chamfer.mean()},
                            {"squares", m.chamfer.squares},
                            {"points_to_surface", m.chamfer.to_surface},
                            {"surface_to_points", m.chamfer.to_points}});
        fmt::print("{}\n", Json{{"samples", o.chamfer.samples}, {"grids", list}}.dump());
        return;
    }
    fmt::print("{:>6} {:>9} {:>11} {:>19} {:>19} {:>13}\n", "points", "cells", "chamfer (m)", "points to surface",
               "surface to points", "squares (m2)");
    for (const Measure& m : measures)
        fmt::print("{:>6} {:>9} {:>11.5f} {:>19.6f} {:>19.5f} {:>13.4g}\n", m.points, m.cells, m.chamfer.mean(),
                   m.chamfer.to_surface, m.chamfer.to_points, m.chamfer.squares);
    fmt::print("chamfer is half the sum of both mean distances; squares is the sum of both means of squared distances, "
               "PyTorch3D's chamfer_distance\n");
}

Status write_csv(const std::string& path, const std::vector<Measure>& measures)
{
    std::string text = "points,cells,chamfer_m,points_to_surface_m,surface_to_points_m,squares_m2\n";
    for (const Measure& m : measures)
        text += fmt::format("{},{},{:.7g},{:.7g},{:.7g},{:.7g}\n", m.points, m.cells, m.chamfer.mean(),
                            m.chamfer.to_surface, m.chamfer.to_points, m.chamfer.squares);
    return write_file_atomically(path, text);
}

Status eval_chamfer(const EvalChamferArguments& o, const Globals& globals)
{
    if (!o.grid.empty() && !o.sweep.empty())
        return fail(ErrorCode::usage, "--sweep makes its own grids; give either POINTS or --sweep");
    if (!o.csv.empty() && is_there(o.csv) && !globals.yes)
        return fail(ErrorCode::usage, "{} exists; -y replaces it", quote_path(o.csv));
    if (!o.sweep.empty()) {
        SR_CHECK(points_of_sweep(o.sweep));
    }
    SR_TRY(const auto device, open_device(globals));
    SR_TRY(const std::vector<Measure> measures, measure_all(o, globals, *device));
    if (!o.csv.empty())
        SR_CHECK(write_csv(o.csv, measures));
    report(o, globals, measures);
    return {};
}

} // namespace

void add_eval_chamfer(CLI::App& eval, const Globals& globals, Run& run)
{
    auto o = std::make_shared<EvalChamferArguments>();
    CLI::App* c =
        eval.add_subcommand("chamfer", "how far points and a mesh, or other points, are from each other, in metres");
    c->add_option("TRUTH", o->mesh, "a mesh (.obj, .ply, .glb or .gltf), a cloud (a .ply without faces), or an .sgrid")
        ->required();
    c->add_option("POINTS", o->grid, ".sgrid, or a cloud; without one the mesh is voxelized");
    c->add_option("--sweep", o->sweep, "grids of FIRST..LAST points a voxel, doubled each time (and 20), or ..:STEP");
    add_number(*c, "--points", o->voxelize.points_per_voxel, "of a voxel (20)", 1, 4096);
    add_number(*c, "--voxel-size", o->voxelize.voxel_size, "metres (0.6)", 0.001, 1000.0);
    add_number(*c, "--samples", o->chamfer.samples, "of the surface (200000)", 1, 1 << 26);
    add_number_function<uint64_t>(*c, "--seed", [o](uint64_t seed) { o->voxelize.seed = o->chamfer.seed = seed; },
                                  "of points and samples (0)", {0, UINT64_MAX});
    add_choice(*c, "--up", {"y", "z"}, "axis of the file that points up", o->up);
    add_number(*c, "--scale", o->scale, "metres in a unit of the file (1)", 1e-6, 1e6);
    add_origin(*c, o->origin);
    c->add_option("--csv", o->csv, "also write the table there");
    c->callback([o, &globals, &run] { run = [o, &globals] { return eval_chamfer(*o, globals); }; });
}

} // namespace semrover
