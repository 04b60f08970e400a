// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/grid.h"
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

struct OutpaintCallbacks {
    std::function<Status(const RegionResult&)> finished;          // before dependents start: the place to save
    std::function<bool(size_t cells_done, double part)> progress; // part: of the batch at work, 0..1; false stops
};

// Fills a grid region by region (docs/method.md §4): cells with generated = 1 are known and never change.
class Outpainter {
  public:
    // grid: made ready for points (arrays allocated, n and voxel size of the model); errors: bad_input
    static Result<std::unique_ptr<Outpainter>> create(VoxelGrid& grid, const TransformerConfig& config,
                                                      const RegionOptions& options);

    size_t region_count() const { return graph_->region_count(); }
    size_t cells_to_do() const { return cells_to_do_; }
    uint32_t largest_region() const { return largest_; }
    const Regions& regions() const { return regions_; }

    // regions of the largest batch that run() will make with this limit: dependencies may keep batches smaller. Of a
    // run that has not begun; 0 when every region is restored.
    uint32_t widest_batch(uint32_t limit) const;

    // takes over a region that an earlier run finished; its targets must be those of this run
    Status restore(const RegionResult& result);

    // the rest, in batches of ready regions
    Status run(TokenSampler& sampler, uint32_t batch, const OutpaintCallbacks& callbacks);

  private:
    Outpainter(VoxelGrid& grid, const TransformerConfig& config) : grid_(grid), config_(config) {}
    RegionInput input(uint32_t region) const;
    RegionResult result(uint32_t region, const float* tokens) const;
    void store(const RegionResult& result);

    VoxelGrid& grid_;
    const TransformerConfig& config_;
    Regions regions_;
    std::unique_ptr<RegionGraph> graph_;
    std::vector<RegionResult> restored_; // by region; empty targets: not restored
    size_t cells_to_do_ = 0, cells_done_ = 0;
    uint32_t largest_ = 0;
};

} // namespace semrover
