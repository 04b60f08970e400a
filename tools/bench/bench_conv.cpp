// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover bench conv: one 3x3 convolution
#include "kernels/network.h"
#include "tools/bench/bench.h"
#include "tools/bench/plan_text.h"
#include "tools/cli/open_device.h"
#include "tools/cli/print_stderr.h"
#include "tools/cli/value_options.h"

#include <CLI/CLI.hpp>

namespace semrover {

namespace {

struct BenchConvArguments {
    uint32_t width = 77, height = 53, channels = 320, outputs = 320;
    std::string precision = "fp16", profile;
    bool plan = false;
    bool winograd = false;
};

Status bench_conv(const BenchConvArguments& o, const Globals& globals)
{
    SR_TRY(const auto device, open_device(globals, o.profile));
    const DType dtype = o.precision == "fp32" ? DType::f32 : DType::f16;
    BenchInputs inputs(*device);
    FeatureMap map{{}, 1, o.height, o.width};
    const DeviceTensor x = inputs.add(map.image_rows(), o.channels, dtype);
    const DeviceTensor w = inputs.add(o.outputs, 9 * round_up(o.channels, kRowPadding), dtype);
    SR_CHECK(inputs.allocate());
    Graph g(device->limits());
    map.data = x.in(g);
    ConvOptions options;
    options.dtype = dtype;
    const Tensor weight = w.in(g);
    (void)(o.winograd ? winograd_conv2d(g, map, winograd_weight(g, weight), {}, options)
                      : conv2d(g, map, {}, weight, {}, options));
    SR_TRY(const auto executable, Executable::create(*device, g));
    SR_TRY(const Timing timing, measure([&] { return executable->run(); }));
    if (o.plan)
        print_stderr("{}", plan_text(executable->plan()));
    Json report = bench_report("conv", *device, dtype, timing, inputs.bytes() + executable->plan().arena_bytes());
    report["width"] = o.width;
    report["height"] = o.height;
    report["channels"] = o.channels;
    report["outputs"] = o.outputs;
    report["algorithm"] = o.winograd ? "winograd" : "direct";
    report["variant"] = executable->plan().passes[0].variant->name;
    add_rate(report, 2.0 * 9 * o.channels * o.outputs * o.width * o.height, timing); // as a direct convolution
    add_executable(report, *executable);
    print_report(report, globals);
    return write_profile(*device, o.profile);
}

} // namespace

void add_bench_conv(CLI::App& bench, const Globals& globals, Run& run)
{
    auto o = std::make_shared<BenchConvArguments>();
    CLI::App* c = bench.add_subcommand("conv", "3x3 convolution of an image, zeros around it");
    add_number(*c, "-W,--width", o->width, "pixels", 1, 16384);
    add_number(*c, "-H,--height", o->height, "pixels", 1, 16384);
    add_number(*c, "--channels", o->channels, "of the input", 1, 16384);
    add_number(*c, "--outputs", o->outputs, "channels of the output", 1, 16384);
    c->add_flag("--winograd", o->winograd, "by Winograd's algorithm, weights transformed in every run");
    add_choice(*c, "--precision", {"fp16", "fp32"}, "storage", o->precision);
    add_profile(*c, o->profile);
    add_plan(*c, o->plan);
    c->callback([o, &globals, &run] { run = [o, &globals] { return bench_conv(*o, globals); }; });
}

} // namespace semrover
