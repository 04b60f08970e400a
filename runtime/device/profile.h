// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/result.h"

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace semrover {

// device time of every pass, written as a Chrome trace (chrome://tracing, Perfetto)
class Profile {
  public:
    struct Event {
        std::string name;
        double begin_us, duration_us;
        std::array<uint32_t, 3> groups = {}; // workgroups
        double flops = 0;                    // as its op counts them, 0 where it does not
        std::array<uint32_t, 2> tile = {};   // rows and columns of the output that a workgroup makes, 1 x 1 where it does not say
    };
    void add(Event event) { events_.push_back(std::move(event)); }
    Status write(const std::string& path) const;
    // total microseconds and count per name, longest first
    std::string summary() const;

  private:
    std::vector<Event> events_;
};

} // namespace semrover
