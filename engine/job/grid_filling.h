// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/budget_meter.h"
#include "engine/job/generation_settings.h"
#include "engine/job/run_folder.h"
#include "engine/voxfield/outpaint.h"

namespace semrover {

// What the jobs that generate share: fills grids with points on a device, region by region. In order, for each grid or
// seed: cut, load, start, then step until it says true.
class GridFilling {
  public:
    // settings: outlive the filling. transformer: of their model; none: loaded when it is wanted
    GridFilling(Device& device, const GenerationSettings& settings, std::shared_ptr<const Transformer> transformer = {})
        : device_(device), settings_(settings), transformer_(std::move(transformer))
    {
    }

    // cuts the grid, which must outlive the filling, into regions; cells with generated = 0 are the targets
    // and are made with what `objects` say of them, if the model can be told
    Status cut(VoxelGrid& grid, const RegionOptions& regions, std::span<const SceneObject> objects = {});
    // Weights if they are not there yet, a sampler if the seed is another, and the batch that fits the device's budget.
    // Errors: out_of_memory when not even one region does
    Status load(uint64_t seed, const JobCallbacks& callbacks);
    // Takes over what `run` holds already; every region that is finished is saved there. null: nothing is kept.
    Status start(RunFolder* run);

    // true: the grid is filled. `submitted` is called after each submit.
    Result<bool> step(const JobBudget& budget, const std::function<void()>& submitted = {});
    Status cancel();

    // Measures a step and says what `runs` such fillings would take: regions, cells, batch, steps, peak_device_bytes,
    // seconds, device. Instead of start().
    Result<Json> estimate(size_t runs = 1);
    // device memory for full batches of full regions: what any grid may take. Needs load.
    Result<uint64_t> bound_bytes() const;

    // cells, regions, seconds and memory of the last filling
    Json results() const;
    // how many cells are done, in the stage "generate"
    void say(const JobCallbacks& callbacks, bool ended = false) const;
    const Outpainter& outpainter() const { return *outpainter_; }
    Device& device() const { return device_; }

  private:
    Status fit_batch();
    uint32_t wanted_batch() const;
    Result<uint64_t> bytes_of(uint32_t batch, uint32_t cells) const;
    Result<double> measure_step(uint32_t batch, uint32_t cells) const;

    Device& device_;
    const GenerationSettings& settings_;
    std::shared_ptr<const Transformer> transformer_;
    std::unique_ptr<TokenSampler> sampler_;
    std::unique_ptr<Outpainter> outpainter_;
    std::optional<uint64_t> seed_;
    uint32_t batch_ = 1, widest_batch_ = 1;
    uint64_t base_bytes_ = 0; // of what is there before the sampler's tables and batches
    uint64_t planned_bytes_ = 0, peak_bytes_ = 0;
    size_t restored_ = 0; // cells
    SubmitCost cost_;
    double seconds_ = 0;
};

} // namespace semrover
