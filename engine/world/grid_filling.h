// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/conditioning/voxel_conditions.h"
#include "engine/job/budget_meter.h"
#include "engine/voxfield/region_graph.h"
#include "engine/world/generation_settings.h"
#include "engine/world/region_store.h"

namespace semrover {

// Fills grids with points on a device, in batches of regions that are ready (docs/method.md §4): voxels with
// generated = 1 are known and never change. In order, for each grid or seed: cut, load, start, then step until it says
// true.
class GridFilling {
  public:
    // settings: outlive the filling. transformer: of their model; none: loaded when it is wanted
    GridFilling(Device& device, const GenerationSettings& settings, std::shared_ptr<const Transformer> transformer = {})
        : device_(device), settings_(settings), transformer_(std::move(transformer))
    {
    }
    ~GridFilling() { (void)cancel(); } // the device does not go on with what nobody waits for

    // Cuts the grid, which must outlive the filling, into regions, and makes room for points in it. Voxels with
    // generated = 0 are the targets; `objects` condition them, if the model can be conditioned on objects.
    // Errors: bad_input, for a grid that does not go with the model
    Status cut(VoxelGrid& grid, const RegionOptions& regions, std::span<const SceneObject> objects = {});
    // Weights if they are not there yet, a sampler if the seed is another, and the batch that fits the device's budget.
    // Errors: out_of_memory when not even one region does
    Status load(uint64_t seed, const JobCallbacks& callbacks);
    // Takes over what `run` holds already; every region that is finished is saved there. null: nothing is kept.
    Status start(RunFolder* run);

    // true: the grid is filled. `submitted` is called after each submit. Errors: as TokenSampler; of the run folder
    Result<bool> step(const JobBudget& budget, const std::function<void()>& submitted = {});
    // gives up the batch in flight; the grid keeps what is finished, and start() may follow
    Status cancel();
    // what the next submit does beside a row of the plan: begins a batch, or ends it
    bool begins_batch() const { return work_->flight.empty(); }
    bool ends_batch() const { return sampler_->rows_done() + 1 >= sampler_->rows(); }

    // Measures a step and says what `runs` such fillings would take: regions, voxels, batch, steps, peak_device_bytes,
    // seconds, device. Instead of start().
    Result<Json> estimate(size_t runs = 1);
    // device memory for full batches of full regions: what any grid may take. Needs load.
    Result<uint64_t> bound_bytes() const;

    // voxels, regions, seconds and memory of the last filling
    Json results() const;
    // how many voxels are done, in the stage "generate"
    void say(const JobCallbacks& callbacks, bool ended = false) const;
    size_t region_count() const { return work_->graph.region_count(); }
    Device& device() const { return device_; }

  private:
    // a grid that is being filled
    struct Work {
        Work(VoxelGrid& g, Regions r) : grid(g), regions(std::move(r)), graph(regions, g.cells.size(), g.generated) {}

        VoxelGrid& grid;
        Regions regions;
        RegionGraph graph;
        VoxelConditions conditions;
        std::vector<uint8_t> restored; // by region
        size_t cells_to_do = 0, cells_done = 0, cells_restored = 0;
        size_t cells_to_compute = 0;  // members of regions, the known ones too
        uint32_t largest = 0;         // region, in voxels
        std::vector<uint32_t> flight; // regions of the batch at work
    };

    Status check(const VoxelGrid& grid) const;
    Status fit_batch();
    uint32_t wanted_batch() const;
    uint32_t widest_batch(uint32_t limit) const;
    Result<uint64_t> bytes_of(uint32_t batch, uint32_t cells) const;
    Status restore(const RegionResult& result);
    RegionInput input(uint32_t region) const;
    std::vector<RegionInput> next_batch();
    Status end_batch();
    RegionResult result(uint32_t region) const;
    Result<double> measure_step(uint32_t batch, uint32_t cells) const;

    Device& device_;
    const GenerationSettings& settings_;
    std::shared_ptr<const Transformer> transformer_;
    std::unique_ptr<TokenSampler> sampler_;
    std::unique_ptr<Work> work_; // from cut() on
    RunFolder* run_ = nullptr;
    std::optional<uint64_t> seed_;
    uint32_t batch_ = 1, widest_batch_ = 1;
    uint64_t base_bytes_ = 0; // of what is there before the sampler's tables and batches
    uint64_t planned_bytes_ = 0, peak_bytes_ = 0;
    SubmitCost cost_;
    double seconds_ = 0;
};

} // namespace semrover
