// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover verify CASE...: runs golden cases, one line a case
#include "runtime/base/json.h"
#include "runtime/base/quote.h"
#include "tools/cli/commands.h"
#include "tools/cli/open_device.h"
#include "tools/cli/value_options.h"
#include "tools/verify/golden_case.h"

#include <algorithm>
#include <array>
#include <CLI/CLI.hpp>
#include <cmath>
#include <optional>

namespace semrover {

namespace {

namespace fs = std::filesystem;

struct VerifyArguments {
    std::vector<std::string> cases;
    std::string precision = "fp32";
    bool allow_skip = false;
};

struct Kind {
    std::string_view name;
    GoldenRunner run;
};

constexpr Kind kKinds[] = {
    {"voxfield_transformer", run_voxfield_transformer},
    {"voxfield_sampling", run_voxfield_sampling},
    {"scheduler", run_scheduler},
    {"repaint_timesteps", run_repaint_timesteps},
    {"region_extraction", run_region_extraction},
    {"splat_render", run_splat_render},
    {"pca_normals", run_pca_normals},
    {"mesh_voxelization", run_mesh_voxelization},
    {"asd_rollout", run_asd_rollout},
    {"vsd_window", run_vsd_window},
    {"unet_2d_condition", run_unet_2d_condition},
    {"autoencoder_kl", run_autoencoder_kl},
    {"unet_spatio_temporal_condition", run_unet_spatio_temporal_condition},
    {"autoencoder_kl_temporal_decoder", run_autoencoder_kl_temporal_decoder},
};

enum class Outcome { pass, fail, skip };
constexpr const char* kOutcomeNames[] = {"PASS", "FAIL", "SKIP"};

struct CaseReport {
    Outcome outcome = Outcome::fail;
    std::string kind = "?", name, reason;
    double max_error = 0, tolerance = 0;
};

// a case's folder, or all cases in a folder, by name
Result<std::vector<Path>> find_cases(const std::vector<std::string>& arguments)
{
    std::vector<Path> cases;
    for (const std::string& text : arguments) {
        const Path given = text, argument = given.has_filename() ? given : given.parent_path(); // "case/" is "case"
        if (is_there(argument / "case.json")) {
            cases.push_back(argument);
            continue;
        }
        SR_TRY(std::vector<Path> inside, list_folders(argument));
        std::erase_if(inside, [](const Path& folder) { return !is_there(folder / "case.json"); });
        if (inside.empty())
            return fail(ErrorCode::bad_input,
                        "{}: expected a golden case (a folder with case.json) or a folder of cases",
                        quote_path(argument));
        cases.insert(cases.end(), inside.begin(), inside.end());
    }
    return cases;
}

// a parameter of the wrong type is the case's fault, not the program's
Result<GoldenOutputs> run_kind(GoldenRunner run, Device& device, const GoldenCase& c, DType precision)
{
    try {
        return run(device, c, precision);
    } catch (const nlohmann::json::exception& e) {
        return fail(ErrorCode::bad_input, "case.json: {}", printable(e.what()));
    }
}

CaseReport run_case(Device& device, const Path& folder, const std::string& precision)
{
    CaseReport r;
    r.name = printable(folder.filename().string());
    const auto c = GoldenCase::open(folder);
    if (!c) {
        r.reason = c.error().message;
        return r;
    }
    r.kind = printable(c->kind());
    r.tolerance = c->tolerance(precision);
    const auto* kind = std::ranges::find(kKinds, c->kind(), &Kind::name);
    if (kind == std::end(kKinds)) {
        r.outcome = Outcome::skip;
        r.reason = "no runner for this kind";
        return r;
    }
    const auto outputs = run_kind(kind->run, device, *c, precision == "fp16" ? DType::f16 : DType::f32);
    if (!outputs) {
        r.reason = outputs.error().message;
        return r;
    }
    const GoldenVerdict verdict = compare(*c, *outputs, precision);
    r.outcome = verdict.passed ? Outcome::pass : Outcome::fail;
    r.max_error = verdict.max_error;
    r.reason = verdict.reason;
    return r;
}

void print_line(const CaseReport& r)
{
    fmt::print("{} {} {}", kOutcomeNames[int(r.outcome)], r.kind, r.name);
    if (r.reason.empty())
        fmt::print(" {:.3g} {:g}", r.max_error, r.tolerance);
    else
        fmt::print(" {}", r.reason);
    fmt::print("\n");
    std::fflush(stdout); // a case may take a while
}

nlohmann::ordered_json to_json(const CaseReport& r)
{
    nlohmann::ordered_json json{{"outcome", kOutcomeNames[int(r.outcome)]}, {"kind", r.kind}, {"name", r.name}};
    if (std::isfinite(r.max_error))
        json["max_error"] = r.max_error;
    json["tolerance"] = r.tolerance;
    if (!r.reason.empty())
        json["reason"] = r.reason;
    return json;
}

Status verify(const VerifyArguments& o, const Globals& globals)
{
    SR_TRY(const std::vector<Path> cases, find_cases(o.cases));
    SR_TRY(const auto device, open_device(globals));
    nlohmann::ordered_json list = nlohmann::ordered_json::array();
    std::array<size_t, 3> counts{};
    for (const Path& folder : cases) {
        const CaseReport r = run_case(*device, folder, o.precision);
        if (interrupt_requested()) // the case may have been cut off
            return fail(ErrorCode::interrupted, "interrupted after {} of {} cases", counts[0] + counts[1] + counts[2],
                        cases.size());
        ++counts[size_t(r.outcome)];
        if (globals.json)
            list.push_back(to_json(r));
        else
            print_line(r);
    }
    if (globals.json)
        fmt::print("{}\n", json_text(nlohmann::ordered_json{{"device", device->name()},
                                                            {"precision", o.precision},
                                                            {"passed", counts[0]},
                                                            {"failed", counts[1]},
                                                            {"skipped", counts[2]},
                                                            {"cases", list}},
                                     -1, true));
    else if (cases.size() > 1)
        fmt::print("{} passed, {} failed, {} skipped\n", counts[0], counts[1], counts[2]);
    if (counts[1])
        return fail(ErrorCode::verify_failed, "{} of {} cases failed", counts[1], cases.size());
    if (counts[2] && !o.allow_skip)
        return fail(ErrorCode::partial,
                    "{} of {} cases were skipped, as nothing runs their kind; --allow-skip accepts that", counts[2],
                    cases.size());
    return {};
}

} // namespace

void add_verify(CLI::App& app, const Globals& globals, Run& run)
{
    auto o = std::make_shared<VerifyArguments>();
    CLI::App* c = app.add_subcommand("verify", "run golden cases: what public reference code gives for known inputs");
    c->add_option("CASE", o->cases, "folder of a case, or of cases (tests/golden)")->required();
    add_choice(*c, "--precision", {"fp32", "fp16"}, "storage of weights and activations", o->precision);
    c->add_flag("--allow-skip", o->allow_skip, "exit 0 although cases of unknown kinds were skipped");
    c->callback([o, &globals, &run] { run = [o, &globals] { return verify(*o, globals); }; });
}

} // namespace semrover
