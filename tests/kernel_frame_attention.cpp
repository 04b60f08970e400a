// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "tests/support/softmax_sum.h"

namespace semrover {
namespace kernel_frame_attention_test {

struct FrameCase {
    uint32_t videos, frames, image_rows, heads, head_dim;
    float scale = 0, spread = 1;
};
// one of everything; two and odd numbers of frames; several videos; as many frames as there may be; large scores
const FrameCase kCases[] = {
    {1, 1, 16, 1, 8},         {1, 2, 16, 3, 16},          {2, 5, 16, 2, 40},  {1, 7, 48, 5, 64},
    {2, 25, 32, 1, 24, 0.5f}, {1, kMostFrames, 16, 2, 8}, {3, 4, 16, 1, 160}, {1, 6, 16, 2, 64, 0, 300},
};

// one head of one frame of a pixel, in double
SoftmaxSum reference(const HostMatrix& qkv, const FrameCase& c, uint32_t video, uint32_t pixel, uint32_t frame,
                     uint32_t head)
{
    const uint32_t width = c.heads * c.head_dim, at = head * c.head_dim;
    const auto row = [&](uint32_t f) { return (video * c.frames + f) * c.image_rows + pixel; };
    const double scale = c.scale > 0 ? double(c.scale) : 1 / std::sqrt(double(c.head_dim));
    std::vector<double> scores(c.frames);
    double largest = -1e300;
    for (uint32_t j = 0; j < c.frames; ++j) {
        for (uint32_t d = at; d < at + c.head_dim; ++d)
            scores[j] += double(qkv.at(row(frame), d)) * qkv.at(row(j), width + d);
        scores[j] *= scale;
        largest = std::max(largest, scores[j]);
    }
    SoftmaxSum sum(c.head_dim);
    for (uint32_t j = 0; j < c.frames; ++j)
        sum.add(std::exp(scores[j] - largest), [&](uint32_t d) { return qkv.at(row(j), 2 * width + at + d); });
    sum.finish();
    return sum;
}

void check(const FrameCase& c, DType dtype)
{
    SCOPED_TRACE(fmt::format("{} videos of {} frames, {} rows, {} heads of {} {}", c.videos, c.frames, c.image_rows,
                             c.heads, c.head_dim, dtype_name(dtype)));
    KernelCase k(test_device());
    const uint32_t width = c.heads * c.head_dim;
    const HostMatrix qkv = k.random(c.videos * c.frames * c.image_rows, 3 * width, dtype, c.spread);
    FrameAttentionOptions o;
    o.heads = c.heads;
    o.head_dim = c.head_dim;
    o.scale = c.scale;
    o.videos = c.videos;
    o.frames = c.frames;
    o.image_rows = c.image_rows;
    const HostMatrix y = k.run(frame_attention(k.graph, k.input(qkv), o));
    ASSERT_EQ(y.cols, width);
    const double tolerance = c.spread > 1 ? 2e-2 * c.spread : 3e-6; // scores reach 1e5, where fp32 resolves 1e-2
    for (uint32_t row = 0; row < qkv.rows; ++row)
        for (uint32_t head = 0; head < c.heads; ++head) {
            const uint32_t image = row / c.image_rows;
            const SoftmaxSum sum = reference(qkv, c, image / c.frames, row % c.image_rows, image % c.frames, head);
            for (uint32_t d = 0; d < c.head_dim; ++d)
                ASSERT_NEAR(y.at(row, head * c.head_dim + d), sum.y[d], tolerance + sum.tolerance(d, dtype, false))
                    << "row " << row << " head " << head << " channel " << d;
        }
}

TEST(kernel_frame_attention, matches_a_softmax_in_double_over_the_frames_of_each_pixel)
{
    for (const FrameCase& c : kCases)
        for (DType dtype : {DType::f32, DType::f16})
            check(c, dtype);
}

} // namespace kernel_frame_attention_test
} // namespace semrover
