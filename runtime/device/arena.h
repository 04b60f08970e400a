// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/device/executable.h"

namespace semrover {

// What arenas of plans take, block by block, where only one of their executables runs at a time.
struct ArenaSize {
    std::vector<uint64_t> blocks;

    void cover(const ArenaSize& other); // as much as the larger of the two
    uint64_t bytes() const;
};

// Memory for the transients of executables that run one after the other. Nothing in it lasts from run to run.
class Arena {
  public:
    static Result<std::shared_ptr<const Arena>> create(Device& device, const ArenaSize& size);

    // of a plan that needs no more than the arena has; the arena outlives it
    Result<std::unique_ptr<Executable>> executable(const Graph& graph) const;

  private:
    explicit Arena(Device& device) : device_(device) {}

    Device& device_;
    std::vector<std::unique_ptr<Buffer>> blocks_;
};
using SharedArena = std::shared_ptr<const Arena>;

} // namespace semrover
