// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/device/profile.h"

#include <gtest/gtest.h>

namespace semrover {
namespace profile_test {

using Statistics = std::shared_ptr<const std::vector<Statistic>>;

void add(Profile& profile, const char* name, double duration_us, Statistics statistics = {})
{
    Profile::Event event{name, 0, duration_us};
    event.statistics = std::move(statistics);
    profile.add(std::move(event));
}

Statistics registers_and_spills(double registers, double spills)
{
    return std::make_shared<const std::vector<Statistic>>(
        std::vector<Statistic>{{"Registers", registers}, {"Spills", spills}});
}

TEST(profile, sums_times_by_name_longest_first)
{
    Profile profile;
    add(profile, "add", 1000);
    add(profile, "gemm", 2500);
    add(profile, "add", 500);
    EXPECT_EQ(profile.summary(), "       2.5 ms  62.5 %      1 x gemm\n"
                                 "       1.5 ms  37.5 %      2 x add\n");
}

TEST(profile, says_statistics_of_each_pipeline_once_as_ranges)
{
    Profile profile;
    const Statistics narrow = registers_and_spills(64, 0), wide = registers_and_spills(128, 0),
                     other = registers_and_spills(32, 1e6);
    add(profile, "add", 1, other);
    for (int run = 0; run < 3; ++run) {
        add(profile, "gemm", 10, narrow);
        add(profile, "gemm", 10, wide);
    }
    add(profile, "fill", 5); // whose driver says nothing
    EXPECT_EQ(profile.statistics(), "gemm, 2 pipelines: Registers 64 to 128; Spills 0\n"
                                    "add, 1 pipelines: Registers 32; Spills 1000000\n");
}

TEST(profile, has_no_statistics_where_there_are_none)
{
    Profile profile;
    EXPECT_EQ(profile.statistics(), "");
    add(profile, "gemm", 10);
    EXPECT_EQ(profile.statistics(), "");
}

} // namespace profile_test
} // namespace semrover
