// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/json.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <vector>

namespace semrover {

class CallTimer {
  public:
    double ms() const
    {
        return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin_).count();
    }

  private:
    std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

// milliseconds of all calls of a kind
class CallTimes {
  public:
    void add(double ms) { all_.push_back(ms); }
    size_t count() const { return all_.size(); }
    size_t count_over(double ms) const
    {
        return size_t(std::ranges::count_if(all_, [ms](double t) { return t > ms; }));
    }
    double share_over(double ms) const { return all_.empty() ? 0 : double(count_over(ms)) / double(all_.size()); }

    // the least time that this share of the calls does not exceed; 0 where there are none
    double percentile(double percent) const
    {
        if (all_.empty())
            return 0;
        std::vector<double> sorted = all_;
        std::ranges::sort(sorted);
        const double rank = std::ceil(percent / 100 * double(sorted.size()));
        return sorted[size_t(std::clamp(rank, 1.0, double(sorted.size()))) - 1];
    }
    Json json() const { return {{"p50", percentile(50)}, {"p99", percentile(99)}, {"worst", percentile(100)}}; }

  private:
    std::vector<double> all_;
};

} // namespace semrover
