// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover eval edges FRAMES LABELS: how far borders of labels lie from edges of pictures
#include "runtime/base/json.h"
#include "runtime/base/quote.h"
#include "tools/cli/progress.h"
#include "tools/eval/edge_agreement.h"
#include "tools/eval/sample_files.h"
#include "tools/measure/eval.h"

#include <CLI/CLI.hpp>

namespace semrover {

namespace {

struct EvalEdgesArguments {
    std::string frames, labels, map;
};

double share(uint64_t some, uint64_t all)
{
    return all ? double(some) / double(all) : 0;
}

Json edges_json(const EdgeDistances& d)
{
    Json within = Json::array();
    for (const uint64_t borders : d.at_most)
        within.push_back(share(borders, d.borders));
    return {{"borders", d.borders},
            {"within", within},
            {"step", d.borders ? Json(d.step / double(d.borders)) : Json()},
            {"step_beside", d.borders ? Json(d.step_beside / double(d.borders)) : Json()}};
}

void print_edges(std::string_view name, const EdgeDistances& d)
{
    const double n = double(std::max<uint64_t>(d.borders, 1));
    fmt::print("{:13} {:>9}", name, d.borders);
    for (const int pixels : {0, 1, 2, 4, kEdgeReach})
        fmt::print(" {:>7.1f} %", 100 * share(d.at_most[size_t(pixels)], d.borders));
    fmt::print(" {:>7.1f} {:>7.1f}\n", d.step / n, d.step_beside / n);
}

Status eval_edges(const EvalEdgesArguments& o, const Globals& globals)
{
    SR_TRY(const FrameFiles frames, list_frames(o.frames, "color"));
    SR_TRY(const FrameFiles labels, list_frames(o.labels, "label"));
    SR_CHECK(check_names(frames, o.frames, labels, o.labels, false));
    SR_TRY(PictureClasses classes, PictureClasses::create(o.map));
    EdgeAgreement total;
    uint64_t done = 0;
    Progress progress(progress_to_stderr(globals), "frames", "frames", frames.size());
    for (const auto& [name, path] : frames) {
        SR_TRY(const ImageRgb8 frame, read_color_frame(path, {}));
        SR_TRY(const std::vector<uint8_t> seen,
               read_label_frame(labels.at(name), {frame.width, frame.height}, classes));
        total += edge_agreement(frame, seen);
        progress.update(++done);
        if (interrupt_requested() && done < frames.size())
            return fail(ErrorCode::interrupted, "interrupted after {} of {} frames", done, frames.size());
    }
    progress.finish();
    SR_CHECK(classes.check(quote_path(o.labels)));
    if (globals.json) {
        Json report = edges_json(total.all);
        report["metric"] = "edges";
        report["frames"] = frames.size();
        report["labels"] = Json::object();
        for (size_t i = 0; i < total.labels.size(); ++i)
            if (total.labels[i].borders)
                report["labels"][label_name(i)] = edges_json(total.labels[i]);
        fmt::print("{}\n", json_text(report));
        return {};
    }
    fmt::print("{} frames, borders of labels with an edge within so many pixels, and steps of luma\n", frames.size());
    fmt::print("{:13} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9} {:>7} {:>7}\n", "", "borders", 0, 1, 2, 4, kEdgeReach,
               "there", "around");
    print_edges("all", total.all);
    for (size_t i = 0; i < total.labels.size(); ++i)
        if (total.labels[i].borders)
            print_edges(label_name(i), total.labels[i]);
    return {};
}

} // namespace

void add_eval_edges(CLI::App& eval, const Globals& globals, Run& run)
{
    auto o = std::make_shared<EvalEdgesArguments>();
    CLI::App* c = eval.add_subcommand("edges", "how far borders of labels lie from edges of pictures");
    c->add_option("FRAMES", o->frames, "a folder of pictures, or what `refine`, `render` or `streets` wrote")
        ->required();
    c->add_option("LABELS", o->labels, "likewise: class numbers of these names and sizes, PNG or .npy")->required();
    c->add_option("--map", o->map, "JSON: label number or name to class, or null for none");
    c->callback([o, &globals, &run] { run = [o, &globals] { return eval_edges(*o, globals); }; });
}

} // namespace semrover
