// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover bench tiles: how fast workgroups make products and convolutions with one tile or another. One object a line
#include "gemm.spv.h"
#include "kernels/network.h"
#include "kernels/network/matmul_tiles.h"
#include "tools/bench/bench.h"
#include "tools/bench/call_times.h"
#include "tools/cli/open_device.h"
#include "tools/cli/print_stderr.h"
#include "tools/cli/value_options.h"

#include <algorithm>
#include <CLI/CLI.hpp>
#include <map>
#include <numeric>

namespace semrover {

namespace {

struct BenchTilesArguments {
    uint32_t divisor = 1, repeats = 20;
    double seconds = 400;
};

// [rows, depth] x [cols, depth]^T; or a 3x3 convolution of two images of side x side pixels
struct TileShape {
    uint32_t rows, cols, depth, side = 0;
};
// a square of products that fills every unit; then those of a UNet at 64 x 64 pixels and of a transformer
constexpr TileShape kShapes[] = {{4096, 4096, 4096},     {8192, 1280, 1280},    {8192, 2560, 320},
                                 {3200, 4096, 1024},     {8192, 320, 2880, 64}, {2048, 640, 5760, 32},
                                 {512, 1280, 11520, 16}, {128, 1280, 11520, 8}};
constexpr TileShape kCheckedShape{512, 640, 1280}; // made with every tile, for its bits

// In the order in which they answer most: larger parts of a subgroup in two stages, without and with factors loaded
// ahead; today's parts in two stages; rectangles that fit multiples of 320; short steps; small workgroups side by side;
// strips of the epilogue; the order of workgroups; what is small
constexpr MatmulTile kTried[] = {
    {.rows = 128, .cols = 128, .subgroups = 8, .step = 64, .strip = 32}, // others are compared with this one
    {.rows = 128, .cols = 128, .step = 16, .stages = 2},
    {.rows = 256, .cols = 128, .down = 4, .subgroups = 8, .step = 16, .stages = 2},
    {.rows = 256, .cols = 128, .down = 4, .subgroups = 8, .step = 16},
    {.rows = 128, .cols = 128, .step = 16, .stages = 2, .ahead = true},
    {.rows = 256, .cols = 128, .down = 4, .subgroups = 8, .step = 16, .stages = 2, .ahead = true},
    {.rows = 128, .cols = 128, .subgroups = 8, .step = 32, .stages = 2},
    {.rows = 128, .cols = 128, .subgroups = 8, .step = 32, .stages = 2, .ahead = true},
    {.rows = 128, .cols = 160, .down = 4, .subgroups = 8, .step = 64},
    {.rows = 128, .cols = 160, .down = 4, .subgroups = 8, .step = 16, .stages = 2},
    {.rows = 128, .cols = 80, .down = 4, .step = 64},
    {.rows = 64, .cols = 160, .step = 64},
    {.rows = 128, .cols = 128, .subgroups = 8, .step = 16, .strip = 32},
    {.rows = 128, .cols = 128, .subgroups = 8, .step = 32, .strip = 32},
    {.rows = 128, .cols = 128, .subgroups = 8, .step = 64, .ahead = true, .strip = 32},
    {.rows = 128, .cols = 64, .step = 32, .strip = 32},
    {.rows = 128, .cols = 64, .step = 32, .stages = 2, .strip = 32},
    {.rows = 128, .cols = 64, .step = 64, .strip = 32},
    {.rows = 128, .cols = 128, .subgroups = 8, .step = 64, .strip = 16},
    {.rows = 128, .cols = 128, .step = 64, .strip = 64},
    {.rows = 128, .cols = 128, .subgroups = 8, .step = 64, .strip = 32, .rows_of_tiles = 4},
    {.rows = 128, .cols = 128, .subgroups = 8, .step = 64, .strip = 32, .rows_of_tiles = 8},
    {.rows = 128, .cols = 128, .subgroups = 8, .step = 64, .strip = 32, .rows_of_tiles = 16},
    {.rows = 64, .cols = 64, .step = 64, .strip = 32},
    {.rows = 64, .cols = 64, .step = 32, .stages = 2, .strip = 32},
    {.rows = 32, .cols = 32, .step = 128},
    {.rows = 32, .cols = 32, .step = 64, .stages = 2},
};

Json json_of(const MatmulTile& t)
{
    return {{"rows", t.rows},           {"cols", t.cols},   {"down", t.down},
            {"subgroups", t.subgroups}, {"step", t.step},   {"stages", t.stages},
            {"ahead", t.ahead},         {"strip", t.strip}, {"rows_of_tiles", t.rows_of_tiles}};
}

// a product or convolution that is made several times, one after the other; the last one's output is y
struct TileProgram {
    DeviceTensor y;
    std::unique_ptr<Executable> executable;
    double flops = 0; // of all
};

Result<TileProgram> tile_executable(Device& device, BenchInputs& inputs, const TileShape& s, const MatmulTile& tile,
                                    uint32_t repeats)
{
    const DType half = DType::f16;
    FeatureMap map{{}, 2, s.side, s.side};
    const uint32_t rows = s.side ? 2 * map.image_rows() : s.rows, channels = s.side ? s.depth / 9 : s.depth;
    const DeviceTensor x = inputs.add(rows, channels, half), w = inputs.add(s.cols, s.depth, half);
    TileProgram made{inputs.add(rows, s.cols, half), nullptr};
    SR_CHECK(inputs.allocate());
    Graph g(device.limits());
    g.keep_order();
    map.data = x.in(g);
    const Tensor weight = w.in(g);
    Tensor y;
    for (uint32_t i = 0; i < repeats; ++i)
        y = s.side ? conv2d(g, map, {}, weight, {}, {.dtype = half, .tile = &tile}).data
                   : gemm(g, map.data, weight, {}, {.dtype = half, .tile = &tile});
    g.keep(y, made.y.in(g));
    SR_TRY(made.executable, Executable::create(device, g));
    made.flops = flops_of(*made.executable);
    return made;
}

// the words of what a tile makes
Result<std::vector<uint32_t>> output_of(Device& device, const TileShape& shape, const MatmulTile& tile)
{
    BenchInputs inputs(device);
    SR_TRY(const TileProgram made, tile_executable(device, inputs, shape, tile, 1));
    SR_CHECK(made.executable->run());
    return made.y.read<uint32_t>(device);
}

class TileBench {
  public:
    TileBench(Device& device, const BenchTilesArguments& o) : device_(device), o_(o) {}

