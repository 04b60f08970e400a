// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
#include "runtime/base/json.h"
#include "tests/support/json_text.h"
#include "tests/support/program.h"

namespace semrover {
namespace cli_bench_vsd_test {

constexpr const char* kTiny = "bench vsd --config " SEMROVER_SOURCE_DIR
                              "/tests/golden/vsd_window_tiny/model/unet/config.json --vae-config " SEMROVER_SOURCE_DIR
                              "/tests/golden/vsd_window_tiny/model/vae/config.json -W 64 -H 64 --frames 3 --json";

TEST(CliBenchVsd, reports_memory_as_planned_and_times_where_it_runs)
{
    const ProgramResult planned = semrover_program(std::string(kTiny) + " --evaluations 0"),
                        run = semrover_program(std::string(kTiny) + " --evaluations 2");
    ASSERT_EQ(planned.code, 0) << planned.err;
    ASSERT_EQ(run.code, 0) << run.err;
    const Json memory = json_of(planned.out), timed = json_of(run.out);
    for (const Json& report : {memory, timed}) {
        EXPECT_EQ(report["peak_bytes"], report["predicted_bytes"]);
        EXPECT_LE(report["staged_bytes"], report["predicted_bytes"]);
        EXPECT_EQ(report["frames"], 3);
    }
    EXPECT_FALSE(memory.contains("share_of_gemm"));
    EXPECT_GT(timed["share_of_gemm"], 0.0);
}

} // namespace cli_bench_vsd_test
} // namespace semrover
