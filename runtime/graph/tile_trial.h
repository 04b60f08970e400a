// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/graph/tile_choices.h"

#include <span>
#include <vector>

namespace semrover {

// Autotuning: the first runs of a program are made with each tile in turn, twice, where its passes have a choice and
// nothing is known of them; from then on they keep what was fastest. Runs give the same bits meanwhile.
class TileTrial {
  public:
    TileTrial() = default; // tries nothing

    // Gives passes the tiles that are known to be best. Errors: out_of_memory where a grid exceeds the limits
    static Result<TileTrial> begin(Plan& plan, const DeviceLimits& limits, const TileChoices& choices);

    bool running() const { return !groups_.empty(); }
    bool changed() const { return changed_; } // begin() gave a pass another tile than the planner's
    // The next run's tiles, after one that took that long for each pass (0: not known); the best ones after the last.
    Status next(Plan& plan, std::span<const double> seconds, const DeviceLimits& limits, TileChoices& choices);

  private:
    struct Group { // passes that take alike
        TileChoices::Key key;
        std::vector<uint32_t> tiles; // the planner's first
        std::vector<double> seconds; // of all passes together, the least so far
        std::vector<size_t> passes;
    };
    static Status set_tile(Plan& plan, const Group& group, uint32_t tile, const DeviceLimits& limits);
    static uint32_t best_of(const Group& group);

    std::vector<Group> groups_;
    size_t run_ = 0;
    bool changed_ = false;
};

} // namespace semrover
