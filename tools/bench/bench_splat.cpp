// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover bench sort: pairs of 32-bit keys and values; bench splat: a frame of splats from projection to pixels
#include "engine/splat/rasterizer.h"
#include "kernels/sort.h"
#include "tools/bench/bench.h"
#include "tools/cli/open_device.h"
#include "tools/cli/value_options.h"

#include <CLI/CLI.hpp>

namespace semrover {

namespace {

struct SortOptions {
    uint32_t pairs = 1000000;
    std::string profile;
};

struct SplatBenchOptions {
    uint32_t splats = 200000, width = 616, height = 424, movers = 0;
    float sigma = 0.04f;
    std::string model = "pinhole", profile;
};

Status bench_sort(const SortOptions& o, const Globals& globals)
{
    SR_TRY(const auto device, open_device(globals, o.profile));
    BenchInputs inputs(*device);
    const DeviceTensor keys = inputs.add(o.pairs, 1, DType::u32), values = inputs.add(o.pairs, 1, DType::u32);
    const uint64_t predicted = inputs.bytes();
    SR_CHECK(inputs.allocate());
    Graph g(device->limits());
    (void)radix_sort(g, keys.in(g), values.in(g));
    SR_TRY(const auto executable, Executable::create(*device, g));
    SR_TRY(const Timing timing, measure([&] { return executable->run(); }));
    Json report = bench_report("sort", *device, DType::f32, timing, predicted + executable->plan().arena_bytes());
    report["precision"] = "u32";
    report["pairs"] = o.pairs;
    report["mpairs_per_second"] = o.pairs / timing.ms_median / 1e3;
    // four passes over 8-bit digits read keys twice and values once and write both
    report["gbps"] = 80.0 * o.pairs / timing.ms_median / 1e6;
    add_executable(report, *executable);
    print_report(report, globals);
    return write_profile(*device, o.profile);
}

Intrinsics bench_camera(CameraModel model, uint32_t width, uint32_t height)
{
    if (model == CameraModel::equirectangular)
        return whole_sphere(width, height);
    Intrinsics k{0.68 * width, 0.68 * width, width / 2.0, height / 2.0, width, height, model};
    if (model == CameraModel::opencv)
        k.distortion = {-0.2, 0.05, 0.001, -0.001};
    return k;
}

// A tenth of the splats are of things that move, in turns, and are where they were: the picture is the same. 0: none
std::vector<uint32_t> owners_of(const SplatBenchOptions& o)
{
    std::vector<uint32_t> owners(o.splats);
    for (uint32_t i = 0; o.movers && i < o.splats; i += 10)
        owners[i] = 1 + i / 10 % o.movers;
    return owners;
}

SplatMovers movers_of(const SplatBenchOptions& o, const SplatCamera& camera)
{
    SplatMovers movers{o.movers, {0}, {}};
    for (uint32_t i = 0; i < o.movers; ++i) {
        movers.rows.push_back(i + 1);
        movers.views.push_back(camera.world_to_camera);
    }
    return movers;
}

Status bench_splat(const SplatBenchOptions& o, const Globals& globals)
{
    SR_TRY(const auto device, open_device(globals, o.profile));
    SR_TRY(const SplatScene scene, SplatScene::create(*device, street_splats(o.splats, o.sigma), owners_of(o)));
    const CameraModel model = camera_model_of(o.model).value_or(CameraModel::pinhole);
    SR_TRY(const auto rasterizer,
           Rasterizer::create(*device, scene, o.width, o.height, 1,
                              {.model = model, .movers = o.movers, .mover_numbers = o.movers + 1}));
    const SplatCamera camera =
        splat_camera(bench_camera(model, o.width, o.height), {{0, -1, 0, 0, 0, 0, -1, 0, 1, 0, 0, 0, 0, 0, 0, 1}});
    std::vector<SplatImage> images;
    const SplatMovers movers = movers_of(o, camera);
    SR_CHECK(rasterizer->render({&camera, 1}, images, movers)); // finds how much room the pairs need
    device->reset_peak();
    SR_TRY(const Timing timing, measure([&] { return rasterizer->render({&camera, 1}, images, movers); }));
    Json report = bench_report("splat", *device, DType::f32, timing, scene.bytes() + rasterizer->planned_bytes());
    report["splats"] = o.splats;
    report["movers"] = o.movers;
    report["camera_model"] = o.model;
    report["width"] = o.width;
    report["height"] = o.height;
    report["msplats_per_second"] = o.splats / timing.ms_median / 1e3;
    // a record of 64 bytes a splat and 48 bytes of outputs a pixel, once
    report["gbps"] = (64.0 * o.splats + 48.0 * o.width * o.height) / timing.ms_median / 1e6;
    add_executable(report, rasterizer->executable());
    print_report(report, globals);
    return write_profile(*device, o.profile);
}

} // namespace

Splats street_splats(uint32_t count, float sigma)
{
    Splats s;
    uint32_t state = 777;
    const auto random = [&] {
        state = state * 1664525u + 1013904223u;
        return float(state >> 8) / 16777216.f;
    };
    for (uint32_t i = 0; i < count; ++i) {
        const float along = 1 + 60 * random(), a = random(), b = random();
        std::array<float, 3> p{along, 16 * a - 8, -1.7f}, n{0, 0, 1};
        if (i % 4 == 3) {
            p = {along, 10 * a - 5, 3 * b - 1.7f};
            n = {-1, 0, 0};
        } else if (i % 4) {
            p = {along, i % 4 == 1 ? 8.f : -8.f, 12 * a - 1.7f};
            n = {0, i % 4 == 1 ? -1.f : 1.f, 0};
        }
        s.position.push_back(p);
        s.normal.push_back(n);
        s.color.push_back({a, b, random()});
        s.sigma_u.push_back(sigma);
        s.sigma_v.push_back(sigma);
        s.opacity.push_back(1);
        s.label.push_back(uint8_t(i % 20));
    }
    return s;
}

void add_bench_sort(CLI::App& bench, const Globals& globals, Run& run)
{
    auto o = std::make_shared<SortOptions>();
    CLI::App* c = bench.add_subcommand("sort", "stable radix sort of 32-bit pairs");
    add_number(*c, "--pairs", o->pairs, "pairs", 1u, 1u << 28);
    add_profile(*c, o->profile);
    c->callback([o, &globals, &run] { run = [o, &globals] { return bench_sort(*o, globals); }; });
}

void add_bench_splat(CLI::App& bench, const Globals& globals, Run& run)
{
    auto o = std::make_shared<SplatBenchOptions>();
    CLI::App* c = bench.add_subcommand("splat", "one frame of 2D Gaussian splats, images read back");
    add_number(*c, "--splats", o->splats, "splats of the scene", 1u, 50000000u);
    add_number(*c, "--movers", o->movers, "things that move, a tenth of the splats", 0u, 65534u);
    add_number(*c, "-W,--width", o->width, "pixels", 1u, 16384u);
    add_number(*c, "-H,--height", o->height, "pixels", 1u, 16384u);
    add_number(*c, "--splat-radius", o->sigma, "metres", 0.001f, 10.f);
    add_choice(*c, "--camera-model", {"pinhole", "opencv", "fisheye", "equirectangular"}, "lens", o->model);
    add_profile(*c, o->profile);
    c->callback([o, &globals, &run] { run = [o, &globals] { return bench_splat(*o, globals); }; });
}

} // namespace semrover
