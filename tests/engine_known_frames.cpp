// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/deferred/vsd.h"

#include <cmath>
#include <gtest/gtest.h>

namespace semrover {
namespace engine_known_frames_test {

// rows of these levels of noise, sigma
SamplingPlan plan(std::initializer_list<double> sigmas)
{
    SamplingPlan p;
    for (const double sigma : sigmas) {
        PlanRow row;
        row.coefficients.abar = 1 / (sigma * sigma + 1);
        p.rows.push_back(row);
    }
    return p;
}

TEST(engine_known_frames, weights_are_those_of_the_last_known_frame_where_noise_hides_everything)
{
    const auto w = known_frame_weights(plan({1e5}), 5, 2, 0.8);
    for (uint32_t f = 0; f < 5; ++f)
        for (uint32_t k = 0; k < 5; ++k) {
            const double expected = f >= 2 && k == 1 ? std::pow(0.8, f - 1) : 0;
            EXPECT_NEAR(w[f * 5 + k], expected, 1e-6) << f << " " << k;
        }
}

TEST(engine_known_frames, weights_fall_with_the_noise_and_with_the_distance)
{
    const auto w = known_frame_weights(plan({100, 1, 0.1, 0.001}), 6, 3, 0.9);
    const auto last = [&](size_t row, uint32_t frame) { return w[(row * 6 + frame) * 6 + 2]; };
    for (size_t row = 0; row < 3; ++row)
        EXPECT_GT(last(row, 3), last(row + 1, 3));
    EXPECT_GT(last(1, 3), last(1, 4));
    EXPECT_GT(last(1, 4), last(1, 5));
    EXPECT_LT(last(3, 3), 1e-5);
}

// two frames, one known: by hand. cov(x | noisy) = C (C + s)^-1 s
TEST(engine_known_frames, weights_are_those_of_the_formula)
{
    const double r = 0.7, s = 0.5 * 0.5;
    const double det = (1 + s) * (1 + s) - r * r; // (C + s)^-1 = [1 + s, -r; -r, 1 + s] / det
    const double same = ((1 + s) - r * r) / det, other = (r * (1 + s) - r) / det;
    const auto w = known_frame_weights(plan({0.5}), 2, 1, r);
    EXPECT_NEAR(w[2], other / same, 1e-6);
    EXPECT_EQ(w[0], 0);
    EXPECT_EQ(w[1], 0);
    EXPECT_EQ(w[3], 0);
}

TEST(engine_known_frames, nothing_is_carried_without_known_frames_or_without_others)
{
    for (const uint32_t known : {0u, 4u})
        for (const float w : known_frame_weights(plan({10, 1}), 4, known, 0.9))
            EXPECT_EQ(w, 0);
}

} // namespace engine_known_frames_test
} // namespace semrover
