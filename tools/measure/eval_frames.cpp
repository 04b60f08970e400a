// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover eval frames FRAMES TRUTH: how alike pictures of equal names are: PSNR, SSIM and sharpness, also by
// visibility, class and distance, and LPIPS
#include "runtime/base/hash.h"
#include "runtime/base/json.h"
#include "runtime/base/quote.h"
#include "tools/cli/open_device.h"
#include "tools/cli/progress.h"
#include "tools/eval/frame_similarity.h"
#include "tools/eval/lpips.h"
#include "tools/eval/sample_files.h"
#include "tools/measure/eval.h"

#include <CLI/CLI.hpp>
#include <cmath>

namespace semrover {

namespace {

struct EvalFramesArguments {
    std::string frames, truth, visible, labels, depth, map, lpips;
};

struct FrameInputs {
    FrameFiles frames, truth, visible, labels, depth; // the last three may be empty
    double depth_unit = kMillimetre;
};

Result<FrameInputs> list_inputs(const EvalFramesArguments& o)
{
    FrameInputs in;
    SR_TRY(in.frames, list_frames(o.frames, "color"));
    SR_TRY(in.truth, list_frames(o.truth, "color"));
    SR_CHECK(check_names(in.frames, o.frames, in.truth, o.truth, true));
    for (const auto& [folder, kind, files] : {std::tuple{&o.visible, "visible", &in.visible},
                                              {&o.labels, "label", &in.labels},
                                              {&o.depth, "depth", &in.depth}}) {
        if (folder->empty())
            continue;
        SR_TRY(*files, list_frames(*folder, kind));
        SR_CHECK(check_names(in.frames, o.frames, *files, *folder, false));
    }
    if (!o.depth.empty()) {
        SR_TRY(in.depth_unit, depth_unit_of(o.depth));
    }
    return in;
}

// the network of LPIPS, where it is asked for
struct PerceptualNetwork {
    std::shared_ptr<Device> device;
    std::unique_ptr<Lpips> lpips;
    Json description; // path, kind, hash
};

Result<PerceptualNetwork> load_network(const std::string& path, const Globals& globals)
{
    PerceptualNetwork y;
    if (path.empty())
        return y;
    SR_TRY(const uint64_t hash, hash_file(path));
    SR_TRY(y.device, open_device(globals));
    SR_TRY(y.lpips, Lpips::load(*y.device, path));
    y.description = {{"path", path}, {"kind", y.lpips->backbone()}, {"hash", hash_text(hash)}};
    return y;
}

struct FrameFigures {
    FrameSimilarity similarity;
    double lpips = 0;
};

Status check_side(const Path& path, const ImageRgb8& frame, uint32_t least, std::string_view what)
{
    if (frame.width < least || frame.height < least)
        return fail(ErrorCode::bad_input, "{} is {} x {} pixels, expected {} x {} or more, {}", quote_path(path),
                    frame.width, frame.height, least, least, what);
    return {};
}

Result<KnownPixels> read_known(const FrameInputs& in, const std::string& name, ImageSize size, PictureClasses& classes)
{
    KnownPixels y;
    if (!in.visible.empty()) {
        SR_TRY(y.visible, read_gray_frame(in.visible.at(name), size));
    }
    if (!in.labels.empty()) {
        SR_TRY(y.labels, read_label_frame(in.labels.at(name), size, classes));
    }
    if (!in.depth.empty()) {
        SR_TRY(const DepthPicture depth, read_depth_frame(in.depth.at(name), size, in.depth_unit));
        for (const uint32_t value : depth.pixels)
            y.depth.push_back(float(value * depth.unit));
    }
    return y;
}

Result<FrameFigures> measure_frame(const FrameInputs& in, const std::string& name, PictureClasses& classes,
                                   Lpips* lpips)
{
    SR_TRY(const ImageRgb8 frame, read_color_frame(in.frames.at(name), {}));
    const ImageSize size{frame.width, frame.height};
    SR_TRY(const ImageRgb8 truth, read_color_frame(in.truth.at(name), size));
    SR_TRY(const KnownPixels known, read_known(in, name, size, classes));
    SR_CHECK(check_side(in.frames.at(name), frame, kSsimWindow, "the window of SSIM"));
    FrameFigures y{frame_similarity(frame, truth, known)};
    if (lpips) {
        SR_CHECK(check_side(in.frames.at(name), frame, lpips->least_side(), "what the network of LPIPS can see"));
        SR_TRY(y.lpips, lpips->distance(frame, truth));
    }
    return y;
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
            {"ssim", s.windows ? Json(s.ssim()) : Json()},
            {"sharpness", number_or_null(s.sharpness())}};
}

Json labels_json(const FrameSimilarity::Classes& classes)
{
    Json y = Json::object();
    for (size_t i = 0; i < classes.size(); ++i)
        if (classes[i].pixels)
            y[label_name(i)] = sums_json(classes[i]);
    return y;
}

SimilaritySums sum_of(const FrameSimilarity::Classes& classes)
{
    SimilaritySums y;
    for (const SimilaritySums& of_class : classes)
        y += of_class;
    return y;
}

// "6 to 12 m"
std::string range_name(size_t range)
{
    const std::string from = range ? fmt::format("{} ", kDistances[range - 1]) : "0 ";
    return range < kDistances.size() ? fmt::format("{}to {} m", from, kDistances[range]) : from + "m and more";
}

void add_parts(const FrameInputs& in, const FrameSimilarity& s, Json& report)
{
    if (!in.visible.empty()) {
        report["visible"] = sums_json(s.visible);
        report["hidden"] = sums_json(s.hidden);
    }
    if (!in.labels.empty())
        report["labels"] = labels_json(s.labels);
    for (size_t range = 0; !in.depth.empty() && range < s.distances.size(); ++range) {
        Json& row = report["distances"].emplace_back(sums_json(sum_of(s.distances[range])));
        row["from"] = range ? kDistances[range - 1] : 0.0;
        row["to"] = range < kDistances.size() ? Json(kDistances[range]) : Json();
        if (!in.labels.empty())
            row["labels"] = labels_json(s.distances[range]);
    }
}

void print_row(std::string_view name, const SimilaritySums& s)
{
    const std::string psnr = s.pixels == 0 ? "-" : std::isfinite(s.psnr()) ? fmt::format("{:.3f}", s.psnr()) : "equal";
    fmt::print("{:13} {:>11} {:>9} {:>8} {:>9}\n", name, s.pixels, psnr,
               s.windows ? fmt::format("{:.4f}", s.ssim()) : "-",
               std::isfinite(s.sharpness()) ? fmt::format("{:.3f}", s.sharpness()) : "-");
}

struct FrameMean {
    double psnr = 0; // of the frames that are not equal to their truth
    size_t frames = 0;
    double lpips = 0; // of all
};

void print(const FrameInputs& in, const FrameSimilarity& s, const FrameMean& mean, const Lpips* lpips)
{
    fmt::print("{} frames, PSNR", in.frames.size());
    if (mean.frames)
        fmt::print(" {:.3f} dB in the mean of {} frames", mean.psnr, mean.frames);
    fmt::print(", {} equal\n", in.frames.size() - mean.frames);
    if (lpips)
        fmt::print("LPIPS {:.4f} in the mean ({})\n", mean.lpips, lpips->backbone());
    fmt::print("{:13} {:>11} {:>9} {:>8} {:>9}\n", "", "pixels", "PSNR, dB", "SSIM", "sharpness");
    print_row("all", s.all);
    if (!in.visible.empty()) {
        print_row("visible", s.visible);
        print_row("hidden", s.hidden);
    }
    for (size_t i = 0; i < s.labels.size(); ++i)
        if (s.labels[i].pixels)
            print_row(label_name(i), s.labels[i]);
    for (size_t range = 0; !in.depth.empty() && range < s.distances.size(); ++range)
        print_row(range_name(range), sum_of(s.distances[range]));
}

void print_report(const FrameInputs& in, const FrameSimilarity& total, const FrameMean& mean, Json rows,
                  const PerceptualNetwork& network)
{
    Json report = sums_json(total.all);
    report["metric"] = "frames";
    report["mean_psnr"] = mean.frames ? Json(mean.psnr) : Json();
    report["equal_frames"] = in.frames.size() - mean.frames;
    if (network.lpips) {
        report["lpips"] = mean.lpips;
        report["network"] = network.description;
        report["device"] = network.device->name();
        report["peak_bytes"] = network.device->peak_bytes();
    }
    add_parts(in, total, report);
    report["frames"] = std::move(rows);
    fmt::print("{}\n", json_text(report));
}

Status eval_frames(const EvalFramesArguments& o, const Globals& globals)
{
    SR_TRY(const FrameInputs in, list_inputs(o));
    SR_TRY(PictureClasses classes, PictureClasses::create(o.map));
    SR_TRY(const PerceptualNetwork network, load_network(o.lpips, globals));
    FrameSimilarity total;
    FrameMean mean;
    Json rows = Json::array();
    Progress progress(progress_to_stderr(globals), "frames", "frames", in.frames.size());
    for (const auto& [name, path] : in.frames) {
        SR_TRY(const FrameFigures f, measure_frame(in, name, classes, network.lpips.get()));
        total += f.similarity;
        if (std::isfinite(f.similarity.all.psnr())) {
            mean.psnr += f.similarity.all.psnr();
            ++mean.frames;
        }
        mean.lpips += f.lpips;
        Json& row = rows.emplace_back(sums_json(f.similarity.all));
        row["name"] = printable(name);
        if (network.lpips)
            row["lpips"] = f.lpips;
        add_parts(in, f.similarity, row);
        progress.update(rows.size());
        if (interrupt_requested() && rows.size() < in.frames.size())
            return fail(ErrorCode::interrupted, "interrupted after {} of {} frames", rows.size(), in.frames.size());
    }
    progress.finish();
    SR_CHECK(classes.check(quote_path(o.labels)));
    mean.psnr /= double(std::max<size_t>(mean.frames, 1));
    mean.lpips /= double(rows.size());
    if (globals.json)
        print_report(in, total, mean, std::move(rows), network);
    else
        print(in, total, mean, network.lpips.get());
    return {};
}

} // namespace

void add_eval_frames(CLI::App& eval, const Globals& globals, Run& run)
{
    auto o = std::make_shared<EvalFramesArguments>();
    CLI::App* c = eval.add_subcommand(
        "frames", "PSNR, SSIM, sharpness and LPIPS of pictures against true ones of the same names");
    c->add_option("FRAMES", o->frames, "a folder of pictures, or what `refine`, `render` or `streets` wrote")
        ->required();
    c->add_option("TRUTH", o->truth, "likewise: pictures of the same names and sizes")->required();
    c->add_option("--visible", o->visible, "masks of these names: also figures of what is at 128 or above, and below");
    c->add_option("--labels", o->labels, "class numbers of these names, PNG or .npy: also figures of each class");
    c->add_option("--depth", o->depth, "depth of these names: also figures by distance");
    c->add_option("--map", o->map, "JSON: label number or name to class, or null for none");
    c->add_option("--lpips", o->lpips,
                  "also LPIPS, by this network: safetensors of AlexNet or VGG16 (docs/eval.md has the layout)");
    c->callback([o, &globals, &run] { run = [o, &globals] { return eval_frames(*o, globals); }; });
}

} // namespace semrover
