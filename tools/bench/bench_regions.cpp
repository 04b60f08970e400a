// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover bench regions: Algorithm 1 over a street-like cloud, one core, no device
#include "engine/voxfield/region_graph.h"
#include "tools/bench/bench.h"
#include "tools/bench/call_times.h"
#include "tools/cli/value_options.h"

#include <CLI/CLI.hpp>
#include <cmath>

namespace semrover {

namespace {

struct BenchRegionsArguments {
    uint32_t cells = 1000000;
    int region_size = 128, coverage_threshold = 32;
};

// ground that rises and falls, and a facade every 25 voxels
std::vector<std::array<int32_t, 3>> street_cloud(uint32_t count)
{
    const int32_t width = std::max(1, int32_t(std::sqrt(count / 1.5)));
    std::vector<std::array<int32_t, 3>> cells;
    cells.reserve(count);
    for (int32_t x = 0; cells.size() < count; ++x)
        for (int32_t y = 0; y < width && cells.size() < count; ++y) {
            const int32_t ground = int32_t(std::lround(2 * std::sin(x / 40.0) + 2 * std::cos(y / 30.0)));
            cells.push_back({x, y, ground});
            for (int32_t z = 1; y % 25 == 0 && z < 13 && cells.size() < count; ++z)
                cells.push_back({x, y, ground + z});
        }
    return cells;
}

Status bench_regions(const BenchRegionsArguments& o, const Globals& globals)
{
    const auto cells = street_cloud(o.cells);
    RegionOptions options;
    options.region_size = o.region_size;
    options.coverage_threshold = std::min(o.coverage_threshold, o.region_size);
    const CallTimer all;
    SR_TRY(const Regions regions, extract_regions(cells, options));
    const double extract = all.ms() / 1000;
    const RegionGraph graph(regions, cells.size());
    const double seconds = all.ms() / 1000;
    print_report({{"kind", "regions"},
                  {"cells", cells.size()},
                  {"regions", regions.size()},
                  {"uncovered", regions.uncovered.size()},
                  {"seconds", seconds},
                  {"seconds_extract", extract},
                  {"seconds_graph", seconds - extract},
                  {"cells_per_second", double(cells.size()) / seconds}},
                 globals);
    return {};
}

} // namespace

void add_bench_regions(CLI::App& bench, const Globals& globals, Run& run)
{
    auto o = std::make_shared<BenchRegionsArguments>();
    CLI::App* c = bench.add_subcommand("regions", "region extraction and the dependency graph (host, one core)");
    add_number(*c, "--cells", o->cells, "voxels of the cloud", 1u, 20000000u);
    add_number(*c, "--region-size", o->region_size, "voxels of a region", 1, 4096);
    add_number(*c, "--coverage-threshold", o->coverage_threshold, "new voxels that a region must have", 1, 4096);
    c->callback([o, &globals, &run] { run = [o, &globals] { return bench_regions(*o, globals); }; });
}

} // namespace semrover
