// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/voxfield/regions.h"

#include <cstdint>
#include <queue>
#include <span>
#include <vector>

namespace semrover {

// Which regions may run now. A voxel is the target of the first region that holds it; every later region that holds it
// knows it. A region waits for the regions whose targets it knows. Regions without targets are dropped.
// note: two regions that share only voxels known to both do not wait for each other: known voxels are read, never
// written, so either order gives the same bytes and more regions fit one batch. Any order in which regions become
// ready gives each the same known voxels as the order of Algorithm 1.
//
//     RegionGraph graph(regions, cells.size(), generated);
//     while (!graph.finished())
//         for (uint32_t region : graph.take(batch)) { ...; graph.done(region); }
class RegionGraph {
  public:
    // generated [cell_count] or empty: voxels with a value other than 0 are known from the start and no region's
    // target. Asserts that members are below cell_count and that `generated` has the right length.
    RegionGraph(const Regions& regions, size_t cell_count, std::span<const uint8_t> generated = {});

    // Returns up to `limit` ready regions, lowest first, each only once. Empty with limit > 0 only while regions that
    // were taken are not done, or when all are finished.
    std::vector<uint32_t> take(size_t limit);
    // Call when a region that was taken has written its targets.
    void done(uint32_t region);
    // a region that was taken will not be worked on now: it is ready again
    void give_back(uint32_t region);

    size_t region_count() const { return run_count_; } // with targets: those that run
    size_t done_count() const { return done_count_; }
    bool finished() const { return done_count_ == run_count_; }

    // voxels the region generates, nearest to its seed first; empty for a dropped region
    std::span<const uint32_t> targets(uint32_t region) const { return targets_.row(region); }
    bool is_target(uint32_t region, uint32_t cell) const { return owner_[cell] == region; }
    // regions that must be done before this one, ascending
    std::span<const uint32_t> waits_for(uint32_t region) const { return waits_.row(region); }

  private:
    // lists of different lengths, one after the other
    struct Rows {
        std::vector<uint32_t> offsets = {0};
        std::vector<uint32_t> values;
        void end_row() { offsets.push_back(uint32_t(values.size())); }
        std::span<const uint32_t> row(size_t i) const
        {
            return {values.data() + offsets[i], values.data() + offsets[i + 1]};
        }
    };
    enum class State : uint8_t { dropped, waiting, taken, done };

    void find_owners(const Regions& regions, std::span<const uint8_t> generated);
    void link(const Regions& regions);
    void invert_waits();

    std::vector<uint32_t> owner_; // [voxels] region that generates the voxel, or kNobody
    Rows targets_;
    Rows waits_;
    Rows dependents_;                  // waits_, seen from the other side
    std::vector<uint32_t> open_waits_; // [regions] regions in waits_ that are not done
    std::vector<State> states_;
    std::priority_queue<uint32_t, std::vector<uint32_t>, std::greater<>> ready_;
    size_t run_count_ = 0;
    size_t done_count_ = 0;
};

} // namespace semrover
