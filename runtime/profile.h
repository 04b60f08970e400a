// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/result.h"

#include <cstdint>
#include <string>
#include <vector>

namespace semrover {

// device time of every pass, written as a Chrome trace (chrome://tracing, Perfetto)
class Profile {
  public:
    void add(std::string name, double begin_us, double duration_us);
    Status write(const std::string& path) const;
    // total microseconds and count per name, longest first
    std::string summary() const;

  private:
    struct Event {
        std::string name;
        double begin_us, duration_us;
    };
    std::vector<Event> events_;
};

} // namespace semrover
