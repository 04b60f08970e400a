// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover eval frames FRAMES TRUTH: how alike pictures of equal names are: PSNR and SSIM, also by visibility and class
#include "runtime/base/json.h"
#include "runtime/base/quote.h"
#include "tools/cli/progress.h"
#include "tools/eval/frame_similarity.h"
#include "tools/eval/sample_files.h"
#include "tools/measure/eval.h"

#include <CLI/CLI.hpp>
#include <cmath>

namespace semrover {

namespace {

struct EvalFramesArguments {
    std::string frames, truth, visible, labels, map;
};

struct FrameInputs {
    FrameFiles frames, truth, visible, labels; // the last two may be empty
};

Result<FrameInputs> list_inputs(const EvalFramesArguments& o)
{
    FrameInputs in;
    SR_TRY(in.frames, list_frames(o.frames, "color"));
    SR_TRY(in.truth, list_frames(o.truth, "color"));
    SR_CHECK(check_names(in.frames, o.frames, in.truth, o.truth, true));
    for (const auto& [folder, kind, files] :
         {std::tuple{&o.visible, "visible", &in.visible}, {&o.labels, "label", &in.labels}}) {
        if (folder->empty())
            continue;
        SR_TRY(*files, list_frames(*folder, kind));
        SR_CHECK(check_names(in.frames, o.frames, *files, *folder, false));
    }
    return in;
}

Result<FrameSimilarity> measure_frame(const FrameInputs& in, const std::string& name, PictureClasses& classes)
{
    SR_TRY(const ImageRgb8 frame, read_color_frame(in.frames.at(name), {}));
    const ImageSize size{frame.width, frame.height};
    SR_TRY(const ImageRgb8 truth, read_color_frame(in.truth.at(name), size));
    std::vector<uint8_t> visible, labels;
    if (!in.visible.empty()) {
        SR_TRY(visible, read_gray_frame(in.visible.at(name), size));
    }
    if (!in.labels.empty()) {
        SR_TRY(labels, read_label_frame(in.labels.at(name), size, classes));
    }
    if (frame.width < kSsimWindow || frame.height < kSsimWindow)
        return fail(ErrorCode::bad_input, "{} is {} x {} pixels, expected {} x {} or more, the window of SSIM",
                    quote_path(in.frames.at(name)), size.width, size.height, kSsimWindow, kSsimWindow);
    return frame_similarity(frame, truth, visible, labels);
}

// equal pictures have no finite PSNR: null
Json number_or_null(double value)
{
    return std::isfinite(value) ? Json(value) : Json();
}

Json sums_json(const SimilaritySums& s)
{
    return {{"pixels", s.pixels},
            {"psnr", s.pixels ? number_or_null(s.psnr()) : Json()},
            {"ssim", s.windows ? Json(s.ssim()) : Json()}};
}

void add_parts(const FrameInputs& in, const FrameSimilarity& s, Json& report)
{
    if (!in.visible.empty()) {
        report["visible"] = sums_json(s.visible);
        report["hidden"] = sums_json(s.hidden);
    }
    if (in.labels.empty())
        return;
    report["labels"] = Json::object();
    for (size_t i = 0; i < s.labels.size(); ++i)
        if (s.labels[i].pixels)
            report["labels"][label_name(i)] = sums_json(s.labels[i]);
}

void print_row(std::string_view name, const SimilaritySums& s)
{
    const std::string psnr = s.pixels == 0 ? "-" : std::isfinite(s.psnr()) ? fmt::format("{:.3f}", s.psnr()) : "equal";
    fmt::print("{:13} {:>11} {:>9} {:>8}\n", name, s.pixels, psnr,
               s.windows ? fmt::format("{:.4f}", s.ssim()) : std::string("-"));
}

struct FrameMean { // of the frames that are not equal to their truth
    double psnr = 0;
    size_t frames = 0;
};

void print(const FrameInputs& in, const FrameSimilarity& s, const FrameMean& mean)
{
    fmt::print("{} frames, PSNR", in.frames.size());
    if (mean.frames)
        fmt::print(" {:.3f} dB in the mean of {} frames", mean.psnr, mean.frames);
    fmt::print(", {} equal\n{:13} {:>11} {:>9} {:>8}\n", in.frames.size() - mean.frames, "", "pixels", "PSNR, dB",
               "SSIM");
    print_row("all", s.all);
    if (!in.visible.empty()) {
        print_row("visible", s.visible);
        print_row("hidden", s.hidden);
    }
    for (size_t i = 0; i < s.labels.size(); ++i)
        if (s.labels[i].pixels)
            print_row(label_name(i), s.labels[i]);
}

Status eval_frames(const EvalFramesArguments& o, const Globals& globals)
{
    SR_TRY(const FrameInputs in, list_inputs(o));
    SR_TRY(PictureClasses classes, PictureClasses::create(o.map));
    FrameSimilarity total;
    FrameMean mean;
    Json rows = Json::array();
    Progress progress(progress_to_stderr(globals), "frames", "frames", in.frames.size());
    for (const auto& [name, path] : in.frames) {
        SR_TRY(const FrameSimilarity s, measure_frame(in, name, classes));
        total += s;
        if (std::isfinite(s.all.psnr())) {
            mean.psnr += s.all.psnr();
            ++mean.frames;
        }
        Json& row = rows.emplace_back(sums_json(s.all));
        row["name"] = printable(name);
        add_parts(in, s, row);
        progress.update(rows.size());
        if (interrupt_requested() && rows.size() < in.frames.size())
            return fail(ErrorCode::interrupted, "interrupted after {} of {} frames", rows.size(), in.frames.size());
    }
    progress.finish();
    SR_CHECK(classes.check(quote_path(o.labels)));
    mean.psnr /= double(std::max<size_t>(mean.frames, 1));
    if (!globals.json) {
        print(in, total, mean);
        return {};
    }
    Json report = sums_json(total.all);
    report["metric"] = "frames";
    report["mean_psnr"] = mean.frames ? Json(mean.psnr) : Json();
    report["equal_frames"] = in.frames.size() - mean.frames;
    add_parts(in, total, report);
    report["frames"] = std::move(rows);
    fmt::print("{}\n", report.dump());
    return {};
}

} // namespace

void add_eval_frames(CLI::App& eval, const Globals& globals, Run& run)
{
    auto o = std::make_shared<EvalFramesArguments>();
    CLI::App* c = eval.add_subcommand("frames", "PSNR and SSIM of pictures against true ones of the same names");
    c->add_option("FRAMES", o->frames, "a folder of pictures, or what `refine`, `render` or `streets` wrote")
        ->required();
    c->add_option("TRUTH", o->truth, "likewise: pictures of the same names and sizes")->required();
    c->add_option("--visible", o->visible, "masks of these names: also figures of what is at 128 or above, and below");
    c->add_option("--labels", o->labels, "class numbers of these names, PNG or .npy: also figures of each class");
    c->add_option("--map", o->map, "JSON: label number or name to class, or null for none");
    c->callback([o, &globals, &run] { run = [o, &globals] { return eval_frames(*o, globals); }; });
}

} // namespace semrover
