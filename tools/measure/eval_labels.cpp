// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover eval labels FRAMES TRUTH: intersection over union of classes of pictures of equal names
#include "runtime/base/json.h"
#include "runtime/base/quote.h"
#include "tools/cli/progress.h"
#include "tools/eval/label_agreement.h"
#include "tools/eval/sample_files.h"
#include "tools/measure/eval.h"

#include <CLI/CLI.hpp>

namespace semrover {

namespace {

struct EvalLabelsArguments {
    std::string frames, truth, map, truth_map;
};

struct LabelInputs {
    FrameFiles frames, truth;
    PictureClasses classes, true_classes;
};

Result<LabelInputs> read_inputs(const EvalLabelsArguments& o)
{
    LabelInputs in;
    SR_TRY(in.frames, list_frames(o.frames, "label"));
    SR_TRY(in.truth, list_frames(o.truth, "label"));
    SR_CHECK(check_names(in.frames, o.frames, in.truth, o.truth, true));
    SR_TRY(in.classes, PictureClasses::create(o.map));
    SR_TRY(in.true_classes, PictureClasses::create(o.truth_map.empty() ? o.map : o.truth_map));
    return in;
}

Result<LabelAgreement> measure_frame(LabelInputs& in, const std::string& name)
{
    const Path& path = in.frames.at(name);
    SR_TRY(const ImageSize size, number_image_size(path));
    SR_TRY(const std::vector<uint8_t> frame, read_label_frame(path, size, in.classes));
    SR_TRY(const std::vector<uint8_t> truth, read_label_frame(in.truth.at(name), size, in.true_classes));
    return label_agreement(frame, truth);
}

Json agreement_json(const LabelAgreement& a)
{
    const uint64_t counted = a.counted();
    return {{"pixels", counted},
            {"unlabelled", a.unlabelled},
            {"mean_iou", counted ? Json(a.mean_iou()) : Json()},
            {"accuracy", counted ? Json(a.accuracy()) : Json()}};
}

Json labels_json(const LabelAgreement& a)
{
    Json j = Json::object();
    for (size_t i = 0; i < kClassCount; ++i)
        if (const auto iou = a.iou(i))
            j[label_name(i)] = {{"iou", *iou}, {"true_pixels", a.of_truth(i)}, {"shown_pixels", a.shown(i)}};
    return j;
}

// true class, then shown class: pixels, where there are any
Json confusion_json(const LabelAgreement& a)
{
    Json j = Json::object();
    for (size_t t = 0; t < kClassCount; ++t)
        for (size_t s = 0; s <= kClassCount; ++s)
            if (a.pixels[t][s])
                j[label_name(t)][label_name(s)] = a.pixels[t][s];
    return j;
}

void print(const LabelAgreement& a, size_t frames)
{
    fmt::print("{} frames, mean IoU {:.4f} of {} classes, {:.2f} % of {} pixels right\n", frames, a.mean_iou(),
               a.classes(), 100 * a.accuracy(), a.counted());
    fmt::print("{:13} {:>11} {:>11} {:>7}\n", "", "true pixels", "shown", "IoU");
    for (size_t i = 0; i < kClassCount; ++i)
        if (const auto iou = a.iou(i))
            fmt::print("{:13} {:>11} {:>11} {:>7.4f}\n", label_name(i), a.of_truth(i), a.shown(i), *iou);
}

Status eval_labels(const EvalLabelsArguments& o, const Globals& globals)
{
    SR_TRY(LabelInputs in, read_inputs(o));
    LabelAgreement total;
    Json rows = Json::array();
    Progress progress(progress_to_stderr(globals), "labels", "frames", in.frames.size());
    for (const auto& [name, path] : in.frames) {
        SR_TRY(const LabelAgreement agreement, measure_frame(in, name));
        total += agreement;
        Json& row = rows.emplace_back(agreement_json(agreement));
        row["name"] = printable(name);
        progress.update(rows.size());
        if (interrupt_requested() && rows.size() < in.frames.size())
            return fail(ErrorCode::interrupted, "interrupted after {} of {} frames", rows.size(), in.frames.size());
    }
    progress.finish();
    SR_CHECK(in.classes.check(quote_path(o.frames)));
    SR_CHECK(in.true_classes.check(quote_path(o.truth)));
    if (total.counted() == 0)
        return fail(ErrorCode::bad_input, "no pixel of {} frames has a class in {}", rows.size(), quote_path(o.truth));
    if (!globals.json) {
        print(total, rows.size());
        return {};
    }
    Json report = agreement_json(total);
    report["metric"] = "labels";
    report["classes"] = total.classes();
    report["labels"] = labels_json(total);
    report["confusion"] = confusion_json(total);
    report["frames"] = std::move(rows);
    fmt::print("{}\n", json_text(report));
    return {};
}

} // namespace

void add_eval_labels(CLI::App& eval, const Globals& globals, Run& run)
{
    auto o = std::make_shared<EvalLabelsArguments>();
    CLI::App* c = eval.add_subcommand("labels", "intersection over union of classes against true ones");
    c->add_option("FRAMES", o->frames, "a folder of class numbers (PNG, .npy), or what `render` or `streets` wrote")
        ->required();
    c->add_option("TRUTH", o->truth, "likewise: true classes of the same names and sizes")->required();
    c->add_option("--map", o->map, "JSON: label number or name to class, or null for none; of both");
    c->add_option("--truth-map", o->truth_map, "likewise, of TRUTH in place of --map");
    c->callback([o, &globals, &run] { run = [o, &globals] { return eval_labels(*o, globals); }; });
}

} // namespace semrover
