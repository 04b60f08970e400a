// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover view GRID -m MODEL: a window on a street that is generated around the camera; --screenshot: a picture of it
#include "runtime/base/final_name.h"
#include "runtime/base/json.h"
#include "runtime/base/quote.h"
#include "tools/cli/commands.h"
#include "tools/cli/print_stderr.h"
#include "tools/cli/value_options.h"
#include "tools/view/script.h"
#include "tools/view/viewer.h"

#include <CLI/CLI.hpp>

namespace semrover {

namespace {

constexpr double kDegree = 0.017453292519943295;

struct ViewArguments {
    view::ViewRequest request;
    Path screenshot, script;
    std::string renderer, host_memory = "1GiB", splat_memory = "128MiB", position;
    std::optional<double> yaw, pitch;
    double fov = 73;
    bool no_panels = false;
};

Result<view::Vector> position_of(const std::string& text)
{
    view::Vector place{};
    std::stringstream parts(text + ",");
    std::string part;
    size_t count = 0;
    for (; std::getline(parts, part, ','); ++count) {
        const auto number = parse_number<double>(part, {-1e6, 1e6});
        if (!number || count == place.size())
            return fail(ErrorCode::usage, "--at takes X,Y,Z in metres, not {}", quote(text));
        place[count] = *number;
    }
    if (count != place.size())
        return fail(ErrorCode::usage, "--at takes X,Y,Z in metres, not {}", quote(text));
    return place;
}

Result<uint64_t> bytes_of(const char* option, const std::string& text)
{
    const Result<uint64_t> bytes = parse_memory_size(text);
    if (!bytes || *bytes == 0)
        return fail(ErrorCode::usage, "{}: {}", option,
                    bytes ? "expected more than nothing" : bytes.error().message.c_str());
    return bytes;
}

Result<view::ViewRequest> request_of(const ViewArguments& o, const Globals& globals)
{
    if (!globals.require.empty())
        return fail(ErrorCode::usage, "`require`: view draws on any device; `device` names one");
    view::ViewRequest r = o.request;
    r.device = globals.device;
    r.max_bytes = globals.max_vram;
    r.replace = globals.yes;
    r.window = o.screenshot.empty();
    r.panels = !o.no_panels;
    r.fov = o.fov * kDegree;
    SR_TRY(r.street.host_bytes, bytes_of("--tile-memory", o.host_memory));
    SR_TRY(r.street.splat_bytes, bytes_of("--splat-memory", o.splat_memory));
    if (!o.position.empty()) {
        SR_TRY(r.position, position_of(o.position));
    }
    if (o.yaw)
        r.yaw = *o.yaw * kDegree;
    if (o.pitch)
        r.pitch = *o.pitch * kDegree;
    r.refiner.model = o.renderer.empty() ? r.street.model : o.renderer;
    r.refiner.seed = r.street.seed;
    if (!globals.quiet)
        r.street.warning = [](const std::string& line) {
            print_stderr("semrover: warning: {}\n", printable(line, 400));
        };
    return r;
}

// before a window is opened and a model loaded
Status check_inputs(const view::ViewRequest& r)
{
    for (const Path& input : {r.street.grid, Path(r.street.model), Path(r.street.objects), Path(r.refiner.model)})
        if (!input.empty() && !is_there(input))
            return fail(ErrorCode::bad_input, "{}: no such file or folder", quote_path(input));
    return {};
}

Result<view::Script> script_of(const ViewArguments& o, const Globals& globals)
{
    view::Script script;
    if (!o.script.empty()) {
        SR_TRY(script, view::Script::read(o.script));
    }
    if (o.screenshot.empty())
        return script;
    SR_CHECK(refuse_existing(o.screenshot, globals.yes));
    SR_CHECK(AtomicFile::create(o.screenshot).map([](const AtomicFile&) {})); // not only after minutes of generating
    SR_CHECK(script.add("wait", "--screenshot"));
    SR_CHECK(script.add_shot(o.screenshot, "--screenshot"));
    SR_CHECK(script.add("quit", "--screenshot"));
    return script;
}

Json results_of(const view::Viewer& viewer)
{
    const view::Figures& f = viewer.figures();
    Json json = {{"frames", f.frames},
                 {"ms_frame", f.frame.mean()},
                 {"ms_step", f.step.mean()},
                 {"ms_draw", f.draw.mean()},
                 {"tiles_wanted", f.world.wanted},
                 {"tiles_finished", f.world.finished},
                 {"tiles_generated", f.world.generated},
                 {"tiles_loaded", f.world.loaded},
                 {"splats", f.world.splats},
                 {"device_bytes", f.memory.used_bytes},
                 {"peak_device_bytes", f.memory.peak_bytes},
                 {"path_cameras", viewer.recorder.size()}};
    if (viewer.picked())
        json["cell"] = {{"ijk", {viewer.picked()->cell.i, viewer.picked()->cell.j, viewer.picked()->cell.k}},
                        {"label", sr_class_name(viewer.picked()->cell.label)},
                        {"tile", viewer.picked()->tile},
                        {"points", viewer.picked()->points.size()}};
    return json;
}

Status run_view(const ViewArguments& o, const Globals& globals)
{
    SR_TRY(const view::ViewRequest request, request_of(o, globals));
    SR_CHECK(check_inputs(request));
    SR_TRY(view::Script script, script_of(o, globals));
    SR_TRY(const auto viewer, view::Viewer::open(request));
    SR_CHECK(viewer->run(script));
    if (globals.json) {
        fmt::print("{}\n", json_text(results_of(*viewer)));
        return {};
    }
    const view::Figures& f = viewer->figures();
    if (!globals.quiet)
        fmt::print("{} frames, {:.1f} ms each at the end: {:.1f} step, {:.1f} draw; {} tiles generated, {} splats\n",
                   f.frames, f.frame.mean(), f.step.mean(), f.draw.mean(), f.world.generated, f.world.splats);
    return {};
}

void add_world_options(CLI::App& c, ViewArguments& o)
{
    view::ViewRequest& r = o.request;
    c.add_option("-m,--model", r.street.model, "model folder")->required();
    c.add_option("--renderer", o.renderer, "a renderer's folder, to refine views with; else that of --model");
    c.add_option("--cache", r.street.cache, "a folder that keeps finished tiles for later");
    c.add_option("--objects", r.street.objects, "boxes and colours that condition the model; else guessed");
    add_seed(c, "-s,--seed", r.street.seed, "noise seed");
    add_number(c, "--steps", r.street.steps, "denoising steps of points; else as the model says", 1u, 10000u);
    add_number(c, "--refine-steps", r.refiner.steps, "denoising steps of a refined frame; else as the model says", 1u,
               10000u);
    add_number(c, "--radius", r.street.radius, "metres around the camera that are generated; 20", 0., 2000.);
    add_number(c, "--splat-radius", r.street.splat_radius, "of splats, in metres; else from the distance of the points",
               0.001, 10.);
    add_number(c, "--budget", r.budget_ms,
               "milliseconds of a frame in which points are generated; 8, without a window 500 at least", 0.001,
               10000.);
    add_number(c, "--detail-distance", r.street.detail_distance,
               "metres within which each point has a splat, farther away fewer have; 0: everywhere", 0., 2000.);
    c.add_option("--tile-memory", o.host_memory, "of the host, for tiles; 1GiB");
    c.add_option("--splat-memory", o.splat_memory, "of the device, for splats; 128MiB");
}

void add_picture_options(CLI::App& c, ViewArguments& o)
{
    view::ViewRequest& r = o.request;
    add_number(c, "-W,--width", r.width, "of window or picture, in pixels; 1280", 16u, 8192u);
    add_number(c, "-H,--height", r.height, "of window or picture, in pixels; 720", 16u, 8192u);
    c.add_option("--at", o.position, "X,Y,Z in metres where the camera starts; else over a road in the middle");
    add_number(c, "--yaw", o.yaw, "degrees to the left of x that the camera looks", -360., 360.);
    add_number(c, "--pitch", o.pitch, "degrees upwards that the camera looks", -88., 88.);
    add_number(c, "--fov-x", o.fov, "degrees across; 73", 5., 150.);
    add_choice(c, "--show", {"color", "depth", "normal", "labels", "cells", "instances"}, "what the picture shows",
               [&r](const auto& word) {
                   r.shown = view::Shown(std::ranges::find(view::kShownNames, word) - view::kShownNames.begin());
               });
    c.add_flag("--no-panels", o.no_panels, "the picture alone");
    c.add_option("--screenshot", o.screenshot,
                 "no window, and no X: write a PNG of picture and panels once all around the camera is generated");
    c.add_option("--script", o.script, "a file of steps to do, one a frame (docs/usage.md)");
}

} // namespace

void add_view(CLI::App& app, const Globals& globals, Run& run)
{
    auto o = std::make_shared<ViewArguments>();
    CLI::App* c = app.add_subcommand("view", "look at a street, fly through it, paint it, refine a view");
    c->add_option("GRID", o->request.street.grid, "labels: a .sgrid file or a folder of tiles")->required();
    add_world_options(*c, *o);
    add_picture_options(*c, *o);
    c->callback([o, &globals, &run] { run = [o, &globals] { return run_view(*o, globals); }; });
}

} // namespace semrover
