// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "kernels/sampling.h"
#include "shaders/lib/step_row.h"
#include "tests/support/kernel_case.h"

namespace semrover {
namespace kernel_renderer_input_test {

struct Case {
    uint32_t rows, channels, halves;
    bool previous = true; // the network sees the frame before

    uint32_t latents() const { return previous ? 3 : 2; }
};
// a latent of 53 x 77, the reference pictures', at the end
const Case kCases[] = {{1, 4, 1},         {16, 4, 2},        {48, 3, 2},        {32, 5, 1},
                       {37, 16, 2},       {37, 1, 2},        {4096, 4, 2},      {1, 4, 1, false},
                       {32, 4, 2, false}, {37, 5, 2, false}, {48, 16, 1, false}};

struct Inputs {
    HostMatrix x, previous, buffer, visible;
};

float reference(const Inputs& in, const Case& c, float scale, uint32_t row, uint32_t col)
{
    const uint32_t from = row % c.rows, part = col / c.channels, channel = col % c.channels;
    const bool conditional = row < c.rows;
    if (part == 0)
        return scale * in.x.at(from, channel);
    if (part + 1 == c.latents())
        return in.buffer.at(from, channel);
    if (!conditional)
        return 0;
    return part == 1 ? in.previous.at(from, channel) : in.visible.at(from, 0);
}

void check(const Case& c, DType dtype)
{
    SCOPED_TRACE(fmt::format("{} rows, {} channels, {} halves, {}", c.rows, c.channels, c.halves, dtype_name(dtype)));
    constexpr float kScale = 0.625f;
    KernelCase k(test_device());
    Inputs in;
    for (HostMatrix* latent : {&in.x, &in.previous, &in.buffer})
        *latent = k.random(c.rows, c.channels, DType::f32);
    in.visible = k.random(c.rows, 1, DType::f32);
    StepRow rows[3] = {};
    rows[1].in_scale = kScale;
    std::vector<uint32_t> words(sizeof(rows) / 4);
    std::memcpy(words.data(), rows, sizeof(rows));
    const StepTable steps{k.input(words, 16), k.input(std::vector<uint32_t>{1, 0})};
    const RendererFrame frame{c.previous ? k.input(in.previous) : Tensor{}, k.input(in.buffer), k.input(in.visible)};
    const HostMatrix y = k.run(renderer_input(k.graph, steps, k.input(in.x), frame, c.halves, dtype));
    ASSERT_EQ(y.rows, c.rows * c.halves);
    ASSERT_EQ(y.cols, c.latents() * c.channels + 1);
    for (uint32_t row = 0; row < y.rows; ++row)
        for (uint32_t col = 0; col < y.cols; ++col) {
            const float expected = reference(in, c, kScale, row, col);
            // fp32: one product; fp16: half a unit in the last of 11 bits
            const float tolerance = dtype == DType::f16 ? std::abs(expected) / 2048 + 1e-7f : 1e-6f;
            ASSERT_NEAR(y.at(row, col), expected, tolerance) << "row " << row << " column " << col;
        }
    k.expect_zero_padding(y);
}

TEST(kernel_renderer_input, joins_state_frame_before_buffer_and_visibility_and_hides_two_of_them_from_the_second_half)
{
    for (const Case& c : kCases)
        for (DType dtype : {DType::f32, DType::f16})
            check(c, dtype);
}

} // namespace kernel_renderer_input_test
} // namespace semrover
