// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "kernels/sampling.h"
#include "shaders/lib/step_row.h"
#include "tests/support/kernel_case.h"

#include <algorithm>

namespace semrover {
namespace kernel_step_carry_test {

constexpr float kFactor = 0.75f; // c_x0 of the step

struct Case {
    uint32_t frames, frame_rows, channels, known;
};

// the second of two steps; the table of steps has a row before them
TEST(kernel_step_carry, adds_what_known_frames_are_off_by_to_the_others)
{
    for (const Case& c :
         {Case{1, 1, 1, 0}, {2, 1, 1, 1}, {5, 16, 4, 2}, {12, 48, 4, 4}, {3, 7, 9, 3}, {64, 16, 4, 63}}) {
        KernelCase k(test_device());
        const uint32_t rows = c.frames * c.frame_rows;
        const HostMatrix fixed = k.random(rows, c.channels, DType::f32), x = k.random(rows, c.channels, DType::f32),
                         x0 = k.random(rows, c.channels, DType::f32);
        const HostMatrix weights = k.random(2 * c.frames, c.frames, DType::f32);
        std::vector<float> table; // without padding
        for (uint32_t r = 0; r < 2 * c.frames; ++r)
            for (uint32_t f = 0; f < c.frames; ++f)
                table.push_back(weights.at(r, f));
        std::vector<StepRow> step_rows(3, StepRow{});
        step_rows[2].c_x0 = kFactor;
        std::vector<uint32_t> words(3 * sizeof(StepRow) / 4), known(rows, 0);
        std::memcpy(words.data(), step_rows.data(), words.size() * 4);
        std::fill_n(known.begin(), c.known * c.frame_rows, 1u);
        const StepTable steps{k.input(words, sizeof(StepRow) / 4), k.input(std::vector<uint32_t>{2, 0})};
        const Tensor state_x = k.input(x), state_x0 = k.input(x0);
        step_carry(k.graph, steps, {k.input(table, c.frames), c.frames, 1}, k.input(known), k.input(fixed), state_x,
                   state_x0);
        ASSERT_TRUE(k.compile_and_run());
        const HostMatrix results[] = {k.read(state_x), k.read(state_x0)};
        for (uint32_t r = 0; r < rows; ++r)
            for (uint32_t col = 0; col < c.channels; ++col) {
                const uint32_t frame = r / c.frame_rows, pixel = r % c.frame_rows;
                double d = 0;
                for (uint32_t f = 0; frame >= c.known && f < c.known; ++f) {
                    const uint32_t at = f * c.frame_rows + pixel;
                    d += weights.at(c.frames + frame, f) * (fixed.at(at, col) - x0.at(at, col));
                }
                ASSERT_NEAR(results[0].at(r, col), x.at(r, col) + kFactor * d, 2e-5) << r << " " << col;
                ASSERT_NEAR(results[1].at(r, col), x0.at(r, col) + d, 2e-5) << r << " " << col;
            }
    }
}

} // namespace kernel_step_carry_test
} // namespace semrover
