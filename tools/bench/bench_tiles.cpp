// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover bench tiles: how fast workgroups make products and convolutions with one tile or another. One object a line
#include "gemm.spv.h"
#include "kernels/network.h"
#include "kernels/network/matmul_tiles.h"
#include "tools/bench/bench.h"
#include "tools/bench/call_times.h"
#include "tools/bench/factor_rates.h"
#include "tools/cli/open_device.h"
#include "tools/cli/print_stderr.h"
#include "tools/cli/value_options.h"

#include <algorithm>
#include <CLI/CLI.hpp>
#include <map>
#include <numeric>
#include <ranges>

namespace semrover {

namespace {

struct BenchTilesArguments {
    uint32_t divisor = 1, repeats = 20;
    double seconds = 400;
};

// [rows, depth] x [cols, depth]^T; or a 3x3 convolution of two images of side x side pixels
struct TileShape {
    uint32_t rows, cols, depth, side = 0;

    bool operator==(const TileShape&) const = default;
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

// K of the convolution in other slices than it is cut into where nobody asks: where few workgroups are
constexpr TileShape kSlicedShape{512, 1280, 11520, 16};
struct Way {
    MatmulTile tile;
    uint32_t slices = 0; // of K; 0: as many as suit
};
constexpr MatmulTile kWideTile{.rows = 128, .cols = 160, .down = 4, .subgroups = 8, .step = 64};
constexpr MatmulTile kFlatTile{.rows = 64, .cols = 160, .step = 64};
constexpr Way kSliced[] = {{kWideTile, 2}, {kWideTile, 4}, {kWideTile, 8},
                           {kFlatTile, 1}, {kFlatTile, 2}, {kFlatTile, 4}};

Json json_of(const MatmulTile& t)
{
    return {{"rows", t.rows},           {"cols", t.cols},   {"down", t.down},
            {"subgroups", t.subgroups}, {"step", t.step},   {"stages", t.stages},
            {"ahead", t.ahead},         {"strip", t.strip}, {"rows_of_tiles", t.rows_of_tiles}};
}

Json json_of(const TileShape& s)
{
    return {{"kind", s.side ? "convolution" : "product"}, {"rows", s.rows}, {"cols", s.cols}, {"depth", s.depth}};
}

// a product or convolution of factors that are on a device, in any way
class TileWork {
  public:
    TileWork(Device& device, const TileShape& shape) : device_(device), shape_(shape), inputs_(device) {}

    Status allocate()
    {
        const uint32_t side = shape_.side;
        const uint32_t rows = side ? 2 * FeatureMap{{}, 2, side, side}.image_rows() : shape_.rows;
        x_ = inputs_.add(rows, side ? shape_.depth / 9 : shape_.depth, DType::f16);
        w_ = inputs_.add(shape_.cols, shape_.depth, DType::f16);
        y_ = inputs_.add(rows, shape_.cols, DType::f16);
        return inputs_.allocate();
    }

    // pipelines, side by side
    Status compile(std::span<const Way> ways) const
    {
        Graph g(device_.limits());
        for (const Way& way : ways)
            (void)add(g, way);
        return compile_pipelines(device_, g);
    }

    // several times, one after the other; the last one's output is kept
    Result<std::unique_ptr<Executable>> executable(const Way& way, uint32_t repeats) const
    {
        Graph g(device_.limits());
        g.keep_order();
        Tensor y;
        for (uint32_t i = 0; i < repeats; ++i)
            y = add(g, way);
        g.keep(y, y_.in(g));
        return Executable::create(device_, g);
    }

    Result<std::vector<uint32_t>> output() const { return y_.read<uint32_t>(device_); }

  private:
    Tensor add(Graph& g, const Way& way) const
    {
        const Tensor x = x_.in(g), w = w_.in(g);
        const FeatureMap map{x, 2, shape_.side, shape_.side};
        return shape_.side ? conv2d(g, map, {}, w, {}, {.tile = &way.tile, .slices = way.slices}).data
                           : gemm(g, x, w, {}, {.tile = &way.tile});
    }

    Device& device_;
    TileShape shape_;
    BenchInputs inputs_;
    DeviceTensor x_, w_, y_;
};

// of a convolution's first pass
uint32_t slices_of(const Executable& executable)
{
    const Pass& pass = executable.plan().passes.front();
    const ConstantInfo* slices = pass.variant->constant("kSlices");
    return slices && pass.constants.contains(slices->id) ? pass.constants.at(slices->id) : 1;
}

class TileBench {
  public:
    TileBench(Device& device, const BenchTilesArguments& o) : device_(device), o_(o) {}

    Status run()
    {
        const KernelVariant& variant = Graph(device_.limits()).variant(kernel::gemm);
        if (!(variant.features & kFeatureCooperativeMatrix))
            return fail(ErrorCode::no_device,
                        "{}: tiles are of matrix units (VK_KHR_cooperative_matrix), which it has not", device_.name());
        SR_CHECK(print_factor_rates(device_, o_.divisor, [this] { return in_time(); }));
        SR_CHECK(check_all(variant));
        for (const TileShape& shape : kShapes)
            SR_CHECK(time_all(shape, false));
        for (const TileShape& shape : kShapes | std::views::reverse) // clocks and temperature drift
            SR_CHECK(time_all(shape, true));
        summarize();
        return {};
    }

  private:
    bool in_time() const { return timer_.ms() < 1000 * o_.seconds; }

