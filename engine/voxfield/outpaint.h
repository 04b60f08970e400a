// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/grid.h"
#include "engine/voxfield/cell_conditions.h"
#include "engine/voxfield/region_graph.h"
#include "engine/voxfield/token_sampler.h"

#include <functional>

namespace semrover {

// what a finished region hands over: stored points and colours of its target cells
struct RegionResult {
    uint32_t region = 0;
    std::vector<uint32_t> targets; // indices of cells
    std::vector<uint16_t> points;  // [targets, n, 3] f16 bits
    std::vector<uint8_t> colors;   // [targets, n, 3]
};

// called before dependents start: the place to save
using FinishedRegion = std::function<Status(const RegionResult&)>;

// Fills a grid region by region (docs/method.md §4): cells with generated = 1 are known and never change. In order:
// restore what is done already, begin, then step until it says true.
class Outpainter {
  public:
    // grid: made ready for points (arrays allocated, n and voxel size of the model); errors: bad_input
    static Result<std::unique_ptr<Outpainter>> create(VoxelGrid& grid, const TransformerConfig& config,
                                                      const RegionOptions& options);

    // what is known of the grid's cells beside their labels; before begin()
    void tell(CellConditions conditions) { conditions_ = std::move(conditions); }

    size_t region_count() const { return graph_->region_count(); }
    size_t cells_to_do() const { return cells_to_do_; }
    size_t cells_done() const { return cells_done_; }
    size_t cells_to_compute() const { return cells_to_compute_; } // members of regions, the known ones too
    double part() const;                                          // of the batch in flight, 0..1
    // what the next submit does beside a row of the plan: begins a batch, or ends it
    bool begins_batch() const { return flight_.empty(); }
    bool ends_batch() const { return sampler_ && sampler_->rows_done() + 1 >= sampler_->rows(); }
    uint32_t largest_region() const { return largest_; }
    const Regions& regions() const { return regions_; }

    // regions of the largest batch that will be made with this limit: dependencies may keep batches smaller. 0 when
    // every region is restored.
    uint32_t widest_batch(uint32_t limit) const;

    // takes over a region that an earlier run finished; its targets must be those of this run
    Status restore(const RegionResult& result);

    // the rest, in batches of up to `batch` ready regions. The sampler outlives the work and does nothing else while a
    // batch is in flight.
    void begin(TokenSampler& sampler, uint32_t batch, FinishedRegion finished = {});
    // Up to `submits` submits of the batch in flight, or of a new one; what is complete is stored in the grid. true:
    // the grid is filled. Errors: as TokenSampler; those of `finished`
    Result<bool> step(size_t submits);
    // gives up the batch in flight; the grid keeps what is finished, and begin() may follow
    Status cancel();

  private:
    Outpainter(VoxelGrid& grid, const TransformerConfig& config) : grid_(grid), config_(config) {}
    RegionInput input(uint32_t region) const;
    RegionResult result(uint32_t region, const float* tokens) const;
    void store(const RegionResult& result);
    std::vector<RegionInput> inputs() const;
    Status begin_batch();
    Status end_batch();

    VoxelGrid& grid_;
    const TransformerConfig& config_;
    CellConditions conditions_;
    Regions regions_;
    std::unique_ptr<RegionGraph> graph_;
    std::vector<RegionResult> restored_; // by region; empty targets: not restored
    size_t cells_to_do_ = 0, cells_done_ = 0, cells_to_compute_ = 0;
    uint32_t largest_ = 0;
    TokenSampler* sampler_ = nullptr; // from begin() on
    uint32_t batch_ = 1;
    FinishedRegion finished_;
    std::vector<uint32_t> flight_; // regions of the batch at work

  public:
    ~Outpainter();
};

} // namespace semrover
