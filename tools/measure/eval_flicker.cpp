// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover eval flicker FRAMES --depth DIR --path P: what changes from frame to frame although nothing moves
#include "engine/format/transforms.h"
#include "runtime/base/json.h"
#include "runtime/base/quote.h"
#include "tools/cli/camera_options.h"
#include "tools/cli/print_stderr.h"
#include "tools/cli/progress.h"
#include "tools/cli/value_options.h"
#include "tools/eval/flicker.h"
#include "tools/eval/sample_files.h"
#include "tools/measure/eval.h"
#include "tools/trajectory/camera_path.h"

#include <CLI/CLI.hpp>
#include <map>

namespace semrover {

namespace {

struct EvalFlickerArguments {
    std::string frames, depth, path, truth;
    LensOptions lens;
    PathOptions placement;
    WarpOptions flow;
    std::optional<double> depth_unit; // metres; none: as the folder's transforms.json says
};

struct NamedCamera {
    std::string name; // [CAMERA/]NNNNNN
    CameraFrame camera;
};

struct Step {
    NamedCamera from, to;
};

struct FlickerInputs {
    FrameFiles frames, depth, truth; // the last may be empty
    double depth_unit = kMillimetre;
    std::vector<Step> steps;
    std::vector<std::string> warnings;
};

// the path's frames that have pictures, next to the ones before them
Result<std::vector<Step>> steps_of(const CameraPath& path, const FrameFiles& frames, const EvalFlickerArguments& o)
{
    std::map<std::string, uint32_t> counts;
    std::map<std::string, NamedCamera> last; // of each camera
    std::vector<Step> steps;
    size_t used = 0;
    for (const CameraFrame& camera : path.frames) {
        const std::string number = fmt::format("{:06}", counts[camera.camera]++);
        NamedCamera now{camera.camera.empty() ? number : camera.camera + "/" + number, camera};
        if (!frames.contains(now.name)) {
            last.erase(camera.camera);
            continue;
        }
        ++used;
        if (const auto before = last.find(camera.camera); before != last.end())
            steps.push_back({before->second, now});
        last.insert_or_assign(camera.camera, std::move(now));
    }
    if (used != frames.size())
        return fail(ErrorCode::bad_input,
                    "{} holds {} pictures, {} of them frames of {}, which has {}: expected names "
                    "[CAMERA/]000000 and so on, in the path's order",
                    quote_path(o.frames), frames.size(), used, quote_path(o.path), path.frames.size());
    if (steps.empty())
        return fail(ErrorCode::bad_input, "{} holds {} frames of {}: expected two or more, one after the other",
                    quote_path(o.frames), used, quote_path(o.path));
    return steps;
}

Result<FlickerInputs> read_inputs(const EvalFlickerArguments& o)
{
    FlickerInputs in;
    SR_TRY(in.frames, list_frames(o.frames, "color"));
    SR_TRY(in.depth, list_frames(o.depth, "depth"));
    SR_CHECK(check_names(in.frames, o.frames, in.depth, o.depth, false));
    if (!o.truth.empty()) {
        SR_TRY(in.truth, list_frames(o.truth, "color"));
        SR_CHECK(check_names(in.frames, o.frames, in.truth, o.truth, false));
    }
    LensOptions lens = o.lens;
    const Path depth = o.depth;
    SR_TRY(const double said, depth_unit_of(depth));
    in.depth_unit = o.depth_unit.value_or(said);
    SR_TRY(const DepthPicture first, read_depth_frame(in.depth.begin()->second, {}, in.depth_unit));
    if (lens.width == 0)
        lens.width = first.width;
    if (lens.height == 0)
        lens.height = first.height;
    lens.size_given = true; // the pictures have it
    SR_TRY(const PathLens camera, path_lens_of(lens));
    SR_TRY(const PathPlacement placement, placement_of(o.placement));
    SR_TRY(CameraPath path, read_camera_path(o.path, camera, placement));
    in.warnings = std::move(path.warnings);
    if (path.body)
        in.warnings.push_back(body_text(quote_path(o.path), *path.body));
    SR_TRY(in.steps, steps_of(path, in.frames, o));
    return in;
}

// pictures of the frame that was read last, which is the first of the next step
struct Pictures {
    std::string name;
    DepthPicture depth;
    ImageRgb8 frame, truth;
};

Result<Pictures> read_pictures(const FlickerInputs& in, const NamedCamera& camera)
{
    const ImageSize size{camera.camera.intrinsics.width, camera.camera.intrinsics.height};
    Pictures p;
    p.name = camera.name;
    const Path& depth = in.depth.at(camera.name);
    SR_TRY(p.depth, read_depth_frame(depth, {}, in.depth_unit));
    if (ImageSize{p.depth.width, p.depth.height} != size)
        return fail(ErrorCode::bad_input, "{} is {} x {} pixels, the camera of the path has {} x {}", quote_path(depth),
                    p.depth.width, p.depth.height, size.width, size.height);
    SR_TRY(p.frame, read_color_frame(in.frames.at(camera.name), size));
    if (!in.truth.empty()) {
        SR_TRY(p.truth, read_color_frame(in.truth.at(camera.name), size));
    }
    return p;
}

struct Flicker {
    WarpSums frames, truth;
};

class StepReader {
  public:
    StepReader(const FlickerInputs& in, const WarpOptions& flow) : in_(in), flow_(flow) {}

