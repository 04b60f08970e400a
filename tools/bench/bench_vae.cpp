// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover bench vae: one picture through the decoder, or the encoder, of a VAE with random weights
#include "engine/network/vae.h"
#include "tools/bench/bench.h"
#include "tools/bench/plan_text.h"
#include "tools/cli/open_device.h"
#include "tools/cli/print_stderr.h"
#include "tools/cli/value_options.h"

#include <CLI/CLI.hpp>

namespace semrover {

namespace {

struct BenchVaeArguments {
    std::string config, precision = "fp16", profile;
    bool plan = false;
    uint32_t width = 616, height = 424;
    bool encode = false;
};

Status bench_vae(const BenchVaeArguments& o, const Globals& globals)
{
    VaeConfig config; // Stable Diffusion 1.5's
    SR_CHECK(read_config(o.config, parse_vae_config, config));
    SR_TRY(const auto device, open_device(globals, o.profile));
    const DType dtype = o.precision == "fp32" ? DType::f32 : DType::f16;
    SR_TRY(const auto vae, Vae::load(*device, config, Checkpoint::random(1), dtype));
    const uint32_t scale = o.encode ? 1 : config.downscale();
    FeatureMap x{{}, 1, divide_up(o.height, scale), divide_up(o.width, scale)};
    BenchInputs inputs(*device);
    const DeviceTensor in =
        inputs.add(x.image_rows(), o.encode ? config.in_channels : config.latent_channels, DType::f32);
    SR_CHECK(inputs.allocate());
    Graph g(device->limits());
    x.data = in.in(g);
    (void)(o.encode ? vae->encode(g, x) : vae->decode(g, x));
    restart_profile(*device, o.profile);
    SR_TRY(const auto executable, Executable::create(*device, g));
    SR_TRY(const Timing timing, measure([&] { return executable->run(); }));
    if (o.plan)
        print_stderr("{}", plan_text(executable->plan()));
    const uint64_t weights = vae->device_bytes(device->limits());
    Json report =
        bench_report("vae", *device, dtype, timing, weights + inputs.bytes() + executable->plan().arena_bytes());
    report["direction"] = o.encode ? "encode" : "decode";
    report["width"] = o.width;
    report["height"] = o.height;
    report["bytes_beside_weights"] = device->peak_bytes() - weights;
    add_network(report, *executable, timing, vae->parameters(), weights);
    print_report(report, globals);
    return write_profile(*device, o.profile);
}

} // namespace

void add_bench_vae(CLI::App& bench, const Globals& globals, Run& run)
{
    auto o = std::make_shared<BenchVaeArguments>();
    CLI::App* c = bench.add_subcommand("vae", "a picture through the decoder of a VAE");
    c->add_option("--config", o->config, "config.json; default: Stable Diffusion 1.5");
    add_number(*c, "-W,--width", o->width, "pixels", 1u, 16384u);
    add_number(*c, "-H,--height", o->height, "pixels", 1u, 16384u);
    add_choice(*c, "--precision", {"fp16", "fp32"}, "storage", o->precision);
    c->add_flag("--encode", o->encode, "through the encoder instead");
    add_profile(*c, o->profile);
    add_plan(*c, o->plan);
    c->callback([o, &globals, &run] { run = [o, &globals] { return bench_vae(*o, globals); }; });
}

} // namespace semrover
