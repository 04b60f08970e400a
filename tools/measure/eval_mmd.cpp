// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover eval mmd A B --features NETWORK.safetensors: maximum mean discrepancy of two sets of grids or images
#include "tools/cli/value_options.h"
#include "tools/eval/kernel_distance.h"
#include "tools/measure/eval.h"
#include "tools/measure/eval_sets.h"

#include <CLI/CLI.hpp>
#include <cmath>

namespace semrover {

namespace {

struct EvalMmdArguments {
    EvalOptions sets;
    std::string kernel = "rbf";
    double bandwidth = 0; // 0: median distance
    int degree = 3;
    double gamma = 0, coefficient = 1;
};

Status eval_mmd(const EvalMmdArguments& o, const Globals& globals)
{
    SR_TRY(EvalSets sets, load_eval_sets(o.sets, {}, globals));
    SR_CHECK(require_features(sets, "mmd"));
    const Features &a = *sets.set[0].features, &b = *sets.set[1].features;
    SampleKernel k;
    Json& report = sets.report;
    std::string text;
    if (o.kernel == "rbf") {
        k.kind = SampleKernel::Kind::rbf;
        k.bandwidth = o.bandwidth;
        if (k.bandwidth == 0) {
            SR_TRY(k.bandwidth, median_distance(a, b));
        }
        report["kernel"] = {{"kind", "rbf"}, {"bandwidth", k.bandwidth}};
        text = fmt::format("rbf, bandwidth {:.6g}", k.bandwidth);
    } else {
        k.degree = o.degree;
        k.gamma = o.gamma == 0 ? 1.0 / a.cols : o.gamma;
        k.coefficient = o.coefficient;
        report["kernel"] = {
            {"kind", "polynomial"}, {"degree", k.degree}, {"gamma", k.gamma}, {"coefficient", k.coefficient}};
        text = fmt::format("({:.6g} x.y + {:.6g})^{}", k.gamma, k.coefficient, k.degree);
    }
    SR_TRY(const Discrepancy d, discrepancy(a, b, k));
    report["metric"] = "mmd";
    report["value"] = std::sqrt(d.biased);
    report["squared_unbiased"] = d.unbiased;
    report["squared_biased"] = d.biased;
    if (globals.json)
        fmt::print("{}\n", json_text(report));
    else
        fmt::print("mmd {:.6g}  (squared: {:.6g}, unbiased {:.6g}; {}; {})\n", std::sqrt(d.biased), d.biased,
                   d.unbiased, text, sets_text(sets));
    return {};
}

} // namespace

void add_eval_mmd(CLI::App& eval, const Globals& globals, Run& run)
{
    auto o = std::make_shared<EvalMmdArguments>();
    CLI::App* c = eval.add_subcommand("mmd", "maximum mean discrepancy of features of two sets of grids or images");
    add_eval_options(*c, o->sets);
    add_choice(*c, "--kernel", {"rbf", "polynomial"}, "rbf or polynomial", o->kernel)->default_str(o->kernel);
    add_number(*c, "--bandwidth", o->bandwidth, "of rbf: exp(-d^2 / (2 bandwidth^2)) (default: the median distance)",
               1e-12, 1e12);
    add_number(*c, "--degree", o->degree, "of the polynomial", 1, 16)->default_str(std::to_string(o->degree));
    add_number(*c, "--gamma", o->gamma, "of the polynomial (default: 1 / features)", 1e-12, 1e12);
    add_number(*c, "--coefficient", o->coefficient, "of the polynomial", 0., 1e12)
        ->default_str(fmt::format("{}", o->coefficient));
    c->callback([o, &globals, &run] { run = [o, &globals] { return eval_mmd(*o, globals); }; });
}

} // namespace semrover
