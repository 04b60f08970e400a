// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/bench/factor_rates.h"

#include "factor_rate.spv.h"
#include "kernels/network/matmul_tiles.h"
#include "tools/bench/bench.h"
#include "tools/cli/print_stderr.h"

#include <algorithm>
#include <bit>

namespace semrover {

namespace {

// of shaders/bench/factor_rate.coopmat.comp
enum FactorSource : uint32_t { kFromRegisters, kFromSharedMemory, kFromMemory };
constexpr const char* kSourceNames[] = {"registers", "shared memory", "memory"};
constexpr uint32_t kProductsOfALoad[] = {4, 8, 16, 32};

constexpr uint64_t kSmallBytes = 64 << 10, kMediumBytes = 4 << 20; // in a unit's own cache, in that of all units
constexpr uint64_t kReadBytes[] = {64 << 10, 1 << 20, 4 << 20, 16 << 20, 32 << 20, 64 << 20, 256 << 20};
constexpr double kFlopsOfARun = 4e12, kBytesOfARun = 4e9; // some milliseconds
constexpr uint32_t kGroupsOfAUnit = 48;                   // several rounds, however many a unit has at once
constexpr uint32_t kRowBytes = 8192;                      // of the tensor that is read

// a dispatch, and what is printed of it
struct Control {
    Json line;
    FactorRatePush push;
    DispatchOptions options = {}; // flops of products
    double bytes = 0;             // that are loaded
};

class FactorRates {
  public:
    FactorRates(Device& device, uint32_t divisor) : device_(device), divisor_(divisor), inputs_(device) {}

    Status allocate()
    {
        uint64_t most = 0;
        for (const uint64_t bytes : kReadBytes)
            most = std::max(most, divided(bytes));
        x_ = inputs_.add(uint32_t(most / kRowBytes), kRowBytes / 2, DType::f16);
        y_ = inputs_.add(4 * group_count(), 256, DType::f32);
        return inputs_.allocate();
    }

    // products_of_a_load: of eight factors, four of either side
    Control products(FactorSource source, uint64_t bytes, uint32_t products_of_a_load) const
    {
        const MatrixShape& m = device_.limits().matrix;
        const double of_round = 2. * m.m * m.n * m.k * std::max(products_of_a_load, 16u) * 4 * group_count();
        const uint32_t rounds = rounds_of(kFlopsOfARun / of_round);
        Control c{{{"control", "products"}, {"from", kSourceNames[source]}}, {rounds, units_of(bytes)}};
        c.options.variant = &Graph(device_.limits()).variant(kernel::factor_rate);
        c.options.constants =
            group_constants(device_.limits(), {{"kSource", source}, {"kProducts", products_of_a_load}});
        c.options.flops = of_round * rounds;
        if (source == kFromMemory)
            c.line["bytes"] = divided(bytes);
        if (source != kFromRegisters) {
            const double of_a_byte = 2. * m.m * m.n * products_of_a_load / (8 * (m.m + m.n));
            c.line["operations_per_byte"] = of_a_byte;
            c.bytes = c.options.flops / of_a_byte;
        }
        return c;
    }

    Control reads(uint64_t bytes) const
    {
        const double of_round = 128. * 8 * 16 * group_count();
        const uint32_t rounds = rounds_of(kBytesOfARun / of_round);
        Control c{{{"control", "reads"}, {"bytes", divided(bytes)}}, {rounds, units_of(bytes)}};
        c.options.variant = &Graph(device_.limits()).variant(kernel::factor_rate, {}, {}, kFeatureCooperativeMatrix);
        c.bytes = of_round * rounds;
        return c;
    }

    Status compile(std::span<const Control> controls) const
    {
        Graph g(device_.limits());
        for (const Control& c : controls)
            (void)add(g, c);
        return compile_pipelines(device_, g);
    }

    // the line, with its rates
    Result<Json> measured(const Control& c) const
    {
        Graph g(device_.limits());
        g.keep(add(g, c), y_.in(g));
        SR_TRY(const auto executable, Executable::create(device_, g));
        SR_TRY(const Timing timing, measure([&] { return executable->run(); }, 200));
        Json line = c.line;
        if (c.options.flops > 0) {
            line["tflops"] = c.options.flops / timing.ms_median / 1e9;
            line["tflops_best"] = c.options.flops / timing.ms_min / 1e9;
        }
        if (c.bytes > 0)
            line["gb_per_s"] = c.bytes / timing.ms_median / 1e6;
        SR_CHECK(add_code(line, device_, *executable));
        return line;
    }

  private:
    uint64_t divided(uint64_t bytes) const // a power of two
    {
        const uint64_t most = std::min(device_.limits().max_storage_range, device_.limits().max_allocation / 2);
        return std::bit_floor(std::clamp<uint64_t>(bytes / divisor_, kRowBytes, most));
    }
    uint32_t units_of(uint64_t bytes) const { return uint32_t(divided(bytes) / 16); }
    uint32_t group_count() const // of four subgroups
    {
        return std::max(kGroupsOfAUnit * device_.limits().compute_units / divisor_, 1u);
    }
    uint32_t rounds_of(double rounds) const
    {
        return uint32_t(std::clamp(rounds / divisor_ / divisor_, 1., 65000.)); // lavapipe ends loops there
    }

    Tensor add(Graph& g, const Control& c) const
    {
        const Tensor y = g.matrix(y_.rows(), y_.cols(), DType::f32);
        g.dispatch(kernel::factor_rate, {{"X", x_.in(g)}, {"Y", y}}, c.push, groups(group_count()), c.options);
        return y;
    }

    Device& device_;
    uint32_t divisor_;
    BenchInputs inputs_;
    DeviceTensor x_, y_;
};

void print_rate(const Json& line)
{
    print_line(line);
    std::string text = line["control"];
    if (line.contains("from"))
        text += " of " + line["from"].get<std::string>();
    if (line.contains("bytes"))
        text += fmt::format(" {} KiB", line["bytes"].get<uint64_t>() >> 10);
    if (line.contains("operations_per_byte"))
        text += fmt::format(", {:g} operations a byte", line["operations_per_byte"].get<double>());
    if (line.contains("tflops"))
        text += fmt::format(": {:.4g} TFLOP/s", line["tflops"].get<double>());
    if (line.contains("gb_per_s"))
        text += fmt::format(": {:.4g} GB/s", line["gb_per_s"].get<double>());
    print_stderr("{}\n", text);
}

} // namespace

Status print_factor_rates(Device& device, uint32_t divisor, const std::function<bool()>& in_time)
{
    FactorRates rates(device, divisor);
    SR_CHECK(rates.allocate());
    std::vector<Control> all{rates.products(kFromRegisters, kSmallBytes, 16)};
    for (const auto& [source, bytes] :
         {std::pair{kFromSharedMemory, kSmallBytes}, {kFromMemory, kSmallBytes}, {kFromMemory, kMediumBytes}})
        for (const uint32_t products : kProductsOfALoad)
            all.push_back(rates.products(source, bytes, products));
    for (const uint64_t bytes : kReadBytes)
        all.push_back(rates.reads(bytes));
    const size_t at_once = compiled_at_once();
    for (size_t i = 0; i < all.size(); ++i) {
        if (!in_time()) {
            print_stderr("no time was left for {} controls\n", all.size() - i);
            break;
        }
        if (i % at_once == 0)
            SR_CHECK(rates.compile(std::span(all).subspan(i, std::min(at_once, all.size() - i))));
        SR_TRY(const Json line, rates.measured(all[i]));
        print_rate(line);
    }
    return {};
}

} // namespace semrover
