// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover eval points GENERATED TRUTH: label-conditioned points against true ones, by class: colour, distance,
// sharpness
#include "runtime/base/json.h"
#include "runtime/base/quote.h"
#include "tools/cli/open_device.h"
#include "tools/cli/progress.h"
#include "tools/cli/value_options.h"
#include "tools/eval/point_scores.h"
#include "tools/eval/sample_files.h"
#include "tools/measure/eval.h"

#include <CLI/CLI.hpp>

namespace semrover {

namespace {

struct EvalPointsArguments {
    std::string generated, truth;
    ContrastOptions contrast;
};

struct Pair {
    Path generated, truth;
};

bool is_list(const Path& path)
{
    return path.extension() == ".txt";
}

std::string kind_of(const Path& path)
{
    return is_folder(path) ? "a folder" : is_list(path) ? "a list" : "a file";
}

// of two folders: the grids of equal names in them
Result<std::vector<Pair>> pairs_of_folders(const Path& generated, const Path& truth, const std::vector<Path>& a,
                                           const std::vector<Path>& b)
{
    std::vector<Pair> pairs;
    for (const auto& [from, to, files] : {std::tuple{&generated, &truth, &a}, {&truth, &generated, &b}})
        for (const Path& file : *files) {
            const Path other = *to / file.lexically_relative(*from);
            if (!is_file(other))
                return fail(ErrorCode::bad_input, "{} is missing: expected grids of the same names as in {}",
                            quote_path(other), quote_path(*from));
            if (from == &generated)
                pairs.push_back({file, other});
        }
    return pairs;
}

Result<std::vector<Pair>> pairs_of(const EvalPointsArguments& o)
{
    for (const std::string& path : {o.generated, o.truth})
        if (!is_there(path))
            return fail(ErrorCode::bad_input, "{}: no such file or folder", quote_path(path));
    if (kind_of(o.generated) != kind_of(o.truth))
        return fail(ErrorCode::bad_input,
                    "expected two .sgrid files, two folders or two lists, found {} and {}: {}, {}",
                    kind_of(o.generated), kind_of(o.truth), quote_path(o.generated), quote_path(o.truth));
    SR_TRY(const std::vector<Path> a, list_grids(o.generated));
    SR_TRY(const std::vector<Path> b, list_grids(o.truth));
    if (is_folder(o.generated))
        return pairs_of_folders(o.generated, o.truth, a, b);
    if (a.size() != b.size())
        return fail(ErrorCode::bad_input, "expected lists of equal length, found {} grids in {} and {} in {}", a.size(),
                    quote_path(o.generated), b.size(), quote_path(o.truth));
    std::vector<Pair> pairs;
    for (size_t i = 0; i < a.size(); ++i)
        pairs.push_back({a[i], b[i]});
    return pairs;
}

Result<PointScores> score_pair(Device& device, const Pair& pair, const ContrastOptions& options)
{
    SR_TRY(const VoxelGrid generated, read_grid(pair.generated));
    SR_TRY(const VoxelGrid truth, read_grid(pair.truth));
    auto scores = score_points(device, generated, truth, options);
    if (!scores && scores.error().code == ErrorCode::bad_input)
        return fail(ErrorCode::bad_input, "{} against {}: {}", quote_path(pair.generated), quote_path(pair.truth),
                    scores.error().message);
    return scores;
}

Json both_sides(double generated, double truth)
{
    Json j = {{"generated", generated}, {"truth", truth}, {"ratio", nullptr}};
    if (truth > 0)
        j["ratio"] = generated / truth;
    return j;
}

Json class_json(const ClassScores& s)
{
    const ContrastSums &a = s.generated_contrast, &b = s.truth_contrast;
    return {{"cells", s.cells},
            {"points", s.points},
            {"color_error", s.color_error()},
            {"cell_color_error", s.cell_color_error()},
            {"chamfer", s.chamfer()},
            {"to_truth", s.to_truth / double(s.points)},
            {"to_generated", s.to_generated / double(s.points)},
            {"sharpness", both_sides(a.sharpness(), b.sharpness())},
            {"contrast", both_sides(a.contrast(), b.contrast())},
            {"edges", both_sides(a.edges(), b.edges())},
            {"detail", both_sides(s.generated_variety.detail(), s.truth_variety.detail())},
            {"spread", both_sides(s.generated_variety.spread(), s.truth_variety.spread())}};
}

Json scores_json(const PointScores& s)
{
    Json classes = Json::object();
    for (size_t i = 0; i < kClassCount; ++i)
        if (s.classes[i].cells)
            classes[std::string(kPalette[i].name)] = class_json(s.classes[i]);
    return {{"left_out", s.left_out}, {"all", class_json(s.all)}, {"classes", classes}};
}

void print_row(std::string_view name, const ClassScores& s)
{
    const ContrastSums &a = s.generated_contrast, &b = s.truth_contrast;
    const std::string ratio =
        b.sharpness() > 0 ? fmt::format("{:.3f}", a.sharpness() / b.sharpness()) : std::string("-");
    fmt::print("{:13} {:>8} {:>7.4f} {:>7.4f} {:>9.4f} {:>9.4f} {:>7.4f} {:>6} {:>9.4f} {:>7.4f} {:>9.4f} {:>7.4f}\n",
               name, s.cells, s.color_error(), s.cell_color_error(), s.chamfer(), a.sharpness(), b.sharpness(), ratio,
               a.contrast(), b.contrast(), a.edges(), b.edges());
}

void print(const PointScores& s, size_t pairs)
{
    fmt::print("{} pair{}, {} voxels, {} left out\n", pairs, pairs == 1 ? "" : "s", s.all.cells, s.left_out);
    fmt::print("{:>22} {:>15} {:>9} {:>24} {:>17} {:>17}\n", "", "colour error", "Chamfer", "sharpness", "contrast",
               "edges");
    fmt::print("{:13} {:>8} {:>7} {:>7} {:>9} {:>9} {:>7} {:>6} {:>9} {:>7} {:>9} {:>7}\n", "class", "cells", "mean",
               "cell", "m", "generated", "truth", "ratio", "generated", "truth", "generated", "truth");
    for (size_t i = 0; i < kClassCount; ++i)
        if (s.classes[i].cells)
            print_row(kPalette[i].name, s.classes[i]);
    print_row("all", s.all);
}

Status eval_points(const EvalPointsArguments& o, const Globals& globals)
{
    SR_TRY(const std::vector<Pair> pairs, pairs_of(o));
    SR_TRY(const auto device, open_device(globals));
    PointScores total;
    Json rows = Json::array();
    Progress progress(progress_to_stderr(globals), "points", "grids", pairs.size());
    for (size_t i = 0; i < pairs.size(); ++i) {
        SR_TRY(const PointScores scores, score_pair(*device, pairs[i], o.contrast));
        total += scores;
        Json& row = rows.emplace_back(scores_json(scores));
        row["generated"] = printable(pairs[i].generated.string());
        row["truth"] = printable(pairs[i].truth.string());
        progress.update(i + 1, device->allocated_bytes());
        if (interrupt_requested() && i + 1 < pairs.size())
            return fail(ErrorCode::interrupted, "interrupted after {} of {} grids", i + 1, pairs.size());
    }
    progress.finish();
    if (!globals.json) {
        print(total, pairs.size());
        return {};
    }
    Json report = scores_json(total);
    report["metric"] = "points";
    report["radius"] = o.contrast.radius;
    report["strong_step"] = o.contrast.strong_step;
    report["pairs"] = std::move(rows);
    fmt::print("{}\n", json_text(report));
    return {};
}

} // namespace

void add_eval_points(CLI::App& eval, const Globals& globals, Run& run)
{
    auto o = std::make_shared<EvalPointsArguments>();
    CLI::App* c =
        eval.add_subcommand("points", "generated points against true ones, by class: colour, distance, sharpness");
    c->add_option("GENERATED", o->generated, ".sgrid, a folder of them, or a .txt that names one a line")->required();
    c->add_option("TRUTH", o->truth, "likewise: a file, a folder with the same names, a list in the same order")
        ->required();
    add_number(*c, "--radius", o->contrast.radius, "metres, of the neighbourhoods of sharpness (0.3)", 0.001, 100.0);
    add_number(*c, "--strong-step", o->contrast.strong_step, "of brightness, for edges (0.25)", 0.0, 1.0);
    c->callback([o, &globals, &run] { run = [o, &globals] { return eval_points(*o, globals); }; });
}

} // namespace semrover
