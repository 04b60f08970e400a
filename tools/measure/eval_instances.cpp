// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover eval instances FRAMES TRUTH: whether pixels show the things that they should, and flow goes where it should
#include "engine/format/transforms.h"
#include "engine/scene/actors.h"
#include "engine/scene/scene_fields.h"
#include "runtime/base/json.h"
#include "runtime/base/quote.h"
#include "tools/cli/progress.h"
#include "tools/cli/value_options.h"
#include "tools/eval/sample_files.h"
#include "tools/eval/thing_agreement.h"
#include "tools/measure/eval.h"

#include <CLI/CLI.hpp>
#include <cmath>

namespace semrover {

namespace {

struct EvalInstancesArguments {
    std::string frames, truth, actors;
    SurfaceTolerance tolerance;
    bool flow = false;
};

// pictures of things, with their depth
struct ThingFiles {
    FrameFiles things, depth;
    double unit = kMillimetre;

    Result<ThingPicture> read(const std::string& name) const
    {
        ThingPicture p;
        SR_TRY(p.depth, read_depth_frame(depth.at(name), {}, unit));
        SR_TRY(p.things, read_instance_frame(things.at(name), {p.depth.width, p.depth.height}));
        return p;
    }
};

Result<ThingFiles> thing_files(const Path& folder)
{
    ThingFiles f;
    SR_TRY(f.things, list_frames(folder, "instance"));
    SR_TRY(f.depth, list_frames(folder, "depth"));
    SR_CHECK(check_names(f.things, folder / "instance", f.depth, folder / "depth", false));
    SR_TRY(f.unit, read_depth_unit(folder));
    return f;
}

struct InstanceInputs {
    ThingFiles found, truth;
    FrameFiles labels, flow; // true classes; flow may be empty
    std::vector<Actor> actors;
    std::map<std::string, CameraFrame> cameras;   // of every picture of the trajectory
    std::map<std::string, std::string> following; // the next picture of its camera
};

Status read_cameras(const Path& folder, InstanceInputs& in)
{
    SR_TRY(const CameraPath path, read_transforms(folder / "transforms.json"));
    std::map<std::string, uint32_t> counts;
    std::map<std::string, std::string> last;
    for (const CameraFrame& frame : path.frames) {
        const std::string number = fmt::format("{:06}", counts[frame.camera]++);
        const std::string name = frame.camera.empty() ? number : frame.camera + "/" + number;
        if (const auto before = last.find(frame.camera); before != last.end())
            in.following[before->second] = name;
        last[frame.camera] = name;
        in.cameras.emplace(name, frame);
    }
    return {};
}

Result<InstanceInputs> read_inputs(const EvalInstancesArguments& o)
{
    const Path frames = o.frames, truth = o.truth;
    InstanceInputs in;
    SR_TRY(in.found, thing_files(frames));
    SR_TRY(in.truth, thing_files(truth));
    SR_CHECK(check_names(in.found.things, frames, in.truth.things, truth, false));
    SR_TRY(in.labels, list_frames(truth, "label"));
    SR_CHECK(check_names(in.found.things, frames, in.labels, truth, false));
    if (!o.flow)
        return in;
    SR_TRY(in.flow, list_frames(frames, "flow"));
    SR_CHECK(read_cameras(truth, in));
    for (const auto& [name, path] : in.flow)
        if (!in.found.things.contains(name) || !in.cameras.contains(name))
            return fail(ErrorCode::bad_input, "{} is no frame of {} with a picture of instances", quote_path(path),
                        quote_path(truth / "transforms.json"));
    if (!o.actors.empty()) {
        SR_TRY(in.actors, read_actors(o.actors));
    }
    return in;
}

ThingMotions motions_between(std::span<const Actor> actors, const CameraFrame& now, const CameraFrame& next)
{
    ThingMotions y;
    for (const Actor& actor : actors)
        if (const auto here = pose_at(actor, microseconds_of(now.time)); here && actor.id < UINT16_MAX) {
            const auto there = pose_at(actor, microseconds_of(next.time));
            y.motions[uint16_t(instance_number(actor.id))] =
                there ? std::optional(compose(*there, inverse(*here))) : std::nullopt;
        }
    return y;
}

Status check_flow_size(const FlowPicture& flow, const ThingPicture& now, const ThingPicture& next, const Path& path)
{
    for (const DepthPicture* depth : {&now.depth, &next.depth})
        if (flow.width != depth->width || flow.height != depth->height)
            return fail(ErrorCode::bad_input, "{} is {} x {} pixels, depth of it and of the next frame {} x {}",
                        quote_path(path), flow.width, flow.height, depth->width, depth->height);
    return {};
}

struct InstanceFigures {
    ThingAgreement things;
    FlowErrors flow;
};

Result<InstanceFigures> measure_frame(const InstanceInputs& in, const std::string& name,
                                      const EvalInstancesArguments& o, PictureClasses& classes)
{
    SR_TRY(const ThingPicture found, in.found.read(name));
    SR_TRY(const ThingPicture truth, in.truth.read(name));
    const ImageSize size{truth.depth.width, truth.depth.height};
    if (ImageSize{found.depth.width, found.depth.height} != size)
        return fail(ErrorCode::bad_input, "{} is {} x {} pixels, the true picture {} x {}",
                    quote_path(in.found.depth.at(name)), found.depth.width, found.depth.height, size.width,
                    size.height);
    SR_TRY(const std::vector<uint8_t> labels, read_label_frame(in.labels.at(name), size, classes));
    InstanceFigures y{thing_agreement(found, truth, labels, o.tolerance), {}};
    const auto flow_file = in.flow.find(name);
    const auto following = in.following.find(name);
    if (flow_file == in.flow.end() || following == in.following.end() || !in.truth.things.contains(following->second))
        return y;
    SR_TRY(const FlowPicture flow, read_flow_png(flow_file->second));
    SR_TRY(const ThingPicture next, in.truth.read(following->second));
    SR_CHECK(check_flow_size(flow, truth, next, flow_file->second));
    const CameraFrame &now = in.cameras.at(name), &then = in.cameras.at(following->second);
    ThingMotions motions = motions_between(in.actors, now, then);
    motions.things = truth.things;
    const Flow true_flow = flow_between(then, next.depth, now, truth.depth, {}, motions);
    y.flow = flow_errors(flow, true_flow, found, truth, motions, o.tolerance);
    return y;
}

Json counts_json(const ThingAgreement::Counts& c)
{
    return {{"pixels", c.pixels}, {"one_surface", c.shared}, {"equal", c.equal}, {"share", c.share()}};
}

Json errors_json(std::vector<float>& errors)
{
    return {{"pixels", errors.size()},
            {"median", quantile(errors, 0.5)},
            {"p95", quantile(errors, 0.95)},
            {"worst", quantile(errors, 1)}};
}

Json figures_json(InstanceFigures& f, bool with_flow)
{
    Json j = counts_json(f.things.all);
    if (with_flow)
        j["flow"] = {
            {"seen", f.flow.seen}, {"standing", errors_json(f.flow.standing)}, {"moving", errors_json(f.flow.moving)}};
    return j;
}

// pairs of a true number and another that many pixels show in its place, most first
Json mistaken_json(const ThingAgreement& things)
{
    constexpr size_t kMost = 30;
    std::vector<std::pair<uint64_t, std::pair<uint16_t, uint16_t>>> pairs;
    for (const auto& [numbers, pixels] : things.mistaken)
        pairs.emplace_back(pixels, numbers);
    std::ranges::sort(pairs, std::greater{});
    Json list = Json::array();
    for (const auto& [pixels, numbers] : pairs) {
        if (list.size() == kMost)
            break;
        list.push_back({{"true", numbers.first}, {"shown", numbers.second}, {"pixels", pixels}});
    }
    return list;
}

void print_row(std::string_view name, const ThingAgreement::Counts& c)
{
    fmt::print("{:13} {:>11} {:>12} {:>9.3f}\n", name, c.pixels, c.shared, 100 * c.share());
}

void print(InstanceFigures& f, size_t frames, bool with_flow)
{
    fmt::print("{} frames\n{:13} {:>11} {:>12} {:>9}\n", frames, "", "pixels", "one surface", "equal, %");
    print_row("all", f.things.all);
    for (size_t i = 0; i < f.things.labels.size(); ++i)
        if (f.things.labels[i].pixels)
            print_row(label_name(i), f.things.labels[i]);
    if (!with_flow)
        return;
    fmt::print("{:13} {:>11} {:>12} {:>9} {:>9}\n", "flow, pixels", "compared", "median", "95 %", "worst");
    for (const auto& [name, errors] : {std::pair{"standing", &f.flow.standing}, {"moving", &f.flow.moving}})
        fmt::print("{:13} {:>11} {:>12.4f} {:>9.4f} {:>9.3f}\n", name, errors->size(), quantile(*errors, 0.5),
                   quantile(*errors, 0.95), quantile(*errors, 1));
}

Status eval_instances(const EvalInstancesArguments& o, const Globals& globals)
{
    SR_TRY(const InstanceInputs in, read_inputs(o));
    SR_TRY(PictureClasses classes, PictureClasses::create(""));
    const bool with_flow = !in.flow.empty();
    InstanceFigures total;
    Json rows = Json::array();
    Progress progress(progress_to_stderr(globals), "instances", "frames", in.found.things.size());
    for (const auto& [name, path] : in.found.things) {
        SR_TRY(InstanceFigures f, measure_frame(in, name, o, classes));
        total.things += f.things;
        total.flow += f.flow;
        Json& row = rows.emplace_back(figures_json(f, with_flow && in.flow.contains(name)));
        row["name"] = printable(name);
        progress.update(rows.size());
        if (interrupt_requested() && rows.size() < in.found.things.size())
            return fail(ErrorCode::interrupted, "interrupted after {} of {} frames", rows.size(),
                        in.found.things.size());
    }
    progress.finish();
    if (!globals.json) {
        print(total, rows.size(), with_flow);
        return {};
    }
    Json report = figures_json(total, with_flow);
    report["metric"] = "instances";
    report["labels"] = Json::object();
    for (size_t i = 0; i < total.things.labels.size(); ++i)
        if (total.things.labels[i].pixels)
            report["labels"][label_name(i)] = counts_json(total.things.labels[i]);
    report["mistaken"] = mistaken_json(total.things);
    report["frames"] = std::move(rows);
    fmt::print("{}\n", json_text(report));
    return {};
}

} // namespace

void add_eval_instances(CLI::App& eval, const Globals& globals, Run& run)
{
    auto o = std::make_shared<EvalInstancesArguments>();
    CLI::App* c = eval.add_subcommand("instances", "pictures of instances, and optical flow, against true ones");
    c->add_option("FRAMES", o->frames, "what `render --instances` wrote: instance/ and depth/, with --flow flow/")
        ->required();
    c->add_option("TRUTH", o->truth, "what `streets --images` wrote: instance/, depth/, label/ and transforms.json")
        ->required();
    CLI::Option* flow = c->add_flag("--flow", o->flow, "also optical flow, of `render --flow png`");
    c->add_option("--actors", o->actors, "actors.json: what moved, for the true flow")->needs(flow);
    add_number(*c, "--tolerance", o->tolerance.metres, "metres by which depths of one surface may differ; 0.05", 0.0,
               100.0);
    add_number(*c, "--relative-tolerance", o->tolerance.relative, "and beside it this share of the depth; 0.01", 0.0,
               1.0);
    c->callback([o, &globals, &run] { run = [o, &globals] { return eval_instances(*o, globals); }; });
}

} // namespace semrover
