// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/json.h"
#include "runtime/device/executable.h"
#include "runtime/device/tensor_pool.h"
#include "tools/cli/commands.h"

#include <functional>
#include <optional>
#include <span>

namespace semrover {

struct Splats;
struct UnetConfig;

// times of a measured piece of work, warm
struct Timing {
    double ms_median = 0, ms_min = 0;
    size_t runs = 0;
};

Timing timing_of(std::vector<double> times); // milliseconds; none: zeros

// runs `work` ten times or for so many milliseconds to warm up, then until 5 runs and that time have passed, or 30 s
Result<Timing> measure(const std::function<Status()>& work, double ms = 1000);

// the fields that every benchmark's JSON has
Json bench_report(const char* kind, const Device& device, DType precision, const Timing& timing,
                  uint64_t predicted_bytes);
void add_executable(Json& report,
                    const Executable& executable); // dispatches, barriers, submits of a run; host_us_per_step
void add_rate(Json& report, double flops, const Timing& timing); // gflop, gflops, gflops_best
// the same of a network's evaluation, and gflop (what is computed: Winograd's algorithm counts as little as it does),
// gflops, weight_bytes
void add_network(Json& report, const Executable& executable, const Timing& timing, uint64_t parameters,
                 uint64_t weight_bytes);
// multiplications and additions of an executable, as its plan counts them
double flops_of(const Executable& executable);
// a network's config.json; `config` as it is where there is no path
template <typename Config, typename Parse>
Status read_config(const std::string& path, Parse parse, Config& config)
{
    if (path.empty())
        return {};
    SR_TRY(const Json json, read_json(path));
    SR_TRY(config, parse(json));
    return {};
}

// of an executable's first pass: shared_bytes of a workgroup and, where the device keeps it, what its driver says of
// the code, under the driver's own names: statistics
Status add_code(Json& report, Device& device, const Executable& executable);

// The pipelines of a graph are compiled side by side, for executables that follow; of so many it has use at once.
Status compile_pipelines(Device& device, const Graph& graph);
size_t compiled_at_once();

// --weights: q8_0, or in the precision
void add_weights(CLI::App& command, std::string& weights);
// a UNet's config with such weights, where they are given. bad_input: one that cannot have them
Status store_as(const std::string& weights, UnetConfig& config);

// --profile: device times as a Chrome trace; their sums, and what the driver says of each kernel's code, to stderr
void add_profile(CLI::App& command, std::string& path);
void add_plan(CLI::App& command, bool& plan);
void restart_profile(Device& device, const std::string& path); // without what ran before, such as loading weights
Status write_profile(Device& device, const std::string& path);
void print_report(const Json& report, const Globals& globals);
void print_line(const Json& object); // at once: what is printed stays when a long run is cut off

// memory with seeded values on a device, for inputs of kernels
class BenchInputs {
  public:
    explicit BenchInputs(Device& device) : device_(device) {}
    // normal-ish values as fp32 or fp16 matrices, small ones as q8_0, or uniform words for u32
    DeviceTensor add(uint32_t rows, uint32_t cols, DType dtype);
    Status allocate();
    uint64_t bytes() const { return pool_.planned_bytes(device_.limits()); }

  private:
    Device& device_;
    TensorPool pool_;
    std::vector<DeviceTensor> inputs_;
};

// y [m, n] = x [m, k] w [n, k]^T
struct GemmShape {
    uint32_t m = 384, n = 4096, k = 1024;
};
// w of another type: whole blocks of K
Result<std::unique_ptr<Executable>> gemm_executable(Device& device, BenchInputs& inputs, const GemmShape& shape,
                                                    DType dtype, std::optional<DType> w_dtype = {});

// a street: ground, two facades and blobs between them, in front of a camera at the origin that looks along x
Splats street_splats(uint32_t count, float sigma);

void add_bench_gemm(CLI::App& bench, const Globals& globals, Run& run);
void add_bench_conv(CLI::App& bench, const Globals& globals, Run& run);
void add_bench_tiles(CLI::App& bench, const Globals& globals, Run& run);
void add_bench_transformer(CLI::App& bench, const Globals& globals, Run& run);
void add_bench_unet(CLI::App& bench, const Globals& globals, Run& run);
void add_bench_vae(CLI::App& bench, const Globals& globals, Run& run);
void add_bench_asd(CLI::App& bench, const Globals& globals, Run& run);
void add_bench_vsd(CLI::App& bench, const Globals& globals, Run& run);
void add_bench_regions(CLI::App& bench, const Globals& globals, Run& run);
void add_bench_sort(CLI::App& bench, const Globals& globals, Run& run);
void add_bench_world(CLI::App& bench, const Globals& globals, Run& run);
void add_bench_splat(CLI::App& bench, const Globals& globals, Run& run);
void add_bench_pictures(CLI::App& bench, const Globals& globals, Run& run);

} // namespace semrover