    Status run()
    {
        SR_CHECK(check_all());
        for (const bool backwards : {false, true}) // clocks and temperature drift
            for (TileShape shape : kShapes) {
                shape = divided(shape);
                for (size_t i = 0; i < good_.size() && timer_.ms() < 1000 * o_.seconds; ++i)
                    SR_CHECK(time(shape, good_[backwards ? good_.size() - 1 - i : i]));
            }
        summarize();
        return {};
    }

  private:
    // a smaller shape of the same kind; depths stay multiples of what a convolution's taps need
    TileShape divided(TileShape s) const
    {
        const uint32_t d = o_.divisor;
        return {std::max(s.rows / d, 16u), std::max(s.cols / d, 16u), std::max(s.depth / d / 72 * 72, 72u),
                s.side ? std::max(s.side / d, 4u) : 0};
    }

    Status check_all()
    {
        const KernelVariant& variant = Graph(device_.limits()).variant(kernel::gemm);
        if (!(variant.features & kFeatureCooperativeMatrix))
            return fail(ErrorCode::no_device,
                        "{}: tiles are of matrix units (VK_KHR_cooperative_matrix), which it has not", device_.name());
        std::vector<uint32_t> wanted;
        for (const MatmulTile& tile : kTried) {
            Json line{{"tile", json_of(tile)}};
            if (!has_room_for(variant, device_.limits(), tile)) {
                line["left_out"] = "no room";
            } else {
                SR_TRY(const std::vector<uint32_t> words, output_of(device_, divided(kCheckedShape), tile));
                if (wanted.empty())
                    wanted = words;
                line["same_bits"] = words == wanted;
                if (words == wanted)
                    good_.push_back(tile);
            }
            fmt::print("{}\n", line.dump());
        }
        return {};
    }

    Status time(const TileShape& shape, const MatmulTile& tile)
    {
        BenchInputs inputs(device_);
        SR_TRY(const TileProgram made, tile_executable(device_, inputs, shape, tile, o_.repeats));
        std::vector<double> ms;
        const CallTimer all;
        while (ms.size() < 4 || (all.ms() < 60 && ms.size() < 20)) {
            const CallTimer one;
            SR_CHECK(made.executable->run());
            ms.push_back(one.ms());
        }
        ms.erase(ms.begin()); // warms up
        const Timing timing = timing_of(ms);
        Json line{{"shape", {shape.rows, shape.cols, shape.depth}}, {"convolution", shape.side != 0}};
        line["tile"] = json_of(tile);
        const double tflops = made.flops / timing.ms_median / 1e9;
        line["tflops"] = tflops;
        line["tflops_best"] = made.flops / timing.ms_min / 1e9;
        fmt::print("{}\n", line.dump());
        const std::string name =
            fmt::format("{} {}x{}x{}", shape.side ? "convolution" : "product", shape.rows, shape.cols, shape.depth);
        rates_[name][json_of(tile).dump()].push_back(tflops);
        return {};
    }

    // of each shape the fastest ones by the mean of both times, and what they are of the first one
    void summarize() const
    {
        for (const auto& [shape, of_tiles] : rates_) {
            std::vector<std::pair<double, std::string>> means;
            for (const auto& [tile, rates] : of_tiles)
                means.push_back({std::accumulate(rates.begin(), rates.end(), 0.) / double(rates.size()), tile});
            std::ranges::sort(means, std::greater());
            const auto first =
                std::ranges::find(means, json_of(kTried[0]).dump(), &std::pair<double, std::string>::second);
            print_stderr("{}:", shape);
            for (const auto& [rate, tile] : std::span(means).first(std::min<size_t>(means.size(), 5)))
                print_stderr("  {:8.3f} TFLOP/s, {:.2f} of the first: {}", rate,
                             first == means.end() ? 0 : rate / first->first, tile);
        }
    }

    Device& device_;
    BenchTilesArguments o_;
    CallTimer timer_;
    std::vector<MatmulTile> good_;                                            // that have the first one's bits
    std::map<std::string, std::map<std::string, std::vector<double>>> rates_; // shape -> tile -> TFLOP/s
};

} // namespace

void add_bench_tiles(CLI::App& bench, const Globals& globals, Run& run)
{
    auto o = std::make_shared<BenchTilesArguments>();
    CLI::App* c = bench.add_subcommand("tiles", "ways to make products with matrix units: same bits? how fast?");
    add_number(*c, "--divide", o->divisor, "by which all sizes are divided, for a try", 1, 256);
    add_number(*c, "--repeats", o->repeats, "of a product in a run", 1, 1000);
    add_number(*c, "--seconds", o->seconds, "after which no other is begun", 0, 1e6);
    c->callback([o, &globals, &run] {
        run = [o, &globals]() -> Status {
            SR_TRY(const auto device, open_device(globals));
            return TileBench(*device, *o).run();
        };
    });
}

} // namespace semrover
