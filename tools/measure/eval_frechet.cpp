// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover eval fid A B --features inception.safetensors: Frechet Inception distance of two sets of images
// semrover eval f3d A B --features pointnet2.safetensors: Frechet distance of two sets of grids
#include "tools/cli/print_stderr.h"
#include "tools/eval/frechet.h"
#include "tools/measure/eval.h"
#include "tools/measure/eval_sets.h"

#include <CLI/CLI.hpp>

namespace semrover {

namespace {

void warn_of_small_sets(const EvalSets& sets)
{
    uint32_t fewest = UINT32_MAX, features = 0;
    for (const EvalSet& set : sets.set)
        if (set.features) {
            fewest = std::min(fewest, set.features->rows);
            features = set.features->cols;
        }
    if (fewest <= features)
        print_stderr(
            "semrover: warning: {} samples of {} features: the covariance is singular and the distance too large; "
            "compare only with as many samples\n",
            fewest, features);
}

// the distance of two sets, printed under the metric's name
Status eval_frechet(const EvalOptions& o, std::string_view metric, EvalNetwork network, const Globals& globals)
{
    SR_TRY(EvalSets sets, load_eval_sets(o, network, globals));
    if (!globals.quiet)
        warn_of_small_sets(sets);
    std::array<Gaussian, 2> moments;
    for (size_t side = 0; side < 2; ++side) {
        EvalSet& set = sets.set[side];
        if (set.moments) {
            moments[side] = std::move(*set.moments);
            continue;
        }
        SR_TRY(moments[side], gaussian_of(*set.features));
    }
    SR_TRY(const FrechetDistance d, frechet_distance(moments[0], moments[1]));
    if (globals.json) {
        sets.report["metric"] = metric;
        sets.report["value"] = d.distance;
        sets.report["mean_part"] = d.mean_part;
        sets.report["covariance_part"] = d.covariance_part;
        fmt::print("{}\n", json_text(sets.report));
        return {};
    }
    fmt::print("{} {:.6g}  (means {:.6g}, covariances {:.6g}; {})\n", metric, d.distance, d.mean_part,
               d.covariance_part, sets_text(sets));
    return {};
}

} // namespace

void add_eval_fid(CLI::App& eval, const Globals& globals, Run& run)
{
    auto o = std::make_shared<EvalOptions>();
    CLI::App* c = eval.add_subcommand("fid", "Frechet Inception distance of two sets of images");
    add_eval_options(*c, *o);
    c->callback(
        [o, &globals, &run] { run = [o, &globals] { return eval_frechet(*o, "fid", EvalNetwork::images, globals); }; });
}

void add_eval_f3d(CLI::App& eval, const Globals& globals, Run& run)
{
    auto o = std::make_shared<EvalOptions>();
    CLI::App* c = eval.add_subcommand("f3d", "Frechet distance of PointNet++ features of two sets of grids");
    add_eval_options(*c, *o);
    c->callback(
        [o, &globals, &run] { run = [o, &globals] { return eval_frechet(*o, "f3d", EvalNetwork::points, globals); }; });
}

} // namespace semrover
