// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/semrover.h"

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>

namespace semrover::view {

class Stopwatch {
  public:
    double ms() const
    {
        return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start_).count();
    }

  private:
    std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

// the last times of something that is done every frame
class Times {
  public:
    void add(double ms) { last_[count_++ % last_.size()] = float(ms); }
    double mean() const
    {
        double sum = 0;
        for (size_t n = 0; n < size(); ++n)
            sum += last_[n];
        return size() ? sum / double(size()) : 0;
    }
    size_t size() const { return count_ < last_.size() ? count_ : last_.size(); }

  private:
    std::array<float, 60> last_{};
    size_t count_ = 0;
};

// what the viewer shows of a frame
struct Figures {
    uint64_t frames = 0;
    Times frame, step, draw; // milliseconds: all of a frame, the library's step, drawing and showing
    sr_world_info world{};
    sr_memory_info memory{};
    bool finished = false; // all that is wanted is there
};

} // namespace semrover::view
