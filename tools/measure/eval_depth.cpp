// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover eval depth FRAMES TRUTH: how far depths of pictures of equal names are from each other
#include "runtime/base/json.h"
#include "runtime/base/quote.h"
#include "tools/cli/camera_options.h"
#include "tools/cli/progress.h"
#include "tools/cli/value_options.h"
#include "tools/eval/depth_error.h"
#include "tools/eval/sample_files.h"
#include "tools/measure/eval.h"

#include <CLI/CLI.hpp>

namespace semrover {

namespace {

struct EvalDepthArguments {
    std::string frames, truth;
    DepthEncoding of_frames, of_truth; // the latter's, where it has none, are the former's
    std::optional<double> fov_x;       // degrees
    std::optional<double> most;        // metres
};

struct DepthFolder {
    FrameFiles files;
    DepthEncoding encoding;

    bool along_rays() const { return encoding.kind == DepthKind::ray; }
};

Result<DepthFolder> list_depth(const Path& folder, const DepthEncoding& encoding)
{
    DepthFolder y{{}, encoding};
    SR_TRY(y.files, list_frames(folder, "depth"));
    SR_TRY(y.encoding.usual_unit, depth_unit_of(folder));
    return y;
}

struct DepthInputs {
    DepthFolder frames, truth;
    std::optional<double> fov_x; // where one of them is along rays
};

Result<DepthInputs> read_inputs(const EvalDepthArguments& o)
{
    DepthEncoding of_truth = o.of_truth;
    if (!of_truth.kind)
        of_truth.kind = o.of_frames.kind;
    if (!of_truth.unit)
        of_truth.unit = o.of_frames.unit;
    DepthInputs in;
    SR_TRY(in.frames, list_depth(o.frames, o.of_frames));
    SR_TRY(in.truth, list_depth(o.truth, of_truth));
    SR_CHECK(check_names(in.frames.files, o.frames, in.truth.files, o.truth, true));
    const bool one_kind = in.frames.along_rays() == in.truth.along_rays();
    if (one_kind && o.fov_x)
        return fail(ErrorCode::usage, "--fov-x has no meaning for depths that are both along rays, or both along the "
                                      "axis");
    if (!one_kind && !o.fov_x)
        return fail(ErrorCode::usage,
                    "depth along rays and depth along the axis compare through the camera: --fov-x is needed");
    in.fov_x = o.fov_x;
    return in;
}

Result<DepthImage> read_depth(const DepthFolder& folder, const std::string& name, std::optional<double> fov_x)
{
    SR_TRY(DepthImage image, read_depth_image(folder.files.at(name), folder.encoding));
    if (fov_x && folder.along_rays())
        make_axial(image, pinhole_from_fov(*fov_x, image.size.width, image.size.height));
    return image;
}

Result<DepthErrors> measure_frame(const DepthInputs& in, const std::string& name, const EvalDepthArguments& o)
{
    SR_TRY(const DepthImage frame, read_depth(in.frames, name, in.fov_x));
    SR_TRY(const DepthImage truth, read_depth(in.truth, name, in.fov_x));
    if (frame.size != truth.size)
        return fail(ErrorCode::bad_input, "{} is {} x {} pixels, expected {} x {}", quote_path(in.truth.files.at(name)),
                    truth.size.width, truth.size.height, frame.size.width, frame.size.height);
    return depth_errors(frame.metres, truth.metres, o.most.value_or(std::numeric_limits<double>::infinity()));
}

using Figures = std::array<double, kDepthFigures.size()>;

struct MeanErrors { // of the frames that have a pixel that counts
    Figures sum{};
    size_t frames = 0;

    void add(const Figures& figures)
    {
        for (size_t i = 0; i < sum.size(); ++i)
            sum[i] += figures[i];
        ++frames;
    }
    Figures mean() const
    {
        Figures y = sum;
        for (double& v : y)
            v /= double(frames);
        return y;
    }
};

void put_figures(const Figures& figures, Json& to)
{
    for (size_t i = 0; i < figures.size(); ++i)
        to[kDepthFigures[i]] = figures[i];
}

Json errors_json(const DepthErrors& e)
{
    Json j = {{"true_pixels", e.truth}, {"pixels", e.pixels}, {"share", e.share()}};
    if (e.pixels)
        put_figures(e.figures(), j);
    return j;
}

void print_row(std::string_view name, const Figures& f)
{
    fmt::print("{:15}", name);
    for (const double v : f)
        fmt::print(" {:>9.4f}", v);
    fmt::print("\n");
}

void print(const DepthErrors& total, const MeanErrors& mean, size_t frames)
{
    fmt::print("{} frames, {:.2f} % of {} pixels with a true depth have one\n{:15}", frames, 100 * total.share(),
               total.truth, "");
    for (const char* title : {"AbsRel", "SqRel, m", "RMSE, m", "RMSE log", "< 1.25", "< 1.25^2", "< 1.25^3"})
        fmt::print(" {:>9}", title);
    fmt::print("\n");
    print_row("all pixels", total.figures());
    print_row("mean of frames", mean.mean());
}

Status eval_depth(const EvalDepthArguments& o, const Globals& globals)
{
    SR_TRY(const DepthInputs in, read_inputs(o));
    DepthErrors total;
    MeanErrors mean;
    Json rows = Json::array();
    const size_t frames = in.frames.files.size();
    Progress progress(progress_to_stderr(globals), "depth", "frames", frames);
    for (const auto& [name, path] : in.frames.files) {
        SR_TRY(const DepthErrors errors, measure_frame(in, name, o));
        total += errors;
        if (errors.pixels)
            mean.add(errors.figures());
        Json& row = rows.emplace_back(errors_json(errors));
        row["name"] = printable(name);
        progress.update(rows.size());
        if (interrupt_requested() && rows.size() < frames)
            return fail(ErrorCode::interrupted, "interrupted after {} of {} frames", rows.size(), frames);
    }
    progress.finish();
    if (total.pixels == 0)
        return fail(ErrorCode::bad_input, "no pixel of {} frames can be compared: {} have a depth in {} that counts",
                    frames, total.truth, quote_path(o.truth));
    if (!globals.json) {
        print(total, mean, frames);
        return {};
    }
    Json report = errors_json(total);
    report["metric"] = "depth";
    put_figures(mean.mean(), report["mean_of_frames"]);
    report["frames"] = std::move(rows);
    fmt::print("{}\n", json_text(report));
    return {};
}

} // namespace

void add_eval_depth(CLI::App& eval, const Globals& globals, Run& run)
{
    auto o = std::make_shared<EvalDepthArguments>();
    CLI::App* c = eval.add_subcommand("depth", "error of depth pictures against true ones of the same names");
    c->add_option("FRAMES", o->frames, "a folder of depth pictures (PNG, .npy), or what `render` or `streets` wrote")
        ->required();
    c->add_option("TRUTH", o->truth, "likewise: true depth of the same names and sizes")->required();
    add_depth_options(*c, o->of_frames);
    add_depth_options(*c, o->of_truth, "truth");
    add_number(*c, "--fov-x", o->fov_x, "degrees: the pinhole camera, where one is along rays and the other is not",
               1.0, 179.0);
    add_number(*c, "--max-depth", o->most,
               "metres: true depths beyond do not count, those of FRAMES are cut to it (KITTI: 80); none", 0.001, 1e6);
    c->callback([o, &globals, &run] { run = [o, &globals] { return eval_depth(*o, globals); }; });
}

} // namespace semrover
