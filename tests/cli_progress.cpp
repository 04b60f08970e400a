// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/cli/progress.h"

// note: the program's own files are in no library that a test could link
#include "tests/support/json_text.h"
#include "tools/cli/progress.cpp"

#include <gtest/gtest.h>
#include <sstream>

namespace semrover {
namespace cli_progress_test {

// a clock that is set by hand, and what was written
struct Script {
    double now = 100;
    std::string text;

    ProgressOutput output(ProgressStyle style)
    {
        return {style, [this] { return now; }, [this](std::string_view piece) { text += piece; }};
    }
};

TEST(Progress, a_terminal_shows_one_line_that_is_drawn_over)
{
    Script script;
    Progress progress(script.output(ProgressStyle::terminal), "generate", "regions", 96);
    progress.update(0);
    EXPECT_EQ(script.text, "\rgenerate  0/96 regions\x1b[K");
    script.text.clear();
    script.now += 0.05;
    progress.update(1);
    EXPECT_EQ(script.text, ""); // too soon
    script.now += 9.95;
    progress.update(12, 432013312);
    EXPECT_EQ(script.text, "\rgenerate  12/96 regions  1.2/s  ETA 01:10  412 MiB\x1b[K");
    script.text.clear();
    script.now += 50;
    progress.update(96);
    progress.finish();
    EXPECT_TRUE(script.text.ends_with("\rgenerate  96 regions in 01:00  1.6/s\x1b[K\n")) << script.text;
}

TEST(Progress, a_line_left_open_is_ended_before_anything_else_is_said)
{
    Script script;
    {
        Progress progress(script.output(ProgressStyle::terminal), "render", "frames", 3);
        progress.update(1);
    }
    EXPECT_EQ(script.text.back(), '\n');
}

TEST(Progress, off_a_terminal_a_plain_line_comes_every_10_seconds)
{
    Script script;
    Progress progress(script.output(ProgressStyle::lines), "render", "frames", 100);
    for (uint64_t i = 1; i <= 100; ++i) {
        script.now += 0.25;
        progress.update(i);
    }
    progress.finish();
    EXPECT_EQ(script.text, "render  40/100 frames  4/s  ETA 00:15\nrender  80/100 frames  4/s  ETA 00:05\n"
                           "render  100 frames in 00:25  4/s\n");
}

TEST(Progress, json_lines_hold_the_numbers)
{
    Script script;
    Progress progress(script.output(ProgressStyle::json), "render", "frames", 8);
    script.now += 2;
    progress.update(4, 1000);
    script.now += 0.5;
    progress.update(5);
    script.now += 1.5;
    progress.update(8);
    progress.finish();
    std::vector<nlohmann::json> lines;
    std::istringstream in(script.text);
    for (std::string line; std::getline(in, line);)
        lines.push_back(json_of(line));
    ASSERT_EQ(lines.size(), 3u);
    EXPECT_EQ(lines[0], nlohmann::json({{"event", "progress"},
                                        {"stage", "render"},
                                        {"unit", "frames"},
                                        {"done", 4},
                                        {"total", 8},
                                        {"elapsed_s", 2.0},
                                        {"rate", 2.0},
                                        {"eta_s", 2.0},
                                        {"device_bytes", 1000}}));
    EXPECT_EQ(lines[2]["event"], "done");
    EXPECT_EQ(lines[2]["eta_s"], 0);
}

TEST(Progress, quiet_says_nothing_and_needs_no_clock)
{
    Progress progress({}, "render", "frames", 8);
    progress.update(4);
    progress.finish();
}

TEST(Progress, what_a_resumed_run_found_done_does_not_count_for_the_rate)
{
    Script script;
    Progress progress(script.output(ProgressStyle::lines), "generate", "regions", 96, 48);
    script.now += 10;
    progress.update(58);
    EXPECT_EQ(script.text, "generate  58/96 regions  1/s  ETA 00:38\n");
}

TEST(Progress, the_options_choose_the_style)
{
    EXPECT_EQ(progress_style({}, true), ProgressStyle::terminal);
    EXPECT_EQ(progress_style({}, false), ProgressStyle::lines);
    Globals globals;
    globals.quiet = true;
    EXPECT_EQ(progress_style(globals, true), ProgressStyle::silent);
    globals.log_json = true;
    EXPECT_EQ(progress_style(globals, true), ProgressStyle::json);
}

TEST(Progress, durations_and_sizes_are_short)
{
    EXPECT_EQ(duration_text(0.4), "00:00");
    EXPECT_EQ(duration_text(59.6), "01:00");
    EXPECT_EQ(duration_text(3723), "1:02:03");
    EXPECT_EQ(duration_text(-1), "00:00");
    EXPECT_EQ(bytes_text(0), "0 B");
    EXPECT_EQ(bytes_text(1023), "1023 B");
    EXPECT_EQ(bytes_text(1536), "1.5 KiB");
    EXPECT_EQ(bytes_text(uint64_t(6) << 30), "6.0 GiB");
    EXPECT_EQ(bytes_text(~uint64_t(0)), "16.0 EiB");
}

} // namespace cli_progress_test
} // namespace semrover
