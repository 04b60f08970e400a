// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover bench unet: one evaluation of a renderer's UNet, random weights
#include "engine/network/unet.h"
#include "tools/bench/bench.h"
#include "tools/bench/plan_text.h"
#include "tools/cli/open_device.h"
#include "tools/cli/print_stderr.h"
#include "tools/cli/value_options.h"

#include <CLI/CLI.hpp>

namespace semrover {

namespace {

struct BenchUnetArguments {
    std::string config, precision = "fp16", weights, profile;
    bool plan = false;
    uint32_t width = 77, height = 53, batch = 1, tokens = 77;
};

Status bench_unet(const BenchUnetArguments& o, const Globals& globals)
{
    UnetConfig config; // Stable Diffusion 1.5's, with the channels of the deferred renderer
    config.in_channels = 13;
    SR_CHECK(read_config(o.config, parse_unet_config, config));
    SR_CHECK(store_as(o.weights, config));
    SR_TRY(const auto device, open_device(globals, o.profile));
    const DType dtype = o.precision == "fp32" ? DType::f32 : DType::f16;
    SR_TRY(const auto unet, Unet::load(*device, config, Checkpoint::random(1), dtype));
    FeatureMap x{{}, o.batch, o.height, o.width};
    BenchInputs inputs(*device);
    const uint32_t rows = x.image_rows() * o.batch;
    const DeviceTensor sample = inputs.add(rows, config.in_channels, dtype);
    const DeviceTensor table = inputs.add(1, unet->time_width(), DType::f32), row = inputs.add(o.batch, 1, DType::u32);
    const DeviceTensor text = inputs.add(o.tokens, std::max(unet->context_width(), 1u), dtype);
    SR_CHECK(inputs.allocate());
    Graph g(device->limits());
    x.data = sample.in(g);
    const Tensor table_row = row.in(g);
    SR_CHECK(row.clear(*device));
    (void)unet->forward(g, x, table.in(g), table_row, {text.in(g), o.tokens, 0});
    restart_profile(*device, o.profile);
    SR_TRY(const auto executable, Executable::create(*device, g));
    SR_TRY(const Timing timing, measure([&] { return executable->run(); }));
    if (o.plan)
        print_stderr("{}", plan_text(executable->plan()));
    const uint64_t predicted = unet->device_bytes(device->limits()) + inputs.bytes() + executable->plan().arena_bytes();
    Json report = bench_report("unet", *device, dtype, timing, predicted);
    report["width"] = o.width;
    report["height"] = o.height;
    report["batch"] = o.batch;
    add_network(report, *executable, timing, unet->parameters(), unet->device_bytes(device->limits()));
    print_report(report, globals);
    return write_profile(*device, o.profile);
}

} // namespace

void add_bench_unet(CLI::App& bench, const Globals& globals, Run& run)
{
    auto o = std::make_shared<BenchUnetArguments>();
    CLI::App* c = bench.add_subcommand("unet", "one evaluation of a renderer's UNet");
    c->add_option("--config", o->config, "config.json; default: Stable Diffusion 1.5 with 13 input channels");
    add_number(*c, "-W,--width", o->width, "latent pixels", 1u, 4096u);
    add_number(*c, "-H,--height", o->height, "latent pixels", 1u, 4096u);
    add_number(*c, "--batch", o->batch, "images; 2 is one step with guidance", 1u, 64u);
    add_number(*c, "--tokens", o->tokens, "tokens of the text", 1u, 4096u);
    add_choice(*c, "--precision", {"fp16", "fp32"}, "storage", o->precision);
    add_weights(*c, o->weights);
    add_profile(*c, o->profile);
    add_plan(*c, o->plan);
    c->callback([o, &globals, &run] { run = [o, &globals] { return bench_unet(*o, globals); }; });
}

} // namespace semrover
