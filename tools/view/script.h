// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/file.h"

#include <deque>

namespace semrover::view {

class Viewer;

// What a script says: a step a line, one a frame. docs/usage.md §8.2 lists them.
class Script {
  public:
    // Checks every line. bad_input: the file, a step that there is not, what it takes; with the line
    static Result<Script> read(const Path& path);

    Status add(std::string_view line, std::string_view where);
    Status add_shot(const Path& file, std::string_view where); // of any name

    // Does the next step, or goes on with one that takes several frames. An error names the line.
    Status advance(Viewer& viewer);

  private:
    struct Step {
        std::string where; // "FILE:3"
        size_t verb = 0;
        std::vector<double> numbers; // also what words stand for
        std::string file;
        uint32_t frames = 0; // that it has taken so far
    };
    std::deque<Step> steps_;
};

} // namespace semrover::view
