// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/generation.h"

#include "engine/job/region_store.h"
#include "runtime/base/hash.h"
#include "runtime/device/profile.h"
#include "tools/cli/open_device.h"
#include "tools/cli/progress.h"
#include "tools/cli/version.h"

#include <chrono>
#include <CLI/CLI.hpp>

namespace semrover {

namespace {

double seconds_since(std::chrono::steady_clock::time_point begin)
{
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

// seconds of one step of a full batch, measured
Result<double> measure_step(Device& device, const Transformer& transformer, const GenerationSettings& s, uint32_t batch,
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
        best = std::min(best, seconds_since(begin) / 2);
    }
    return best;
}

} // namespace

Status Generation::resolve()
{
    const GenerationOptions& o = options_;
    GenerationSettings& s = settings_;
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
    s.repaint.known = d.repaint.known;
    if (!o.known.empty())
        s.repaint.known = o.known == "clean" ? KnownTokens::clean : KnownTokens::noised;
    s.regions = d.regions;
    s.regions.region_size = o.region_size.value_or(d.regions.region_size);
    s.regions.coverage_threshold =
        std::min(o.coverage_threshold.value_or(d.regions.coverage_threshold), s.regions.region_size);
    s.regions.strategy = o.strategy == "paper" ? RegionStrategy::paper : RegionStrategy::complete;
    s.regions.first_seed = o.first_cell;
    s.precision = o.precision == "fp32" ? DType::f32 : DType::f16;
    SR_TRY(s.plan, plan_sampling(s.model.scheduler, s.steps, s.repaint));
    return {};
}

Status Generation::open()
{
    SR_TRY(device_, open_device(globals_));
    if (!options_.profile.empty())
        device_->set_profile(std::make_shared<Profile>());
    return {};
}

Status Generation::begin(VoxelGrid& grid, const RegionOptions& regions)
{
    outpainter_.reset();
    SR_TRY(outpainter_, Outpainter::create(grid, settings_.model.config, regions));
    return {};
}

Status Generation::load(uint64_t seed)
{
    if (!transformer_) {
        for (const std::string& warning : settings_.model.warnings)
            if (!globals_.quiet)
                fmt::print(stderr, "semrover: warning: {}\n", warning);
        SR_TRY(transformer_, Transformer::load(*device_, settings_.model.transformer, settings_.precision));
    }
    if (!sampler_ || seed_ != seed) {
        sampler_.reset(); // its memory goes before the next one's comes
        const SamplerOptions sampling = sampling_options(settings_.guidance, seed);
        SR_TRY(sampler_, TokenSampler::create(*device_, *transformer_, settings_.plan, sampling));
        seed_ = seed;
        base_bytes_ = device_->allocated_bytes() - sampler_->table_bytes();
    }
    return fit_batch();
}

uint32_t Generation::wanted_batch() const
{
    if (options_.batch)
        return options_.batch;
    return device_->limits().type == DeviceType::cpu ? 2 : 16; // GPUs want more rows at once; not measured
}

Result<uint64_t> Generation::bytes_of(uint32_t batch, uint32_t cells) const
{
    uint64_t bytes = sampler_->table_bytes();
    if (batch) {
        SR_TRY(bytes, sampler_->planned_bytes(batch, cells));
    }
    return base_bytes_ + bytes;
}

// The batch is the wanted one, or the largest that fits the budget; the plan is for the batch that dependencies between
// regions really allow, so that the planned memory is the memory used.
Status Generation::fit_batch()
{
    const uint32_t cells = outpainter_->largest_region();
    for (batch_ = wanted_batch();; --batch_) {
        widest_batch_ = outpainter_->widest_batch(batch_);
        SR_TRY(planned_bytes_, bytes_of(widest_batch_, cells));
        if (!device_->budget() || planned_bytes_ <= device_->budget())
            return {};
        if (batch_ == 1)
            return fail(ErrorCode::out_of_memory, "one region of {} cells needs {} in all, --max-vram allows {}", cells,
                        bytes_text(planned_bytes_), bytes_text(device_->budget()));
    }
}

Result<uint64_t> Generation::bound_bytes() const
{
    for (uint32_t batch = wanted_batch();; --batch) {
        SR_TRY(const uint64_t bytes, bytes_of(batch, uint32_t(settings_.regions.region_size)));
        if (!device_->budget() || bytes <= device_->budget() || batch == 1)
            return bytes;
    }
}

Status Generation::fill(RunFolder& run, std::string_view output)
{
    size_t restored = 0;
    for (const RegionResult& region : load_regions(run)) {
        SR_CHECK(outpainter_->restore(region));
        restored += region.targets.size();
    }
    if (restored)
        SR_CHECK(fit_batch()); // what is left may come in smaller batches
    const auto begin = std::chrono::steady_clock::now();
    Progress progress(progress_to_stderr(globals_), "generate", "cells", outpainter_->cells_to_do(), restored);
    OutpaintCallbacks callbacks;
    callbacks.finished = [&](const RegionResult& r) { return save_region(run, r); };
    callbacks.progress = [&](size_t done, double) {
        progress.update(std::max(done, restored), device_->allocated_bytes());
        return !interrupt_requested();
    };
    const Status status = outpainter_->run(*sampler_, batch_, callbacks);
    if (!status && status.error().code == ErrorCode::interrupted)
        return fail(ErrorCode::interrupted, "interrupted; what is done is in '{}.run', the same command goes on",
                    output);
    SR_CHECK(status);
    progress.update(outpainter_->cells_to_do());
    progress.finish();
    seconds_ = seconds_since(begin);
    peak_bytes_ = device_->peak_bytes();
    return {};
}

Status Generation::fill(const std::function<bool(size_t cells)>& progress)
{
    const auto begin = std::chrono::steady_clock::now();
    OutpaintCallbacks callbacks;
    callbacks.progress = [&](size_t done, double) { return progress(done); };
    SR_CHECK(outpainter_->run(*sampler_, batch_, callbacks));
    seconds_ = seconds_since(begin);
    peak_bytes_ = device_->peak_bytes();
    return {};
}

Status Generation::report_dry_run(size_t runs)
{
    const uint32_t batch = std::max(widest_batch_, 1u);
    sampler_.reset(); // it has made its plan, and the measurement's own must fit the budget
    SR_TRY(const double step,
           measure_step(*device_, *transformer_, settings_, batch, std::max(outpainter_->largest_region(), 1u)));
    const size_t regions = outpainter_->region_count(), evaluations = settings_.plan.evaluations;
    const double seconds = step * double(evaluations) * double(regions) * double(runs) / batch;
    Json report{{"regions", regions},       {"cells", outpainter_->cells_to_do()}, {"batch", batch},
                {"steps", evaluations},     {"peak_device_bytes", planned_bytes_}, {"seconds", seconds},
                {"device", device_->name()}};
    if (runs > 1)
        report["seeds"] = runs;
    if (globals_.json)
        fmt::print("{}\n", report.dump());
    else
        fmt::print(
            "{} cells in {} regions, {} at a time, {} network steps each\npeak device memory {}\nabout {} on {}\n",
            outpainter_->cells_to_do(), regions, batch, evaluations, bytes_text(planned_bytes_), duration_text(seconds),
            device_->name());
    return {};
}

Result<Json> Generation::settings_json(std::string_view command, uint64_t grid_hash) const
{
    const GenerationSettings& s = settings_;
    SR_TRY(const uint64_t model_hash, hash_folder(s.model.transformer));
    return Json{{"command", std::string(command)},
                {"version", kVersion},
                {"device", device_->name()},
                {"driver", device_->driver()},
                {"grid", hash_text(grid_hash)},
                {"model", hash_text(model_hash)},
                {"precision", options_.precision},
                {"sampler", std::string(sampler_name(s.model.scheduler.sampler))},
                {"steps", s.steps},
                {"guidance_scale", s.guidance},
                {"region_size", s.regions.region_size},
                {"coverage_threshold", s.regions.coverage_threshold},
                {"strategy", options_.strategy},
                {"first_cell", options_.first_cell},
                {"jump_length", s.repaint.jump_length},
                {"jump_n_sample", s.repaint.jump_n_sample},
                {"known_tokens", s.repaint.known == KnownTokens::clean ? "clean" : "noised"}};
}

Json Generation::results_json() const
{
    return {{"cells", outpainter_->cells_to_do()},
            {"regions", outpainter_->region_count()},
            {"seconds", seconds_},
            {"planned_device_bytes", planned_bytes_},
            {"peak_device_bytes", peak_bytes_}};
}

Status Generation::write_profile() const
{
    if (!device_->profile())
        return {};
    SR_CHECK(device_->profile()->write(options_.profile));
    if (globals_.verbose)
        fmt::print(stderr, "{}", device_->profile()->summary());
    return {};
}

Status check_writable(const Path& path, const Globals& globals)
{
    if (std::filesystem::exists(path) && !globals.yes)
        return fail(ErrorCode::usage, "'{}' exists; -y replaces it", path.string());
    return AtomicFile::create(path).map([](const AtomicFile&) {});
}

void add_generation_options(CLI::App& c, GenerationOptions& o)
{
    c.add_option("--steps", o.steps, "denoising steps");
    c.add_option("--cfg-scale", o.cfg_scale, "guidance towards the labels; 1: none");
    c.add_option("--sampler", o.sampler, "ddpm, ddim or dpm++2m");
    c.add_option("--preset", o.preset, "fast (20 steps), standard (50, RePaint 5/2), paper (250, RePaint 10/10, DDPM)");
    c.add_option("--jump-length", o.jump_length, "RePaint: steps of a jump back");
    c.add_option("--jump-n-sample", o.jump_n_sample, "RePaint: passes over each jump");
    c.add_option("--known-tokens", o.known, "how the network sees cells that are there: as the model says, or")
        ->check(CLI::IsMember({"noised", "clean"}));
    c.add_option("--batch", o.batch, "regions at a time; any value gives the same bytes")->check(CLI::Range(1u, 1024u));
    c.add_option("--region-size", o.region_size, "cells of a region");
    c.add_option("--coverage-threshold", o.coverage_threshold, "new cells that a region must have");
    c.add_option("--precision", o.precision, "storage of weights and activations")
        ->check(CLI::IsMember({"fp16", "fp32"}));
    c.add_option("--profile", o.profile, "write device times as a Chrome trace");
    c.add_flag("--dry-run", o.dry_run, "only say how many regions, how much memory, how long");
}

} // namespace semrover
