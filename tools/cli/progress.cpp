// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/cli/progress.h"

#include "runtime/base/json.h"
#include "runtime/system/process.h"

#include <chrono>
#include <cmath>
#include <cstdio>

namespace semrover {

namespace {

// seconds between two writes
double interval(ProgressStyle style)
{
    switch (style) {
    case ProgressStyle::terminal:
        return 0.1;
    case ProgressStyle::json:
        return 1;
    case ProgressStyle::lines:
    case ProgressStyle::silent:
        break;
    }
    return 10;
}

} // namespace

ProgressStyle progress_style(const Globals& globals, bool is_terminal)
{
    if (globals.log_json)
        return ProgressStyle::json;
    if (globals.quiet)
        return ProgressStyle::silent;
    return is_terminal ? ProgressStyle::terminal : ProgressStyle::lines;
}

ProgressOutput progress_to_stderr(const Globals& globals)
{
    const auto seconds = [] {
        return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
    };
    const auto write = [](std::string_view text) {
        std::fwrite(text.data(), 1, text.size(), stderr);
        std::fflush(stderr);
    };
    return {progress_style(globals, system::standard_error_is_terminal()), seconds, write};
}

Progress::Progress(ProgressOutput output, std::string stage, std::string unit, uint64_t total, uint64_t done)
    : output_(std::move(output)), stage_(std::move(stage)), unit_(std::move(unit)), total_(total), first_(done),
      done_(done)
{
    if (output_.style != ProgressStyle::silent)
        start_ = last_ = output_.seconds();
}

Progress::~Progress()
{
    if (line_open_)
        output_.write("\n");
}

void Progress::update(uint64_t done, std::optional<uint64_t> device_bytes)
{
    done_ = done;
    if (device_bytes)
        device_bytes_ = device_bytes;
    if (output_.style == ProgressStyle::silent)
        return;
    const double now = output_.seconds();
    // a terminal shows the first count at once; a log has nothing to say before its interval has passed
    const bool first = !wrote_ && output_.style == ProgressStyle::terminal;
    if (!first && now - last_ < interval(output_.style))
        return;
    last_ = now;
    wrote_ = true;
    if (output_.style == ProgressStyle::json) {
        output_.write(json_line(now, "progress"));
    } else if (output_.style == ProgressStyle::lines) {
        output_.write(text_line(now) + "\n");
    } else {
        output_.write(fmt::format("\r{}\x1b[K", text_line(now))); // erases what a longer line left
        line_open_ = true;
    }
}

void Progress::finish()
{
    if (output_.style == ProgressStyle::silent)
        return;
    const double now = output_.seconds();
    if (output_.style == ProgressStyle::json) {
        output_.write(json_line(now, "done"));
        return;
    }
    const double speed = rate(now);
    output_.write(fmt::format("{}{}  {} {} in {}{}{}\n", line_open_ ? "\r" : "", stage_, done_, unit_,
                              duration_text(now - start_), speed > 0 ? fmt::format("  {:.3g}/s", speed) : "",
                              line_open_ ? "\x1b[K" : ""));
    line_open_ = false;
}

double Progress::rate(double now) const
{
    const double elapsed = now - start_;
    return elapsed > 0 && done_ > first_ ? static_cast<double>(done_ - first_) / elapsed : 0;
}

std::string Progress::text_line(double now) const
{
    std::string line = fmt::format("{}  {}/{} {}", stage_, done_, total_, unit_);
    if (const double speed = rate(now); speed > 0) {
        line += fmt::format("  {:.3g}/s", speed);
        if (done_ < total_)
            line += fmt::format("  ETA {}", duration_text(static_cast<double>(total_ - done_) / speed));
    }
    if (device_bytes_)
        line += fmt::format("  {}", bytes_text(*device_bytes_));
    return line;
}

std::string Progress::json_line(double now, std::string_view event) const
{
    nlohmann::ordered_json json = {{"event", event}, {"stage", stage_}, {"unit", unit_},
                                   {"done", done_},  {"total", total_}, {"elapsed_s", now - start_}};
    if (const double speed = rate(now); speed > 0) {
        json["rate"] = speed;
        json["eta_s"] = done_ < total_ ? static_cast<double>(total_ - done_) / speed : 0;
    }
    if (device_bytes_)
        json["device_bytes"] = *device_bytes_;
    return json_text(json) + "\n";
}

std::string duration_text(double seconds)
{
    const auto whole = static_cast<uint64_t>(std::lround(std::fmax(seconds, 0)));
    const uint64_t hours = whole / 3600, minutes = whole / 60 % 60;
    return hours ? fmt::format("{}:{:02}:{:02}", hours, minutes, whole % 60)
                 : fmt::format("{:02}:{:02}", minutes, whole % 60);
}

} // namespace semrover
