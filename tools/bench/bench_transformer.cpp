// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover bench transformer: one denoising step of a batch of regions, both guidance halves, random weights
#include "engine/voxfield/token_sampler.h"
#include "tools/bench/bench.h"
#include "tools/bench/plan_text.h"
#include "tools/cli/open_device.h"
#include "tools/cli/print_stderr.h"
#include "tools/cli/value_options.h"

#include <CLI/CLI.hpp>
#include <cmath>

namespace semrover {

namespace {

struct BenchTransformerArguments {
    std::string config, precision = "fp16", weights, profile;
    bool plan = false;
    uint32_t cells = 128, batch = 1, steps = 2;
    bool unguided = false;
};

// a street-like patch: a square of ground and a wall
std::vector<RegionInput> make_regions(const BenchTransformerArguments& o, uint32_t classes)
{
    RegionInput region;
    const int32_t side = int32_t(std::ceil(std::sqrt(o.cells * 0.6)));
    for (int32_t i = 0; region.cells.size() < o.cells; ++i) {
        if (i < side * side)
            region.cells.push_back({i % side, i / side, 0});
        else
            region.cells.push_back({(i - side * side) % side, side, (i - side * side) / side});
        region.labels.push_back(uint32_t(i) % classes);
    }
    return std::vector<RegionInput>(o.batch, region);
}

Status bench_transformer(const BenchTransformerArguments& o, const Globals& globals)
{
    TransformerConfig config;
    SR_CHECK(read_config(o.config, parse_transformer_config, config));
    config.q8_0 = config.q8_0 || !o.weights.empty();
    SR_TRY(const auto device, open_device(globals, o.profile));
    const DType dtype = o.precision == "fp32" ? DType::f32 : DType::f16;
    SR_TRY(const auto transformer, Transformer::random(*device, config, dtype));
    SchedulerConfig scheduler;
    scheduler.prediction = Prediction::sample;
    SR_TRY(const SamplingPlan plan, plan_sampling(scheduler, int(o.steps)));
    const float guidance = o.unguided ? 1.f : 4.f;
    SR_TRY(const auto sampler, TokenSampler::create(*device, *transformer, plan, {{guidance}, 1}));
    SR_TRY(const uint64_t planned, sampler->planned_bytes(o.batch, o.cells));
    const uint64_t predicted = transformer->device_bytes(device->limits()) + planned;
    const std::vector<RegionInput> regions = make_regions(o, config.num_classes);
    SR_TRY(Timing timing, measure([&] { return sampler->run(regions).map([](const auto&) {}); }));
    if (o.plan)
        print_stderr("{}", plan_text(sampler->step_executable().plan()));
    timing.ms_median /= o.steps;
    timing.ms_min /= o.steps;
    Json report = bench_report("transformer", *device, dtype, timing, predicted);
    report["parameters"] = transformer->weights().parameters();
    report["cells"] = o.cells;
    report["batch"] = o.batch;
    report["guided"] = !o.unguided;
    add_rate(report, flops_of(sampler->step_executable()), timing);
    add_executable(report, sampler->step_executable());
    print_report(report, globals);
    return write_profile(*device, o.profile);
}

} // namespace

void add_bench_transformer(CLI::App& bench, const Globals& globals, Run& run)
{
    auto o = std::make_shared<BenchTransformerArguments>();
    CLI::App* c = bench.add_subcommand("transformer", "one denoising step of the Σ-Voxfield transformer");
    c->add_option("--config", o->config, "config.json; default: the full-size model, 12 layers of 8 heads of 128");
    add_number(*c, "--cells", o->cells, "voxels of a region", 1u, 4096u);
    add_number(*c, "--batch", o->batch, "regions", 1u, 1024u);
    add_choice(*c, "--precision", {"fp16", "fp32"}, "storage", o->precision);
    add_weights(*c, o->weights);
    add_number(*c, "--steps", o->steps, "of a measured run, which sets up and reads back once", 1u, 1000u);
    c->add_flag("--unguided", o->unguided, "without the unconditional half");
    add_profile(*c, o->profile);
    add_plan(*c, o->plan);
    c->callback([o, &globals, &run] { run = [o, &globals] { return bench_transformer(*o, globals); }; });
}

} // namespace semrover