    // a smaller shape of the same kind; depths stay multiples of what a convolution's taps need
    TileShape divided(TileShape s) const
    {
        const uint32_t d = o_.divisor;
        return {std::max(s.rows / d, 16u), std::max(s.cols / d, 16u), std::max(s.depth / d / 72 * 72, 72u),
                s.side ? std::max(s.side / d, 4u) : 0};
    }

    // `one` for each way that there is time for, whose pipelines are compiled with those of others; a line for others
    Status for_each(const TileShape& shape, const std::vector<Way>& ways, const Json& about,
                    const std::function<Status(const TileWork&, const Way&)>& one)
    {
        TileWork work(device_, shape);
        SR_CHECK(work.allocate());
        const size_t at_once = compiled_at_once();
        for (size_t i = 0; i < ways.size(); ++i) {
            if (in_time() && i % at_once == 0)
                SR_CHECK(work.compile(std::span(ways).subspan(i, std::min(at_once, ways.size() - i))));
            if (in_time())
                SR_CHECK(one(work, ways[i]));
            else
                leave_out(about, ways[i], "no time");
        }
        return {};
    }

    void leave_out(Json line, const Way& way, const char* why)
    {
        line["tile"] = json_of(way.tile);
        if (way.slices)
            line["slices"] = way.slices;
        line["left_out"] = why;
        print_line(line);
        ++left_out_[why];
    }

    Status check_all(const KernelVariant& variant)
    {
        std::vector<Way> ways;
        const Json about{{"check", "bits"}};
        for (const MatmulTile& tile : kTried)
            if (has_room_for(variant, device_.limits(), tile))
                ways.push_back({tile});
            else
                leave_out(about, {tile}, "no room");
        std::vector<uint32_t> wanted;
        return for_each(divided(kCheckedShape), ways, about, [&](const TileWork& work, const Way& way) -> Status {
            SR_TRY(const auto executable, work.executable(way, 1));
            SR_CHECK(executable->run());
            SR_TRY(const std::vector<uint32_t> words, work.output());
            if (wanted.empty())
                wanted = words;
            Json line = about;
            line["tile"] = json_of(way.tile);
            line["same_bits"] = words == wanted;
            SR_CHECK(add_code(line, device_, *executable));
            print_line(line);
            if (words == wanted)
                good_.push_back(way);
            return {};
        });
    }

    bool is_good(const MatmulTile& tile) const { return std::ranges::find(good_, tile, &Way::tile) != good_.end(); }

    Status time_all(const TileShape& whole, bool backwards)
    {
        const TileShape shape = divided(whole);
        std::vector<Way> ways = good_;
        if (whole == kSlicedShape)
            std::ranges::copy_if(kSliced, std::back_inserter(ways), [&](const Way& way) { return is_good(way.tile); });
        if (backwards)
            std::ranges::reverse(ways);
        const Json about{{"shape", json_of(shape)}, {"pass", backwards ? 2 : 1}};
        return for_each(shape, ways, about, [&](const TileWork& work, const Way& way) -> Status {
            SR_TRY(const auto executable, work.executable(way, o_.repeats));
            SR_TRY(const Timing timing, measure([&] { return executable->run(); }, 60));
            Json line = about, key = json_of(way.tile);
            line["tile"] = key;
            line["slices"] = key["slices"] = slices_of(*executable);
            const double flops = flops_of(*executable);
            line["tflops"] = flops / timing.ms_median / 1e9;
            line["tflops_best"] = flops / timing.ms_min / 1e9;
            line["runs"] = timing.runs;
            SR_CHECK(add_code(line, device_, *executable));
            print_line(line);
            const std::string name = json_text(json_of(shape));
            rates_[name][json_text(key)].push_back(line["tflops"]);
            if (!way.slices && way.tile == good_.front().tile)
                first_[name] = json_text(key);
            return {};
        });
    }

    // of each shape the fastest ones by the mean of both times, and what they are of the first one
    void summarize() const
    {
        for (const auto& [shape, of_tiles] : rates_) {
            const auto mean = [](const std::vector<double>& rates) {
                return std::accumulate(rates.begin(), rates.end(), 0.) / double(rates.size());
            };
            std::vector<std::pair<double, std::string>> means;
            for (const auto& [tile, rates] : of_tiles)
                means.push_back({mean(rates), tile});
            const double first = mean(of_tiles.at(first_.at(shape))); // whose bits others have
            std::ranges::sort(means, std::greater());
            print_stderr("{}:\n", shape);
            for (const auto& [rate, tile] : std::span(means).first(std::min<size_t>(means.size(), 5)))
                print_stderr("  {:8.3f} TFLOP/s, {:.2f} of the first: {}\n", rate, rate / first, tile);
        }
        for (const auto& [why, count] : left_out_)
            print_stderr("{} left out: {}\n", count, why);
    }

    Device& device_;
    BenchTilesArguments o_;
    CallTimer timer_;
    std::vector<Way> good_;                                                   // that have the first one's bits
    std::map<std::string, std::map<std::string, std::vector<double>>> rates_; // shape -> tile and slices -> TFLOP/s
    std::map<std::string, std::string> first_; // shape -> tile that others are compared with
    std::map<std::string, size_t> left_out_;   // why -> how many
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
            SR_TRY(const auto device, open_device(globals, {}, true));
            return TileBench(*device, *o).run();
        };
    });
}

} // namespace semrover
