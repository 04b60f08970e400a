// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover eval kid A B --features inception.safetensors: kernel Inception distance of two sets of images
#include "tools/cli/progress.h"
#include "tools/cli/value_options.h"
#include "tools/eval/kernel_distance.h"
#include "tools/measure/eval.h"
#include "tools/measure/eval_sets.h"

#include <CLI/CLI.hpp>

namespace semrover {

namespace {

constexpr uint32_t kSubsetSize = 1000;

struct EvalKidArguments {
    EvalOptions sets;
    uint32_t subsets = 100, size = 0; // 0: kSubsetSize, or fewer where a set has fewer
    bool full = false;
};

Status eval_kid(const EvalKidArguments& o, const Globals& globals)
{
    SR_TRY(EvalSets sets, load_eval_sets(o.sets, EvalNetwork::images, globals));
    SR_CHECK(require_features(sets, "kid"));
    const Features &a = *sets.set[0].features, &b = *sets.set[1].features;
    SubsetOptions subsets;
    subsets.subsets = o.subsets;
    subsets.size = o.size ? o.size : std::min({kSubsetSize, a.rows, b.rows});
    subsets.seed = o.sets.seed;
    Progress progress(progress_to_stderr(globals), "distances", "subsets", o.subsets);
    subsets.moved = [&](uint32_t done) -> Status {
        progress.update(done);
        if (interrupt_requested() && done < o.subsets)
            return fail(ErrorCode::interrupted, "interrupted after {} subsets", done);
        return {};
    };
    SR_TRY(const SubsetDistance d, subset_distance(a, b, subsets));
    progress.finish();
    Json& report = sets.report;
    report["metric"] = "kid";
    report["value"] = d.mean;
    report["deviation"] = d.deviation;
    report["subsets"] = o.subsets;
    report["subset_size"] = subsets.size;
    report["seed"] = o.sets.seed;
    std::string all;
    if (o.full) {
        SR_TRY(const Discrepancy whole, discrepancy(a, b, subsets.kernel));
        report["full"] = whole.unbiased;
        all = fmt::format(", all samples {:.6g}", whole.unbiased);
    }
    if (globals.json)
        fmt::print("{}\n", json_text(report));
    else
        fmt::print("kid {:.6g} +- {:.6g}  ({} subsets of {}{}; {})\n", d.mean, d.deviation, o.subsets, subsets.size,
                   all, sets_text(sets));
    return {};
}

} // namespace

void add_eval_kid(CLI::App& eval, const Globals& globals, Run& run)
{
    auto o = std::make_shared<EvalKidArguments>();
    CLI::App* c = eval.add_subcommand("kid", "kernel Inception distance of two sets of images");
    add_eval_options(*c, o->sets);
    add_number(*c, "--subsets", o->subsets, "random subsets to average over", 1u, 100000u)
        ->default_str(std::to_string(o->subsets));
    add_number(*c, "--subset-size", o->size, "samples of a subset (default: 1000, or the smaller set)", 2u, 1000000u);
    c->add_flag("--full", o->full, "the distance of all samples too");
    c->callback([o, &globals, &run] { run = [o, &globals] { return eval_kid(*o, globals); }; });
}

} // namespace semrover
