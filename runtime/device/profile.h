// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/result.h"

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace semrover {

// what a driver says of a pipeline's code: "VGPRs", 128
struct Statistic {
    std::string name;
    double value = 0;
};

// device time of every pass, written as a Chrome trace (chrome://tracing, Perfetto)
class Profile {
  public:
    struct Event {
        std::string name;
        double begin_us, duration_us;
        std::array<uint32_t, 3> groups = {}; // workgroups
        double flops = 0;                    // as its op counts them, 0 where it does not
        std::array<uint32_t, 2> tile = {};   // rows and columns of the output that a workgroup makes, 1 x 1 where it does not say
        std::shared_ptr<const std::vector<Statistic>> statistics = {}; // of its pipeline; null where the driver has none
    };
    void add(Event event) { events_.push_back(std::move(event)); }
    Status write(const std::string& path) const;
    // total milliseconds and count per name, longest first
    std::string summary() const;
    // a line per name that has statistics, in the same order: each statistic, as a range where its pipelines differ
    std::string statistics() const;

  private:
    struct Total {
        std::string name;
        double duration_us = 0;
        size_t count = 0;
    };
    std::vector<Total> totals() const; // longest first

    std::vector<Event> events_;
};

} // namespace semrover
