// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/bytes_text.h"
#include "tools/cli/commands.h"

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

namespace semrover {

enum class ProgressStyle {
    silent,
    terminal, // one line that is drawn over, ten times a second at most
    lines,    // a line every 10 s
    json,     // a JSON object a line, one a second at most
};

// --log-json wins over --quiet, --quiet over the rest
ProgressStyle progress_style(const Globals& globals, bool is_terminal);

// where progress goes, and the clock it goes by
struct ProgressOutput {
    ProgressStyle style = ProgressStyle::silent;
    std::function<double()> seconds;             // monotonic
    std::function<void(std::string_view)> write; // a piece of text, line ends included
};
ProgressOutput progress_to_stderr(const Globals& globals);

// how far a long stage is: stage, count, rate, time left, device memory
class Progress {
  public:
    // `done` of `total` units exist already when a run is resumed; they do not count for the rate
    Progress(ProgressOutput output, std::string stage, std::string unit, uint64_t total, uint64_t done = 0);
    Progress(const Progress&) = delete;
    Progress& operator=(const Progress&) = delete;
    ~Progress(); // a terminal's line is left ended, so that an error starts on its own

    // any time, from one thread; most calls write nothing
    void update(uint64_t done, std::optional<uint64_t> device_bytes = {});

    void finish(); // the last line: how many in which time

  private:
    double rate(double now) const; // units a second, 0 when unknown
    std::string text_line(double now) const;
    std::string json_line(double now, std::string_view event) const;

    ProgressOutput output_;
    std::string stage_, unit_;
    uint64_t total_, first_, done_;
    std::optional<uint64_t> device_bytes_;
    double start_ = 0, last_ = 0;
    bool wrote_ = false, line_open_ = false;
};

std::string duration_text(double seconds); // "00:42", "1:02:03"

} // namespace semrover
