// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover eval surface MESH TRUTH: how far a mesh's vertices lie from the true surface, and how many labels are right
#include "engine/fusion/surface_error.h"
#include "engine/mesh/mesh_files.h"
#include "engine/mesh/transparency.h"
#include "engine/scene/palette.h"
#include "runtime/base/json.h"
#include "tools/cli/camera_options.h"
#include "tools/cli/open_device.h"
#include "tools/cli/print_stderr.h"
#include "tools/cli/value_options.h"
#include "tools/fuse/fusion_folder.h"
#include "tools/measure/eval.h"

#include <CLI/CLI.hpp>
#include <numeric>

namespace semrover {

namespace {

struct EvalSurfaceArguments {
    std::string mesh, truth;
    std::string frames;
    FusionFolderOptions input;
    std::string poses;
    PathOptions placement;
    double radius = 5;
    uint32_t min_views = 2;
};

// by class of the true surface
Json classes_of(const SurfaceError& error)
{
    Json list = Json::object();
    for (size_t label = 0; label < kClassCount; ++label)
        if (const auto count = std::ranges::count(error.classes, uint8_t(label))) {
            const auto& found = error.confusion[label];
            list[label_name(label)] = {{"vertices", count},
                                       {"area", std::accumulate(found.begin(), found.end(), 0.0)},
                                       {"right", found[label]},
                                       {"p50", error.percentile(0.5, uint8_t(label))},
                                       {"p95", error.percentile(0.95, uint8_t(label))}};
        }
    return list;
}

// the commonest mistakes, most first
Json mistakes_of(const SurfaceError& error)
{
    std::vector<std::tuple<double, size_t, size_t>> mistakes;
    for (size_t truth = 0; truth < error.confusion.size(); ++truth)
        for (size_t found = 0; found < error.confusion.size(); ++found)
            if (truth != found && error.confusion[truth][found] > 0)
                mistakes.emplace_back(error.confusion[truth][found], truth, found);
    std::ranges::sort(mistakes, std::greater());
    Json list = Json::array();
    for (size_t i = 0; i < std::min<size_t>(mistakes.size(), 10); ++i) {
        const auto& [area, truth, found] = mistakes[i];
        list.push_back({{"truth", label_name(truth)}, {"found", label_name(found)}, {"area", area}});
    }
    return list;
}

Json report_of(const SurfaceError& error)
{
    Json report = {{"vertices", error.vertices},    {"measured", error.distances.size()},
                   {"beyond_radius", error.beyond}, {"labelled_area", error.labelled},
                   {"right_area", error.right},     {"mistakes", mistakes_of(error)}};
    for (const auto& [name, share] : {std::pair{"p50", 0.5}, {"p90", 0.9}, {"p95", 0.95}, {"p99", 0.99}, {"max", 1.0}})
        report["distance"][name] = error.percentile(share);
    report["label_accuracy"] = error.labelled > 0 ? error.right / error.labelled : 0.0;
    return report;
}

void print(const SurfaceError& error, const EvalSurfaceArguments& o)
{
    fmt::print("{} of {} vertices", error.distances.size(), error.vertices);
    if (!o.frames.empty())
        fmt::print(", those that at least {} frames saw", o.min_views);
    fmt::print("\ndistance to the true surface: 50 % {:.4f} m, 90 % {:.4f} m, 95 % {:.4f} m, 99 % {:.4f} m\n",
               error.percentile(0.5), error.percentile(0.9), error.percentile(0.95), error.percentile(0.99));
    if (error.beyond)
        fmt::print("{} are further than {} m\n", error.beyond, o.radius);
    if (error.labelled > 0)
        fmt::print("labels right: {:.2f} % of {:.1f} m2\n", 100 * error.right / error.labelled, error.labelled);
    const Json classes = classes_of(error);
    for (const auto& [name, c] : classes.items())
        fmt::print("  {:13} {:8} vertices, 95 % within {:.4f} m, labels right: {:.2f} %\n", name,
                   c["vertices"].get<uint64_t>(), c["p95"].get<double>(),
                   100 * c["right"].get<double>() / std::max(c["area"].get<double>(), 1e-12));
    for (const Json& m : mistakes_of(error))
        fmt::print("  {} taken for {}: {:.1f} m2\n", m["truth"].get<std::string>(), m["found"].get<std::string>(),
                   m["area"].get<double>());
}

Status run_surface(EvalSurfaceArguments o, const Globals& globals)
{
    if (o.frames.empty() && o.placement.any())
        return fail(ErrorCode::usage, "--relative-to, --calib, --world and --origin are of a trajectory: --frames");
    // colours do not matter here
    const MeshReadOptions options{.missing_textures = MissingTextures::white};
    SR_TRY(Mesh mesh, read_mesh(o.mesh, options));
    SR_TRY(const Mesh truth, read_mesh(o.truth, options));
    print_warnings(mesh.warnings, globals);
    print_warnings(truth.warnings, globals);
    if (has_transparency(mesh))
        mesh = opaque_parts(mesh).mesh;
    std::vector<uint32_t> views;
    if (!o.frames.empty()) {
        o.input.poses = o.poses;
        SR_TRY(o.input.placement, placement_of(o.placement));
        SR_TRY(const FusionFolder folder, FusionFolder::open(o.frames, o.input));
        print_warnings(folder.warnings(), globals);
        DepthFrames frames = folder.frames();
        SR_TRY(views, count_views(mesh, frames));
    }
    SR_TRY(const auto device, open_device(globals));
    SR_TRY(const SurfaceError error, measure_surface(*device, mesh, truth, views, o.min_views, o.radius));
    if (globals.json)
        fmt::print("{}\n", json_text(report_of(error)));
    else
        print(error, o);
    return {};
}

} // namespace

void add_eval_surface(CLI::App& eval, const Globals& globals, Run& run)
{
    auto o = std::make_shared<EvalSurfaceArguments>();
    CLI::App* c = eval.add_subcommand("surface", "distance of a mesh's vertices from the true surface, and labels");
    c->add_option("MESH", o->mesh, "what was made: .glb, .ply or .obj")->required();
    c->add_option("TRUTH", o->truth, "the true mesh, likewise")->required();
    c->add_option("--frames", o->frames, "folder of depth pictures, as for fuse: only vertices they saw are measured");
    c->add_option("--poses", o->poses, "trajectory of these; FRAMES/transforms.json");
    add_placement_options(*c, o->placement);
    add_number(*c, "--fov-x", o->input.fov_x, "degrees, where files have no intrinsics", 1.0, 179.0);
    add_depth_options(*c, o->input.depth);
    add_number(*c, "--min-views", o->min_views, "frames that must have seen a vertex; 2", 1, 1000);
    add_number(*c, "--radius", o->radius, "metres, of the search for the true surface; 5", 0.01, 1e3);
    c->callback([o, &globals, &run] { run = [o, &globals] { return run_surface(*o, globals); }; });
}

} // namespace semrover
