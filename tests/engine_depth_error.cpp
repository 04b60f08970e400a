// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/eval/depth_error.h"

#include <cmath>
#include <gtest/gtest.h>
#include <random>
#include <vector>

namespace semrover {
namespace engine_depth_error_test {

void expect_figures(const DepthErrors& e, const std::array<double, 7>& expect)
{
    for (size_t i = 0; i < expect.size(); ++i)
        EXPECT_NEAR(e.figures()[i], expect[i], 1e-12) << kDepthFigures[i];
}

TEST(EngineDepthError, figures_by_hand)
{
    // 2 for 2; 5 for 4: the ratio is 1.25 and not below it; 6 for 4: 1.5; 1 for 2: 2; nothing for 3; 7 for nothing
    const std::vector<float> frame = {2, 5, 6, 1, 0, 7}, truth = {2, 4, 4, 2, 3, 0};
    const DepthErrors e = depth_errors(frame, truth);
    EXPECT_EQ(e.truth, 5u);
    EXPECT_EQ(e.pixels, 4u);
    EXPECT_DOUBLE_EQ(e.share(), 0.8);
    const double log_squares = std::pow(std::log(1.25), 2) + std::pow(std::log(1.5), 2) + std::pow(std::log(2), 2);
    expect_figures(e, {(0.25 + 0.5 + 0.5) / 4, (0.25 + 1 + 0.5) / 4, std::sqrt((1 + 4 + 1) / 4.),
                       std::sqrt(log_squares / 4), 0.25, 0.75, 0.75});
}

TEST(EngineDepthError, true_depth_beyond_the_cap_does_not_count_and_that_of_a_frame_is_cut_to_it)
{
    const std::vector<float> frame = {90, 8, 5}, truth = {8, 90, 5};
    const DepthErrors e = depth_errors(frame, truth, 10);
    EXPECT_EQ(e.truth, 2u);
    EXPECT_EQ(e.pixels, 2u);
    expect_figures(e, {0.125, 0.25, std::sqrt(2.), std::log(1.25) / std::sqrt(2), 0.5, 1, 1});
}

TEST(EngineDepthError, sums_of_frames_are_those_of_all_pixels)
{
    std::mt19937 random(1);
    std::vector<float> frame(300), truth(300);
    for (size_t i = 0; i < frame.size(); ++i) {
        truth[i] = random() % 5 ? float(random() % 1000) / 50 : 0;
        frame[i] = random() % 5 ? float(random() % 1000) / 50 : 0;
    }
    const std::span<const float> f = frame, t = truth;
    DepthErrors sum = depth_errors(f.first(100), t.first(100));
    sum += depth_errors(f.subspan(100), t.subspan(100));
    const DepthErrors all = depth_errors(f, t);
    EXPECT_EQ(sum.truth, all.truth);
    EXPECT_EQ(sum.pixels, all.pixels);
    expect_figures(sum, all.figures());
    EXPECT_EQ(depth_errors({}, {}).share(), 0);
}

} // namespace engine_depth_error_test
} // namespace semrover
