// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover generate GRID -m MODEL -o OUT.sgrid: fills a semantic grid with points, region by region
#include "engine/voxfield/region_store.h"
#include "engine/voxfield/voxfield_model.h"
#include "runtime/hash.h"
#include "runtime/profile.h"
#include "tools/commands.h"
#include "tools/export_ply.h"
#include "tools/open_device.h"
#include "tools/progress.h"
#include "tools/scene_input.h"
#include "tools/version.h"

#include <chrono>
#include <CLI/CLI.hpp>
#include <optional>

namespace semrover {

namespace {

struct Options {
    std::string grid, model, output, sampler, preset, strategy = "complete", precision = "fp16", profile;
    std::optional<int> steps, region_size, coverage_threshold, jump_length, jump_n_sample;
    std::optional<float> cfg_scale;
    uint64_t seed = 0;
    uint32_t batch = 0;
    int64_t first_cell = 0;
    PlyExports ply;
    SceneInputOptions input;
    bool dry_run = false;
};

// options over the preset over the model's defaults
struct Settings {
    VoxfieldModel model;
    SamplingPlan plan;
    int steps = 0;
    float guidance = 0;
    RegionOptions regions;
    RepaintOptions repaint;
    DType precision = DType::f16;
};

Result<Settings> resolve(const Options& o)
{
    Settings s;
    std::optional<Sampler> sampler;
    RepaintPreset preset;
    if (!o.preset.empty()) {
        SR_TRY(preset, repaint_preset(o.preset));
        sampler = preset.sampler;
    }
    if (!o.sampler.empty()) {
        SR_TRY(sampler, sampler_from_name(o.sampler));
    }
    SR_TRY(s.model, VoxfieldModel::open(o.model, sampler));
    const VoxfieldDefaults& d = s.model.defaults;
    s.steps = o.steps.value_or(preset.steps ? preset.steps : d.num_inference_steps);
    s.guidance = o.cfg_scale.value_or(d.guidance_scale);
    s.repaint = preset.steps ? preset.repaint : d.repaint;
    s.repaint.jump_length = o.jump_length.value_or(s.repaint.jump_length);
    s.repaint.jump_n_sample = o.jump_n_sample.value_or(s.repaint.jump_n_sample);
    s.regions = d.regions;
    s.regions.region_size = o.region_size.value_or(d.regions.region_size);
    s.regions.coverage_threshold =
        std::min(o.coverage_threshold.value_or(d.regions.coverage_threshold), s.regions.region_size);
    s.regions.strategy = o.strategy == "paper" ? RegionStrategy::paper : RegionStrategy::complete;
    s.regions.first_seed = o.first_cell;
    s.precision = o.precision == "fp32" ? DType::f32 : DType::f16;
    SR_TRY(s.plan, plan_sampling(s.model.scheduler, s.steps, s.repaint));
    return s;
}

// everything that decides the bytes of the result
// of the file, or of what another program's file became: that depends on options and on other files
Result<uint64_t> hash_grid(const Options& o, const VoxelGrid& grid)
{
    if (o.input.from.empty() && Path(o.grid).extension() == ".sgrid")
        return hash_file(o.grid);
    Hash hash;
    hash.add(fmt::format("{}", grid.voxel_size));
    hash.add(std::as_bytes(std::span(grid.cells)));
    hash.add(std::as_bytes(std::span(grid.labels)));
    hash.add(std::as_bytes(std::span(grid.points)));
    hash.add(std::as_bytes(std::span(grid.colors)));
    hash.add(std::as_bytes(std::span(grid.generated)));
    return hash.value();
}

Result<Json> settings_json(const Options& o, const VoxelGrid& grid, const Settings& s, const Device& device)
{
    SR_TRY(const uint64_t grid_hash, hash_grid(o, grid));
    SR_TRY(const uint64_t model_hash, hash_folder(s.model.transformer));
    return Json{{"command", "generate"},
                {"version", kVersion},
                {"device", device.name()},
                {"driver", device.driver()},
                {"grid", hash_text(grid_hash)},
                {"model", hash_text(model_hash)},
                {"precision", o.precision},
                {"sampler", std::string(sampler_name(s.model.scheduler.sampler))},
                {"steps", s.steps},
                {"guidance_scale", s.guidance},
                {"seed", o.seed},
                {"region_size", s.regions.region_size},
                {"coverage_threshold", s.regions.coverage_threshold},
                {"strategy", o.strategy},
                {"first_cell", o.first_cell},
                {"jump_length", s.repaint.jump_length},
                {"jump_n_sample", s.repaint.jump_n_sample}};
}

uint32_t choose_batch(const Options& o, const Device& device)
{
    if (o.batch)
        return o.batch;
    return device.limits().type == DeviceType::cpu ? 2 : 16; // research/performance.md §3.6
}

// seconds of one step of a full batch, measured
Result<double> measure_step(Device& device, const Transformer& transformer, const Settings& s, uint32_t batch,
                            uint32_t cells)
{
    SR_TRY(const SamplingPlan plan, plan_sampling(s.model.scheduler, 2));
    SR_TRY(const auto sampler, TokenSampler::create(device, transformer, plan, sampling_options(s.guidance, 0)));
    RegionInput region;
    for (uint32_t i = 0; i < cells; ++i)
        region.cells.push_back({int32_t(i % 12), int32_t(i / 12), 0});
    region.labels.assign(cells, 0);
    const std::vector<RegionInput> regions(batch, region);
    double best = 1e30;
    for (int repeat = 0; repeat < 2; ++repeat) {
        const auto begin = std::chrono::steady_clock::now();
        SR_CHECK(sampler->run(regions).map([](const auto&) {}));
        best = std::min(best, std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count() / 2);
    }
    return best;
}

struct Job {
    const Options& options;
    const Globals& globals;
    Settings settings;
    std::unique_ptr<Device> device;
    std::unique_ptr<Transformer> transformer;
    VoxelGrid grid;
    std::unique_ptr<Outpainter> outpainter;
    std::unique_ptr<TokenSampler> sampler;
    uint32_t batch = 1, widest_batch = 1;
    uint64_t planned_bytes = 0;
};

// The batch is the wanted one, or the largest that fits the budget; the plan is for the batch that dependencies between
// regions really allow, so that the planned memory is the memory used.
Status fit_batch(Job& j)
{
    const uint32_t cells = j.outpainter->largest_region();
    for (j.batch = choose_batch(j.options, *j.device);; --j.batch) {
        j.widest_batch = j.outpainter->widest_batch(j.batch);
        uint64_t bytes = j.sampler->table_bytes();
        if (j.widest_batch) {
            SR_TRY(bytes, j.sampler->planned_bytes(j.widest_batch, cells));
        }
        j.planned_bytes = j.device->allocated_bytes() - j.sampler->table_bytes() + bytes;
        if (!j.device->budget() || j.planned_bytes <= j.device->budget())
            return {};
        if (j.batch == 1)
            return fail(ErrorCode::out_of_memory, "one region of {} cells needs {} in all, --max-vram allows {}", cells,
                        bytes_text(j.planned_bytes), bytes_text(j.device->budget()));
    }
}

Status dry_run(Job& j)
{
    const uint32_t batch = std::max(j.widest_batch, 1u);
    j.sampler.reset(); // it has made its plan, and the measurement's own must fit the budget
    SR_TRY(const double step,
           measure_step(*j.device, *j.transformer, j.settings, batch, j.outpainter->largest_region()));
    const size_t regions = j.outpainter->region_count(), evaluations = j.settings.plan.evaluations;
    const double seconds = step * double(evaluations) * double(regions) / batch;
    const Json report{{"regions", regions},        {"cells", j.outpainter->cells_to_do()}, {"batch", batch},
                      {"steps", evaluations},      {"peak_device_bytes", j.planned_bytes}, {"seconds", seconds},
                      {"device", j.device->name()}};
    if (j.globals.json)
        fmt::print("{}\n", report.dump());
    else
        fmt::print(
            "{} cells in {} regions, {} at a time, {} network steps each\npeak device memory {}\nabout {} on {}\n",
            j.outpainter->cells_to_do(), regions, batch, evaluations, bytes_text(j.planned_bytes),
            duration_text(seconds), j.device->name());
    return {};
}

Status prepare(Job& j)
{
    SR_TRY(j.settings, resolve(j.options));
    SR_TRY(j.grid, load_grid(j.options.grid, j.options.input, j.globals));
    SR_TRY(j.device, open_device(j.globals));
    if (!j.options.profile.empty())
        j.device->set_profile(std::make_shared<Profile>());
    SR_TRY(j.outpainter, Outpainter::create(j.grid, j.settings.model.config, j.settings.regions));
    for (const std::string& warning : j.settings.model.warnings)
        if (!j.globals.quiet)
            fmt::print(stderr, "semrover: warning: {}\n", warning);
    SR_TRY(j.transformer, Transformer::load(*j.device, j.settings.model.transformer, j.settings.precision));
    const SamplerOptions sampling = sampling_options(j.settings.guidance, j.options.seed);
    SR_TRY(j.sampler, TokenSampler::create(*j.device, *j.transformer, j.settings.plan, sampling));
    return fit_batch(j);
}

Status finish(Job& j, RunFolder& run, const std::string& model_hash, double seconds)
{
    const uint64_t peak = j.device->peak_bytes(); // of the generation itself
    j.grid.metadata["seed"] = std::to_string(j.options.seed);
    j.grid.metadata["tool"] = kProgram;
    j.grid.metadata["model"] = model_hash;
    if (j.options.ply.any())
        SR_CHECK(export_ply(*j.device, j.grid, j.options.ply));
    SR_CHECK(write_grid(j.options.output, j.grid));
    SR_TRY(const uint64_t hash, hash_file(j.options.output));
    const Json results{{"output", Path(j.options.output).filename().string()},
                       {"xxh64", hash_text(hash)},
                       {"cells", j.outpainter->cells_to_do()},
                       {"regions", j.outpainter->region_count()},
                       {"seconds", seconds},
                       {"planned_device_bytes", j.planned_bytes},
                       {"peak_device_bytes", peak}};
    SR_CHECK(run.finish(results));
    if (j.device->profile())
        SR_CHECK(j.device->profile()->write(j.options.profile));
    if (j.device->profile() && j.globals.verbose)
        fmt::print(stderr, "{}", j.device->profile()->summary());
    if (j.globals.json)
        fmt::print("{}\n", results.dump());
    return {};
}

// what cannot be written is refused now, not after an hour
Status check_output(const Options& o, const Globals& globals)
{
    if (o.output.empty())
        return fail(ErrorCode::usage, "-o/--output is required");
    for (const std::string& path : {o.output, o.ply.points, o.ply.splats_3d, o.ply.splats_2d}) {
        if (path.empty())
            continue;
        if (std::filesystem::exists(path) && !globals.yes)
            return fail(ErrorCode::usage, "'{}' exists; -y replaces it", path);
        SR_CHECK(AtomicFile::create(path).map([](const AtomicFile&) {}));
    }
    return {};
}

Status generate(const Options& o, const Globals& globals)
{
    Job j{o, globals, {}, {}, {}, {}, {}, {}};
    if (!o.dry_run)
        SR_CHECK(check_output(o, globals));
    SR_CHECK(prepare(j));
    if (o.dry_run)
        return dry_run(j);
    SR_TRY(const Json settings, settings_json(o, j.grid, j.settings, *j.device));
    // -y starts over only what is finished: an interrupted run with these settings goes on
    SR_TRY(RunFolder run, open_run(o.output + ".run", settings, globals.yes));
    size_t restored = 0;
    for (const RegionResult& region : load_regions(run)) {
        SR_CHECK(j.outpainter->restore(region));
        restored += region.targets.size();
    }
    if (restored)
        SR_CHECK(fit_batch(j)); // what is left may come in smaller batches
    const auto begin = std::chrono::steady_clock::now();
    Progress progress(progress_to_stderr(globals), "generate", "cells", j.outpainter->cells_to_do(), restored);
    OutpaintCallbacks callbacks;
    callbacks.finished = [&](const RegionResult& r) { return save_region(run, r); };
    callbacks.progress = [&](size_t done, double) {
        progress.update(std::max(done, restored), j.device->allocated_bytes());
        return !interrupt_requested();
    };
    const Status status = j.outpainter->run(*j.sampler, j.batch, callbacks);
    if (!status && status.error().code == ErrorCode::interrupted)
        return fail(ErrorCode::interrupted, "interrupted; what is done is in '{}.run', the same command goes on",
                    o.output);
    SR_CHECK(status);
    progress.update(j.outpainter->cells_to_do());
    progress.finish();
    return finish(j, run, settings["model"],
                  std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
}

} // namespace

void add_generate(CLI::App& app, const Globals& globals, Run& run)
{
    auto o = std::make_shared<Options>();
    CLI::App* c = app.add_subcommand("generate", "semantic grid to coloured points, region by region");
    c->add_option("GRID", o->grid, ".sgrid, .npz, .label, .vox or .ply; cells that have points are kept as they are")
        ->required();
    add_scene_input_options(*c, o->input);
    c->add_option("-m,--model", o->model, "model folder")->required();
    c->add_option("-o,--output", o->output, ".sgrid to write; OUTPUT.run beside it keeps the run's state");
    c->add_option("-s,--seed", o->seed, "noise seed");
    c->add_option("--steps", o->steps, "denoising steps");
    c->add_option("--cfg-scale", o->cfg_scale, "guidance towards the labels; 1: none");
    c->add_option("--sampler", o->sampler, "ddpm, ddim or dpm++2m");
    c->add_option("--preset", o->preset,
                  "fast (20 steps), standard (50, RePaint 5/2), paper (250, RePaint 10/10, DDPM)");
    c->add_option("--jump-length", o->jump_length, "RePaint: steps of a jump back");
    c->add_option("--jump-n-sample", o->jump_n_sample, "RePaint: passes over each jump");
    c->add_option("--batch", o->batch, "regions at a time; any value gives the same bytes")
        ->check(CLI::Range(1u, 1024u));
    c->add_option("--region-size", o->region_size, "cells of a region");
    c->add_option("--coverage-threshold", o->coverage_threshold, "new cells that a region must have");
    c->add_option("--strategy", o->strategy, "complete, or paper (Algorithm 1 as printed: may leave cells empty)")
        ->check(CLI::IsMember({"complete", "paper"}));
    c->add_option("--first-cell", o->first_cell, "index of the cell to start from");
    c->add_option("--precision", o->precision, "storage of weights and activations")
        ->check(CLI::IsMember({"fp16", "fp32"}));
    c->add_option("--ply", o->ply.points, "also write the points with colour and label as PLY");
    c->add_option("--ply-3dgs", o->ply.splats_3d, "also write the splats as a 3DGS PLY");
    c->add_option("--ply-2dgs", o->ply.splats_2d, "also write the splats as a 2DGS PLY");
    c->add_option("--profile", o->profile, "write device times as a Chrome trace");
    c->add_flag("--dry-run", o->dry_run, "only say how many regions, how much memory, how long");
    c->callback([o, &globals, &run] { run = [o, &globals] { return generate(*o, globals); }; });
}

} // namespace semrover
