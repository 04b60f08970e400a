// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
// `semrover bench world`: what a short flight reports, and the figures that it counts with
#include "runtime/base/json.h"
#include "tests/support/json_text.h"
#include "tests/support/program.h"
#include "tools/bench/call_times.h"

namespace semrover {
namespace cli_world_flight_test {

TEST(CallTimes, percentiles_are_times_that_were_measured)
{
    CallTimes times;
    EXPECT_EQ(times.percentile(50), 0);
    for (int n = 100; n >= 1; --n)
        times.add(n);
    EXPECT_EQ(times.percentile(50), 50);
    EXPECT_EQ(times.percentile(99), 99);
    EXPECT_EQ(times.percentile(100), 100);
    EXPECT_EQ(times.count_over(90), 10u);
    EXPECT_DOUBLE_EQ(times.share_over(99), 0.01);
}

TEST(CliBenchWorld, a_flight_reports_steps_against_each_budget_and_memory_on_the_way)
{
    const std::string line = "bench world -m " SEMROVER_SOURCE_DIR "/tests/golden/sampling_ddpm/model --steps 1 --json "
                             "--metres 60 --seconds 2 --radius 6";
    const ProgramResult three = semrover_program(line), one = semrover_program(line + " --budget 1000");
    ASSERT_EQ(three.code, 0) << three.err;
    ASSERT_EQ(one.code, 0) << one.err;
    Json flights = json_of(three.out)["flights"];
    ASSERT_EQ(flights.size(), 3u);
    EXPECT_EQ(flights[2]["budget_ms"], 100);
    const Json alone = json_of(one.out)["flights"];
    ASSERT_EQ(alone.size(), 1u);
    EXPECT_EQ(alone[0]["budget_ms"], 1000);
    EXPECT_GT(alone[0]["tiles_generated"], 0);
    flights.push_back(alone[0]);
    for (const Json& flight : flights) {
        EXPECT_GT(flight["steps"], 0);
        EXPECT_GE(flight["over_budget_share"], 0);
        EXPECT_LE(flight["over_budget_share"], 1);
        const Json& step = flight["step_ms"];
        EXPECT_LE(step["p50"], step["p99"]);
        EXPECT_LE(step["p99"], flight["worst_step_ms"]);
        EXPECT_EQ(flight["over_budget_share"] > 0.0, flight["worst_step_ms"] > flight["budget_ms"]);
        EXPECT_GE(flight["frame_ms_median"], 16.6); // a screen of 60 Hz
        EXPECT_LE(flight["hitches"], flight["steps"]);
        const Json& memory = flight["memory"];
        ASSERT_GE(memory.size(), 2u); // a slow device may jump over the look at 50 m
        ASSERT_LE(memory.size(), 3u);
        EXPECT_EQ(memory[0]["metres"], 0);
        EXPECT_EQ(memory.back()["metres"], 60);
        EXPECT_GT(memory.back()["device_bytes"], 256u << 20); // the splats' at least
    }
}

} // namespace cli_world_flight_test
} // namespace semrover
