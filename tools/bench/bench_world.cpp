// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover bench world: a flight down a street without end that grows ahead of the camera, a budget at a time
#include "engine/world/world.h"
#include "runtime/system/process.h"
#include "tools/bench/bench.h"
#include "tools/bench/call_times.h"
#include "tools/cli/open_device.h"
#include "tools/cli/value_options.h"

#include <CLI/CLI.hpp>
#include <thread>

namespace semrover {

namespace {

constexpr double kFrameMs = 1000.0 / 60; // of a host that shows 60 pictures a second
constexpr double kMetresOfMemory = 50;   // between two looks at memory

struct BenchWorldArguments {
    Path model;
    std::optional<double> budget; // milliseconds
    double seconds = 60, metres = 200, radius = 24, detail_distance = 0;
    std::optional<int> steps;
    uint64_t tile_bytes = 1u << 30;
};

// a road along x with pavements and a house front on each side, as the sample hosts have it
Status street_cells(const CellWindow& window, VoxelGrid& grid)
{
    for (int32_t i = window.low[0]; i <= window.high[0]; ++i)
        for (int32_t j = window.low[1]; j <= window.high[1]; ++j) {
            const int32_t side = j < 0 ? -1 - j : j; // 0 and on, away from the middle
            for (int32_t k = 0; side <= 8 && k < (side == 8 ? 8 : 1); ++k) {
                grid.cells.push_back({i, j, k});
                grid.labels.push_back(side == 8 ? 2 : side > 5 ? 1 : 0); // building, sidewalk, road
            }
        }
    return {};
}

// what one flight has measured
struct Flight {
    CallTimes frames, steps, focuses, figures;
    size_t frames_with_all = 0;
    Json memory = Json::array();
};

Json memory_at(double metres, const World& world, const Device& device)
{
    const WorldFigures f = world.figures();
    return {{"metres", metres},
            {"device_bytes", device.allocated_bytes()},
            {"process_bytes", system::host_memory().resident},
            {"tile_bytes", f.host_bytes},
            {"tiles_in_memory", f.in_memory},
            {"tiles_generated", f.generated},
            {"splats", world.splats()->splats()}};
}

// One frame: what is wanted, a step, and how much is there. A host that is done early waits for its screen.
Status fly_frame(World& world, double metres, const BenchWorldArguments& o, double budget_ms, Flight& flight)
{
    const CallTimer frame;
    const WorldFocus focus{.position = {metres, 0, 1.7}, .direction = {1, 0, 0}, .radius = o.radius};
    const CallTimer focusing;
    SR_CHECK(world.focus({focus}));
    flight.focuses.add(focusing.ms());
    const CallTimer stepping;
    SR_TRY(const bool all, world.step({~0u, uint64_t(budget_ms * 1000)}));
    flight.steps.add(stepping.ms());
    const CallTimer looking;
    flight.frames_with_all += all && world.figures().finished > 0;
    flight.figures.add(looking.ms());
    if (const double left = kFrameMs - frame.ms(); left > 0)
        std::this_thread::sleep_for(std::chrono::duration<double, std::milli>(left));
    flight.frames.add(frame.ms());
    return {};
}

Json report_of(const Flight& flight, double budget_ms, const World& world)
{
    const double median = flight.frames.percentile(50);
    return {{"budget_ms", budget_ms},
            {"steps", flight.steps.count()},
            {"over_budget_share", flight.steps.share_over(budget_ms)},
            {"worst_step_ms", flight.steps.percentile(100)},
            {"frame_ms_median", median},
            {"hitches", flight.frames.count_over(2 * median)}, // frames that take more than twice the median
            {"finished_share", double(flight.frames_with_all) / double(flight.frames.count())},
            {"tiles_generated", world.figures().generated},
            {"step_ms", flight.steps.json()},
            {"focus_ms", flight.focuses.json()},
            {"figures_ms", flight.figures.json()},
            {"memory", flight.memory}};
}

// in the time of the clock: a slow device sees less of the street finished, not a longer flight
Result<Json> fly(Device& device, const GenerationSettings& settings, const BenchWorldArguments& o, double budget_ms)
{
    WorldRequest request{.settings = settings};
    request.splat_bytes = 256u << 20;
    request.host_bytes = o.tile_bytes;
    request.detail_distance = o.detail_distance;
    SR_TRY(const auto world,
           open_world(device, std::move(request), labels_of_callback(settings.model.config.voxel_size, street_cells)));
    Flight flight;
    const CallTimer clock;
    double next_look = 0;
    for (double metres = 0; metres < o.metres;) {
        if (interrupt_requested())
            return fail(ErrorCode::interrupted, "interrupted");
        if (metres >= next_look) {
            flight.memory.push_back(memory_at(metres, *world, device));
            next_look += kMetresOfMemory;
        }
        SR_CHECK(fly_frame(*world, metres, o, budget_ms, flight));
        metres = clock.ms() / 1000 / o.seconds * o.metres;
    }
    flight.memory.push_back(memory_at(o.metres, *world, device));
    return report_of(flight, budget_ms, *world);
}

Status bench_world(const BenchWorldArguments& o, const Globals& globals)
{
    GenerationOptions options;
    options.model = o.model;
    options.steps = o.steps;
    options.tile_size = kUsualTileSize;
    SR_TRY(const GenerationSettings settings, resolve_generation(options));
    SR_TRY(const auto device, open_device(globals));
    Json report = {{"kind", "world"},
                   {"device", device->name()},
                   {"driver", device->driver()},
                   {"denoising_steps", settings.steps},
                   {"metres", o.metres},
                   {"seconds", o.seconds},
                   {"radius", o.radius},
                   {"detail_distance", o.detail_distance}};
    Json flights = Json::array();
    for (const double budget : o.budget ? std::vector<double>{*o.budget} : std::vector<double>{20, 50, 100}) {
        SR_TRY(Json flight, fly(*device, settings, o, budget));
        flights.push_back(std::move(flight));
    }
    report["flights"] = std::move(flights);
    print_report(report, globals);
    return {};
}

} // namespace

void add_bench_world(CLI::App& bench, const Globals& globals, Run& run)
{
    auto o = std::make_shared<BenchWorldArguments>();
    CLI::App* c = bench.add_subcommand("world", "a flight down a street that grows ahead: steps against their budgets");
    c->add_option("-m,--model", o->model, "model folder")->required();
    add_number(*c, "--budget", o->budget, "milliseconds of a step; else a flight each with 20, 50 and 100", 0.1,
               10000.);
    add_number(*c, "--seconds", o->seconds, "of a flight", 0.1, 3600.);
    add_number(*c, "--metres", o->metres, "of a flight", 1., 10000.);
    add_number(*c, "--radius", o->radius, "metres around the camera that are wanted", 0., 2000.);
    add_number(*c, "--tile-bytes", o->tile_bytes, "of the host, for tiles", uint64_t(0), uint64_t(1) << 40);
    add_number(*c, "--detail-distance", o->detail_distance,
               "metres within which each point has a splat, farther away fewer have; 0: everywhere", 0., 2000.);
    add_number(*c, "--steps", o->steps, "denoising steps; else as the model says", 1, 10000);
    c->callback([o, &globals, &run] { run = [o, &globals] { return bench_world(*o, globals); }; });
}

} // namespace semrover
