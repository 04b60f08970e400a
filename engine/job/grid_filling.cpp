// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/grid_filling.h"

#include "engine/job/region_store.h"
#include "runtime/base/bytes_text.h"

#include <chrono>

namespace semrover {

Status GridFilling::cut(VoxelGrid& grid, const RegionOptions& regions, std::span<const SceneObject> objects)
{
    outpainter_.reset();
    seconds_ = 0;
    restored_ = 0;
    SR_TRY(outpainter_, Outpainter::create(grid, settings_.model.config, regions));
    SR_TRY(CellConditions conditions, CellConditions::create(settings_.model.config, grid, objects));
    outpainter_->tell(std::move(conditions));
    return {};
}

Status GridFilling::load(uint64_t seed, const JobCallbacks& callbacks)
{
    if (!sampler_)
        for (const std::string& warning : settings_.model.warnings)
            if (callbacks.warning)
                callbacks.warning(warning);
    if (!transformer_) {
        SR_TRY(transformer_, Transformer::load(device_, settings_.model.transformer, settings_.precision));
    }
    if (!sampler_ || seed_ != seed) {
        sampler_.reset(); // its memory goes before the next one's comes
        const SamplerOptions sampling = sampling_options(settings_.guidance, seed);
        SR_TRY(sampler_, TokenSampler::create(device_, *transformer_, settings_.plan, sampling));
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

// The batch is the wanted one, or the largest that fits the budget; the plan is for the batch that dependencies between
// regions really allow, so that the planned memory is the memory used.
Status GridFilling::fit_batch()
{
    const uint32_t cells = outpainter_->largest_region();
    for (batch_ = wanted_batch();; --batch_) {
        widest_batch_ = outpainter_->widest_batch(batch_);
        SR_TRY(planned_bytes_, bytes_of(widest_batch_, cells));
        if (!device_.budget() || planned_bytes_ <= device_.budget())
            return {};
        if (batch_ == 1)
            return fail(ErrorCode::out_of_memory, "one region of {} cells needs {} in all, --max-vram allows {}", cells,
                        bytes_text(planned_bytes_), bytes_text(device_.budget()));
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
    if (!run) {
        outpainter_->begin(*sampler_, batch_);
        return {};
    }
    for (const RegionResult& region : load_regions(*run)) {
        SR_CHECK(outpainter_->restore(region));
        restored_ += region.targets.size();
    }
    if (restored_)
        SR_CHECK(fit_batch()); // what is left may come in smaller batches
    outpainter_->begin(*sampler_, batch_, [run](const RegionResult& r) { return save_region(*run, r); });
    return {};
}

Result<bool> GridFilling::step(const JobBudget& budget, const std::function<void()>& submitted)
{
    BudgetMeter meter(budget, cost_);
    bool filled = false;
    do {
        SR_TRY(filled, outpainter_->step(1));
        if (budget.timed())
            SR_CHECK(device_.wait(device_.last_ticket()));
        meter.submitted();
        if (submitted)
            submitted();
    } while (!filled && meter.room());
    seconds_ += meter.elapsed() / 1e6;
    peak_bytes_ = device_.peak_bytes();
    return filled;
}

Status GridFilling::cancel()
{
    return outpainter_ ? outpainter_->cancel() : Status();
}

// seconds of one step of a full batch
Result<double> GridFilling::measure_step(uint32_t batch, uint32_t cells) const
{
    SR_TRY(const SamplingPlan plan, plan_sampling(settings_.model.scheduler, 2));
    SR_TRY(const auto sampler,
           TokenSampler::create(device_, *transformer_, plan, sampling_options(settings_.guidance, 0)));
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
    SR_TRY(const double step, measure_step(batch, std::max(outpainter_->largest_region(), 1u)));
    const size_t regions = outpainter_->region_count(), evaluations = settings_.plan.evaluations;
    Json report{{"regions", regions},
                {"cells", outpainter_->cells_to_do()},
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
    return {{"cells", outpainter_->cells_to_do()},
            {"regions", outpainter_->region_count()},
            {"cells_computed", outpainter_->cells_to_compute()},
            {"seconds", seconds_},
            {"planned_device_bytes", planned_bytes_},
            {"peak_device_bytes", peak_bytes_}};
}

void GridFilling::say(const JobCallbacks& callbacks, bool ended) const
{
    if (!callbacks.progress)
        return;
    JobProgress p{.stage = "generate", .unit = "cells"};
    p.done = std::max(outpainter_->cells_done(), restored_);
    p.total = outpainter_->cells_to_do();
    p.done_before = restored_;
    p.part = outpainter_->part();
    p.device_bytes = ended ? 0 : device_.allocated_bytes();
    p.ended = ended;
    callbacks.progress(p);
}

} // namespace semrover
