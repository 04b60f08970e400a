// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/world/grid_filling.h"

#include "engine/voxfield/sub_grid.h"
#include "engine/voxfield/tile_regions.h"
#include "engine/voxfield/token_codec.h"
#include "runtime/base/bytes_text.h"

#include <algorithm>
#include <chrono>

namespace semrover {

Status GridFilling::check(const VoxelGrid& grid) const
{
    const TransformerConfig& config = settings_.model.config;
    if (std::abs(grid.voxel_size - config.voxel_size) > 1e-4f * config.voxel_size)
        return fail(ErrorCode::bad_input, "the grid has voxels of {} m, the model was trained on {} m", grid.voxel_size,
                    config.voxel_size);
    for (size_t i = 0; i < grid.labels.size(); ++i)
        if (grid.labels[i] >= config.num_classes)
            return fail(ErrorCode::bad_input, "voxel {} has label {}, the model knows {} classes", i, grid.labels[i],
                        config.num_classes);
    if (grid.has_points() && grid.points_per_voxel != int(config.points_per_voxel))
        return fail(ErrorCode::bad_input, "the grid has {} points a voxel, the model makes {}", grid.points_per_voxel,
                    config.points_per_voxel);
    return {};
}

Status GridFilling::cut(VoxelGrid& grid, const RegionOptions& options, std::span<const SceneObject> objects)
{
    SR_CHECK(cancel());
    work_.reset();
    seconds_ = 0;
    const TransformerConfig& config = settings_.model.config;
    SR_CHECK(check(grid));
    make_room_for_points(grid, int(config.points_per_voxel));
    SR_TRY(Regions regions, options.tile_cells ? extract_tile_regions(grid.cells, options, grid.generated)
                                               : extract_regions(grid.cells, options, grid.generated));
    auto work = std::make_unique<Work>(grid, std::move(regions));
    work->restored.resize(work->regions.size());
    for (uint32_t r = 0; r < work->regions.size(); ++r) {
        const size_t cells = work->regions.region(r).size(), targets = work->graph.targets(r).size();
        work->cells_to_do += targets;
        work->cells_to_compute += targets ? cells : 0;
        work->largest = std::max(work->largest, uint32_t(cells));
    }
    SR_TRY(work->conditions, VoxelConditions::create(config, grid, objects));
    work_ = std::move(work);
    return {};
}

Status GridFilling::load(uint64_t seed, const JobCallbacks& callbacks)
{
    if (!sampler_)
        for (const std::string& warning : settings_.model.warnings)
            if (callbacks.warning)
                callbacks.warning(warning);
    if (!transformer_) {
        SR_TRY(transformer_,
               Transformer::load(device_, settings_.model.transformer, settings_.precision, settings_.model.adapter));
    }
    if (!sampler_ || seed_ != seed) {
        sampler_.reset(); // its memory goes before the next one's comes
        SR_TRY(sampler_, TokenSampler::create(device_, *transformer_, settings_.plan, {settings_.guidance, seed}));
        seed_ = seed;
        base_bytes_ = device_.allocated_bytes() - sampler_->table_bytes();
    }
    return fit_batch();
}

uint32_t GridFilling::wanted_batch() const
{
    if (settings_.batch)
        return settings_.batch;
    return device_.limits().type == DeviceType::cpu ? 2 : 16; // GPUs want more rows at once; not measured
}

Result<uint64_t> GridFilling::bytes_of(uint32_t batch, uint32_t cells) const
{
    uint64_t bytes = sampler_->table_bytes();
    if (batch) {
        SR_TRY(bytes, sampler_->planned_bytes(batch, cells));
    }
    return base_bytes_ + bytes;
}

// regions of the largest batch that will be made with this limit: dependencies may keep batches smaller. 0 when every
// region is restored.
uint32_t GridFilling::widest_batch(uint32_t limit) const
{
    RegionGraph graph = work_->graph;
    uint32_t widest = 0;
    while (!graph.finished()) {
        uint32_t fresh = 0;
        for (const uint32_t region : graph.take(limit)) {
            fresh += !work_->restored[region];
            graph.done(region);
        }
        widest = std::max(widest, fresh);
    }
    return widest;
}

// The batch is the wanted one, or the largest that fits the budget; the plan is for the batch that dependencies between
// regions really allow, so that the planned memory is the memory used.
Status GridFilling::fit_batch()
{
    for (batch_ = wanted_batch();; --batch_) {
        widest_batch_ = widest_batch(batch_);
        SR_TRY(planned_bytes_, bytes_of(widest_batch_, work_->largest));
        if (!device_.budget() || planned_bytes_ <= device_.budget())
            return {};
        if (batch_ == 1)
            return fail(ErrorCode::out_of_memory, "one region of {} voxels needs {} in all, `max_bytes` allows {}",
                        work_->largest, bytes_text(planned_bytes_), bytes_text(device_.budget()));
    }
}

Result<uint64_t> GridFilling::bound_bytes() const
{
    for (uint32_t batch = wanted_batch();; --batch) {
        SR_TRY(const uint64_t bytes, bytes_of(batch, uint32_t(settings_.regions.region_size)));
        if (!device_.budget() || bytes <= device_.budget() || batch == 1)
            return bytes;
    }
}

Status GridFilling::start(RunFolder* run)
{
    run_ = run;
    if (!run)
        return {};
    for (const RegionResult& region : load_regions(*run))
        SR_CHECK(restore(region));
    return work_->cells_restored ? fit_batch() : Status(); // what is left may come in smaller batches
}

// a region that an earlier run finished; its targets must be those of this run
Status GridFilling::restore(const RegionResult& r)
{
    Work& w = *work_;
    const size_t width = size_t(w.grid.points_per_voxel) * 3;
    if (r.region >= w.regions.size())
        return fail(ErrorCode::bad_input, "saved region {} of {}", r.region, w.regions.size());
    if (!std::ranges::equal(w.graph.targets(r.region), r.targets) || r.points.size() != r.targets.size() * width ||
        r.colors.size() != r.points.size())
        return fail(ErrorCode::bad_input, "saved region {} does not belong to this run", r.region);
    if (w.restored[r.region])
        return {};
    for (size_t i = 0; i < r.targets.size(); ++i) {
        std::copy_n(&r.points[i * width], width, &w.grid.points[r.targets[i] * width]);
        std::copy_n(&r.colors[i * width], width, &w.grid.colors[r.targets[i] * width]);
        w.grid.generated[r.targets[i]] = 1;
    }
    w.restored[r.region] = 1;
    w.cells_restored += r.targets.size();
    w.cells_done += r.targets.size();
    return {};
}

RegionInput GridFilling::input(uint32_t region) const
{
    const Work& w = *work_;
    const TransformerConfig& config = settings_.model.config;
    const size_t n = config.points_per_voxel, channels = config.channels();
    const auto members = w.regions.region(region);
    RegionInput in;
    in.fixed.resize(members.size() * channels);
    const size_t width = w.conditions.empty() ? 0 : w.conditions.width();
    in.condition.resize(members.size() * width);
    for (size_t i = 0; i < members.size(); ++i) {
        const uint32_t cell = members[i];
        in.cells.push_back(w.grid.cells[cell]);
        in.labels.push_back(w.grid.labels[cell]);
        in.known.push_back(!w.graph.is_target(region, cell));
        if (width)
            w.conditions.row(cell, w.grid.cells[cell], std::span(in.condition).subspan(i * width, width));
        if (in.known.back())
            encode_token(config, std::span(w.grid.points).subspan(cell * n * 3, n * 3),
                         std::span(w.grid.colors).subspan(cell * n * 3, n * 3),
                         std::span(in.fixed).subspan(i * channels, channels));
    }
    return in;
}

// empty: the grid is filled
std::vector<RegionInput> GridFilling::next_batch()
{
    Work& w = *work_;
    while (w.flight.empty() && !w.graph.finished())
        for (const uint32_t region : w.graph.take(batch_))
            if (w.restored[region])
                w.graph.done(region);
            else
                w.flight.push_back(region);
    std::vector<RegionInput> inputs;
    for (const uint32_t region : w.flight)
        inputs.push_back(input(region));
    return inputs;
}

RegionResult GridFilling::result(uint32_t region) const
{
    const Work& w = *work_;
    const size_t width = size_t(w.grid.points_per_voxel) * 3;
    RegionResult r;
    r.region = region;
    for (const uint32_t cell : w.graph.targets(region)) {
        r.targets.push_back(cell);
        r.points.insert(r.points.end(), &w.grid.points[cell * width], &w.grid.points[cell * width] + width);
        r.colors.insert(r.colors.end(), &w.grid.colors[cell * width], &w.grid.colors[cell * width] + width);
    }
    return r;
}

// finished regions are saved before those that depend on them start
Status GridFilling::end_batch()
{
    Work& w = *work_;
    const size_t width = size_t(settings_.model.config.points_per_voxel) * 3;
    SR_TRY(const std::vector<uint32_t> words, sampler_->finish_points());
    std::span<const uint32_t> rest = words;
    for (const uint32_t region : std::exchange(w.flight, {})) {
        for (const uint32_t cell : w.regions.region(region)) {
            if (w.graph.is_target(region, cell))
                unpack_points(rest.first(width), std::span(w.grid.points).subspan(cell * width, width),
                              std::span(w.grid.colors).subspan(cell * width, width));
            rest = rest.subspan(width);
        }
        if (run_)
            SR_CHECK(save_region(*run_, result(region)));
        for (const uint32_t cell : w.graph.targets(region))
            w.grid.generated[cell] = 1;
        w.cells_done += w.graph.targets(region).size();
        w.graph.done(region);
    }
    return {};
}

Result<bool> GridFilling::step(const JobBudget& budget, const std::function<void()>& submitted)
{
    BudgetMeter meter(budget, cost_);
    do {
        if (begins_batch()) {
            const std::vector<RegionInput> regions = next_batch();
            if (regions.empty())
                break;
            SR_CHECK(sampler_->begin(regions));
        }
        SR_TRY(const bool complete, sampler_->step(1));
        if (complete)
            SR_CHECK(end_batch());
        if (budget.timed())
            SR_CHECK(device_.wait(device_.last_ticket()));
        meter.submitted();
        if (submitted)
            submitted();
    } while (!work_->graph.finished() && meter.room());
    seconds_ += meter.elapsed() / 1e6;
    peak_bytes_ = device_.peak_bytes();
    return work_->graph.finished();
}

Status GridFilling::cancel()
{
    if (!work_)
        return {};
    for (const uint32_t region : std::exchange(work_->flight, {}))
        work_->graph.give_back(region);
    return sampler_ ? sampler_->cancel() : Status();
}

// seconds of one step of a full batch
Result<double> GridFilling::measure_step(uint32_t batch, uint32_t cells) const
{
    SR_TRY(const SamplingPlan plan, plan_sampling(settings_.model.scheduler, 2));
    SR_TRY(const auto sampler, TokenSampler::create(device_, *transformer_, plan, {settings_.guidance, 0}));
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

Result<Json> GridFilling::estimate(size_t runs)
{
    const uint32_t batch = std::max(widest_batch_, 1u);
    sampler_.reset(); // it has made its plan, and the measurement's own must fit the budget
    SR_TRY(const double step, measure_step(batch, std::max(work_->largest, 1u)));
    const size_t regions = region_count(), evaluations = settings_.plan.evaluations;
    Json report{{"regions", regions},
                {"cells", work_->cells_to_do},
                {"batch", batch},
                {"steps", evaluations},
                {"peak_device_bytes", planned_bytes_},
                {"seconds", step * double(evaluations) * double(regions) * double(runs) / batch},
                {"device", device_.name()}};
    if (runs > 1)
        report["seeds"] = runs;
    return report;
}

Json GridFilling::results() const
{
    return {{"cells", work_->cells_to_do},
            {"regions", region_count()},
            {"cells_computed", work_->cells_to_compute},
            {"seconds", seconds_},
            {"planned_device_bytes", planned_bytes_},
            {"peak_device_bytes", peak_bytes_}};
}

void GridFilling::say(const JobCallbacks& callbacks, bool ended) const
{
    if (!callbacks.progress)
        return;
    JobProgress p{.stage = "generate", .unit = "cells"};
    p.done = work_->cells_done;
    p.total = work_->cells_to_do;
    p.done_before = work_->cells_restored;
    p.part = begins_batch() ? 0 : double(sampler_->rows_done()) / double(sampler_->rows());
    p.device_bytes = ended ? 0 : device_.allocated_bytes();
    p.ended = ended;
    callbacks.progress(p);
}

} // namespace semrover
