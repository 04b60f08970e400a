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

// Which of their alternatives passes ran fastest with, as executables have measured it on a device. All of a pass give
// the same bits.
class TuningCache {
  public:
    // of passes that take alike: their shader, its constants, their alternatives, the output, the bytes that they bind
    using Key = uint64_t;
    static Key key(const Pass& pass);

    std::optional<uint32_t> best(Key key) const;
    void set(Key key, uint32_t alternative) { best_[key] = alternative; }
    size_t size() const { return best_.size(); }

    std::string text() const;         // a line each
    void read(std::string_view text); // in addition to those that are there; leaves out what text() does not write

  private:
    std::map<Key, uint32_t> best_;
};

// The first runs of an executable are made with each alternative in turn, twice, where its passes have a choice and
// nothing is known of them; from then on they keep what was fastest. Runs give the same bits meanwhile.
class Autotuner {
  public:
    Autotuner() = default; // tries nothing

    // Passes take the alternatives that are known to be best. Errors: out_of_memory where a grid exceeds the limits
    static Result<Autotuner> begin(Plan& plan, const DeviceLimits& limits, const TuningCache& cache);

    bool running() const { return !groups_.empty(); }
    bool changed() const { return changed_; } // in begin() a pass took another one than the first
    // The next run's alternatives, after one that took that long for each pass (0: not known); the best ones after the
    // last.
    Status next(Plan& plan, std::span<const double> seconds, const DeviceLimits& limits, TuningCache& cache);

  private:
    struct Group { // passes that take alike
        TuningCache::Key key;
        std::vector<double> seconds; // by alternative: of all passes together, the least so far
        std::vector<size_t> passes;
    };
    static Status take(Plan& plan, const Group& group, uint32_t alternative, const DeviceLimits& limits);
    static uint32_t best_of(const Group& group);

    std::vector<Group> groups_;
    size_t run_ = 0;
    bool changed_ = false;
};

} // namespace semrover
