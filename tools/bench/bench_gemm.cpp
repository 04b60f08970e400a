// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover bench gemm: y = x w^T, x [m, k], w [n, k]
#include "kernels/network.h"
#include "tools/bench/bench.h"
#include "tools/bench/plan_text.h"
#include "tools/cli/open_device.h"
#include "tools/cli/print_stderr.h"
#include "tools/cli/value_options.h"

#include <CLI/CLI.hpp>

namespace semrover {

namespace {

struct BenchGemmArguments {
    GemmShape shape;
    std::string precision = "fp16", weights, profile;
    bool plan = false;
};

Status bench_gemm(const BenchGemmArguments& o, const Globals& globals)
{
    SR_TRY(const auto device, open_device(globals, o.profile));
    const DType dtype = o.precision == "fp32" ? DType::f32 : DType::f16;
    const DType w_dtype = o.weights.empty() ? dtype : DType::q8_0;
    if (o.shape.k % block_of(w_dtype).elements)
        return fail(ErrorCode::usage, "--weights q8_0: --k is {}, no multiple of {}", o.shape.k,
                    block_of(w_dtype).elements);
    BenchInputs inputs(*device);
    SR_TRY(const auto executable, gemm_executable(*device, inputs, o.shape, dtype, w_dtype));
    SR_TRY(const Timing timing, measure([&] { return executable->run(); }));
    if (o.plan)
        print_stderr("{}", plan_text(executable->plan()));
    Json report = bench_report("gemm", *device, dtype, timing, inputs.bytes() + executable->plan().arena_bytes());
    report["m"] = o.shape.m;
    report["n"] = o.shape.n;
    report["k"] = o.shape.k;
    report["variant"] = executable->plan().passes[0].variant->name;
    add_rate(report, flops_of(*executable), timing);
    add_executable(report, *executable);
    print_report(report, globals);
    return write_profile(*device, o.profile);
}

} // namespace

Result<std::unique_ptr<Executable>> gemm_executable(Device& device, BenchInputs& inputs, const GemmShape& s,
                                                    DType dtype, std::optional<DType> w_dtype)
{
    const DeviceTensor x = inputs.add(s.m, s.k, dtype), w = inputs.add(s.n, s.k, w_dtype.value_or(dtype));
    const DeviceTensor y = inputs.add(s.m, s.n, dtype);
    SR_CHECK(inputs.allocate());
    Graph g(device.limits());
    g.keep(gemm(g, x.in(g), w.in(g), {}, {.dtype = dtype}), y.in(g));
    return Executable::create(device, g);
}

void add_bench_gemm(CLI::App& bench, const Globals& globals, Run& run)
{
    auto o = std::make_shared<BenchGemmArguments>();
    CLI::App* c = bench.add_subcommand("gemm", "dense layer: y [m, n] = x [m, k] w [n, k]^T");
    add_number(*c, "--m", o->shape.m, "rows of x", 1, 65536);
    add_number(*c, "--n", o->shape.n, "rows of w", 1, 65536);
    add_number(*c, "--k", o->shape.k, "columns of both", 1, 65536);
    add_choice(*c, "--precision", {"fp16", "fp32"}, "storage", o->precision);
    add_weights(*c, o->weights);
    add_profile(*c, o->profile);
    add_plan(*c, o->plan);
    c->callback([o, &globals, &run] { run = [o, &globals] { return bench_gemm(*o, globals); }; });
}

} // namespace semrover