    Result<Flicker> measure(const Step& step)
    {
        Pictures& before = last_[step.from.camera.camera];
        if (before.name != step.from.name) {
            SR_TRY(before, read_pictures(in_, step.from));
        }
        SR_TRY(Pictures now, read_pictures(in_, step.to));
        const Flow flow = flow_between(step.from.camera, before.depth, step.to.camera, now.depth, flow_);
        Flicker y{warped_difference(flow, before.frame, now.frame), {}};
        if (!in_.truth.empty())
            y.truth = warped_difference(flow, before.truth, now.truth);
        before = std::move(now);
        return y;
    }

  private:
    const FlickerInputs& in_;
    WarpOptions flow_;
    std::map<std::string, Pictures> last_; // of each camera
};

Json flicker_json(const Flicker& f, bool with_truth)
{
    Json j = {{"pixels", f.frames.pixels}, {"with_depth", f.frames.with_depth}, {"valid", f.frames.valid},
              {"share", f.frames.share()}, {"mean", f.frames.mean()},           {"rms", f.frames.rms()}};
    if (with_truth)
        j["truth"] = {{"mean", f.truth.mean()}, {"rms", f.truth.rms()}};
    return j;
}

void print(const Flicker& f, size_t steps, bool with_truth)
{
    fmt::print("{} pairs of frames, {:.1f} % of pixels can be compared\n", steps, 100 * f.frames.share());
    fmt::print("flicker of the frames: {:.3f} in the mean, {:.3f} root mean square, of 255\n", f.frames.mean(),
               f.frames.rms());
    if (with_truth)
        fmt::print("the truth's own:       {:.3f} in the mean, {:.3f} root mean square\n", f.truth.mean(),
                   f.truth.rms());
}

Status eval_flicker(const EvalFlickerArguments& o, const Globals& globals)
{
    SR_TRY(const FlickerInputs in, read_inputs(o));
    print_warnings(in.warnings, globals);
    const bool with_truth = !in.truth.empty();
    StepReader reader(in, o.flow);
    Flicker total;
    Json rows = Json::array();
    Progress progress(progress_to_stderr(globals), "flicker", "pairs", in.steps.size());
    for (const Step& step : in.steps) {
        SR_TRY(const Flicker f, reader.measure(step));
        total.frames += f.frames;
        total.truth += f.truth;
        Json& row = rows.emplace_back(flicker_json(f, with_truth));
        row["from"] = printable(step.from.name);
        row["to"] = printable(step.to.name);
        progress.update(rows.size());
        if (interrupt_requested() && rows.size() < in.steps.size())
            return fail(ErrorCode::interrupted, "interrupted after {} of {} pairs", rows.size(), in.steps.size());
    }
    progress.finish();
    if (total.frames.valid == 0)
        return fail(ErrorCode::bad_input,
                    "no pixel of {} pairs can be compared ({} have depth): do {} and the path belong together?",
                    in.steps.size(), total.frames.with_depth, quote_path(o.depth));
    if (!globals.json) {
        print(total, in.steps.size(), with_truth);
        return {};
    }
    Json report = flicker_json(total, with_truth);
    report["metric"] = "flicker";
    report["tolerance"] = o.flow.tolerance;
    report["pairs"] = std::move(rows);
    fmt::print("{}\n", json_text(report));
    return {};
}

} // namespace

void add_eval_flicker(CLI::App& eval, const Globals& globals, Run& run)
{
    auto o = std::make_shared<EvalFlickerArguments>();
    o->lens.width = o->lens.height = 0; // those of the depth pictures
    CLI::App* c = eval.add_subcommand("flicker", "change from frame to frame that depth and poses do not explain");
    c->add_option("FRAMES", o->frames, "a folder of pictures 000000 and so on, or what `refine` or `render` wrote")
        ->required();
    c->add_option("--depth", o->depth, "depth of these names: 16-bit PNG (0 and 65535: nothing) or .npy")->required();
    c->add_option("--path", o->path, "trajectory of the frames, in any format that `render` reads")->required();
    c->add_option("--truth", o->truth, "true pictures of these names: also their figure, which is the floor");
    add_number(*c, "--depth-scale", o->depth_unit,
               "metres of one unit of depth; what transforms.json in its folder says, else 0.001", 1e-6, 10.0);
    add_number(*c, "--tolerance", o->flow.tolerance, "relative, of the depths of both frames; 0.01", 1e-6, 1.0);
    add_lens_options(*c, o->lens);
    add_placement_options(*c, o->placement);
    c->callback([o, &globals, &run] { run = [o, &globals] { return eval_flicker(*o, globals); }; });
}

} // namespace semrover
