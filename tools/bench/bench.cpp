// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover bench KIND: one object of figures per kind, measured warm with synthetic data of real shapes
#include "tools/bench/bench.h"

#include "engine/model/unet_config.h"
#include "runtime/device/pipeline.h"
#include "runtime/device/profile.h"
#include "runtime/graph/variant.h"
#include "tools/bench/call_times.h"
#include "tools/cli/print_stderr.h"
#include "tools/cli/value_options.h"

#include <algorithm>
#include <CLI/CLI.hpp>
#include <thread>

namespace semrover {

Result<Timing> measure(const std::function<Status()>& work, double ms)
{
    const CallTimer warm_up;
    for (int run = 0; run < 10 && (run == 0 || warm_up.ms() < ms); ++run) // a GPU's first runs try tiles
        SR_CHECK(work());
    const CallTimer all;
    std::vector<double> times;
    while ((times.size() < 5 || all.ms() < ms) && all.ms() < 30000) {
        const CallTimer one;
        SR_CHECK(work());
        times.push_back(one.ms());
    }
    return timing_of(std::move(times));
}

Timing timing_of(std::vector<double> times)
{
    std::ranges::sort(times);
    return times.empty() ? Timing{} : Timing{times[times.size() / 2], times.front(), times.size()};
}

Json bench_report(const char* kind, const Device& device, DType precision, const Timing& timing,
                  uint64_t predicted_bytes)
{
    return {{"kind", kind},
            {"device", device.name()},
            {"driver", device.driver()},
            {"precision", precision == DType::f16 ? "fp16" : "fp32"},
            {"ms_median", timing.ms_median},
            {"ms_min", timing.ms_min},
            {"runs", timing.runs},
            {"predicted_bytes", predicted_bytes},
            {"peak_bytes", device.peak_bytes()}};
}

void add_executable(Json& report, const Executable& executable)
{
    const Plan& plan = executable.plan();
    report["dispatches"] = plan.dispatches.size();
    report["barriers"] = plan.barriers();
    report["submits"] = plan.submits;
    report["host_us_per_step"] = executable.host_us();
}

void add_rate(Json& report, double flops, const Timing& timing)
{
    report["gflop"] = flops / 1e9;
    report["gflops"] = flops / timing.ms_median / 1e6;
    report["gflops_best"] = flops / timing.ms_min / 1e6;
}

double flops_of(const Executable& executable)
{
    double flops = 0;
    for (const Pass& pass : executable.plan().passes)
        flops += pass.options.flops;
    return flops;
}

void add_network(Json& report, const Executable& executable, const Timing& timing, uint64_t parameters,
                 uint64_t weight_bytes)
{
    report["parameters"] = parameters;
    report["weight_bytes"] = weight_bytes;
    report["arena_bytes"] = executable.plan().arena_bytes();
    add_rate(report, flops_of(executable), timing);
    add_executable(report, executable);
}

Status add_code(Json& report, Device& device, const Executable& executable)
{
    const Pass& pass = executable.plan().passes.front();
    std::vector<ConstantValue> constants;
    for (const ConstantInfo& c : pass.variant->constants)
        if (const auto given = pass.constants.find(c.id); given != pass.constants.end())
            constants.push_back({c.name, given->second});
    report["shared_bytes"] = shared_bytes(*pass.variant, constants);
    SR_TRY(const auto pipelines, device.pipelines().get({&pass, 1}));
    if (const auto& statistics = pipelines.front()->statistics)
        for (const Statistic& s : *statistics)
            report["statistics"][s.name] = s.value;
    return {};
}

Status compile_pipelines(Device& device, const Graph& graph)
{
    SR_TRY(const Plan plan, make_plan(graph, device.costs()));
    SR_CHECK(device.pipelines().get(plan.passes));
    return {};
}

size_t compiled_at_once()
{
    return std::max(std::thread::hardware_concurrency(), 1u);
}

void add_profile(CLI::App& command, std::string& path)
{
    command.add_option(
        "--profile", path,
        "write device times as a Chrome trace; their sums, and what the driver says of each kernel's code, "
        "to stderr");
}

void add_weights(CLI::App& command, std::string& weights)
{
    add_choice(command, "--weights", {"q8_0"}, "of 8 bits; default: as the activations, or as the config says",
               weights);
}

Status store_as(const std::string& weights, UnetConfig& config)
{
    if (weights.empty())
        return {};
    Json json = unet_config_json(config);
    json["weights"] = weights;
    SR_TRY(config, parse_any_unet_config(json));
    return {};
}

void add_plan(CLI::App& command, bool& plan)
{
    command.add_flag("--plan", plan, "write to stderr what a run does, in which order: passes, barriers, submits");
}

void restart_profile(Device& device, const std::string& path)
{
    if (!path.empty())
        device.set_profile(std::make_shared<Profile>());
}

Status write_profile(Device& device, const std::string& path)
{
    if (!device.profile())
        return {};
    print_stderr("{}{}", device.profile()->summary(), device.profile()->statistics());
    return device.profile()->write(path);
}

void print_report(const Json& report, const Globals& globals)
{
    if (globals.json) {
        fmt::print("{}\n", json_text(report));
        return;
    }
    for (const auto& [name, value] : report.items())
        fmt::print("{:18} {}\n", name, value.is_string() ? value.get<std::string>() : json_text(value));
}

void print_line(const Json& object)
{
    fmt::print("{}\n", json_text(object));
    std::fflush(stdout);
}

DeviceTensor BenchInputs::add(uint32_t rows, uint32_t cols, DType dtype)
{
    return inputs_.emplace_back(pool_.tensor(rows, cols, dtype, "input", dtype == DType::u32 ? cols : 0));
}

Status BenchInputs::allocate()
{
    SR_CHECK(pool_.allocate(device_, "benchmark inputs"));
    uint32_t state = 12345;
    const auto random = [&] { return state = state * 1664525u + 1013904223u; };
    for (const DeviceTensor& input : inputs_) {
        std::vector<uint32_t> words(input.bytes() / 4);
        for (uint32_t& w : words) {
            const float v = float(random() >> 8) / 8388608.f - 1;
            w = random();
            if (input.dtype() == DType::f32)
                __builtin_memcpy(&w, &v, 4);
            else if (input.dtype() == DType::f16)
                w = uint32_t(float_to_half(v)) | uint32_t(float_to_half(v * 0.5f)) << 16;
            else if (input.dtype() == DType::q8_0)
                w &= 0x1f1f1f1f; // small int8, and scales that are numbers
        }
        SR_CHECK(input.write(device_, words));
    }
    return {};
}

void add_bench(CLI::App& app, const Globals& globals, Run& run)
{
    CLI::App* bench = app.add_subcommand("bench", "measure kernels and stages on this device");
    bench->require_subcommand(1);
    bench->fallthrough();
    add_bench_gemm(*bench, globals, run);
    add_bench_conv(*bench, globals, run);
    add_bench_tiles(*bench, globals, run);
    add_bench_transformer(*bench, globals, run);
    add_bench_unet(*bench, globals, run);
    add_bench_vae(*bench, globals, run);
    add_bench_asd(*bench, globals, run);
    add_bench_vsd(*bench, globals, run);
    add_bench_regions(*bench, globals, run);
    add_bench_sort(*bench, globals, run);
    add_bench_world(*bench, globals, run);
    add_bench_splat(*bench, globals, run);
    add_bench_pictures(*bench, globals, run);
}

} // namespace semrover
