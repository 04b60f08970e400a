// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/graph/plan.h"

#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace semrover {

// Which tile passes ran fastest with, as programs have measured it on a device. All tiles of a pass give the same bits.
class TileChoices {
  public:
    // of passes that take alike: their shader, its constants but for the tile, the output, the bytes that they bind
    using Key = uint64_t;
    static Key key(const Pass& pass);

    std::optional<uint32_t> best(Key key) const;
    void set(Key key, uint32_t tile) { best_[key] = tile; }
    size_t size() const { return best_.size(); }

    std::string text() const;         // a line each
    void read(std::string_view text); // in addition to those that are there; leaves out what text() does not write

  private:
    std::map<Key, uint32_t> best_;
};

// How long the passes of a device take, beside what was estimated, by shader: what programs have measured so far.
class WorkRates {
  public:
    // a pass took that long
    void learn(const Pass& pass, double seconds);
    // that it will take: as measured, or as estimated while nothing was
    double seconds(const Pass& pass) const;
    std::vector<double> seconds(const Plan& plan) const; // of each pass

  private:
    struct Measured {
        double estimated = 0, seconds = 0; // sums
    };
    std::map<const KernelVariant*, Measured> measured_;
};

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
