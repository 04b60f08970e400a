// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "tests/support/feature_map_case.h"

namespace semrover {
namespace kernel_frames_as_rows_test {

struct FramesCase {
    uint32_t videos, frames, height, width, channels, outputs;
};
const FramesCase kCases[] = {{1, 1, 1, 1, 3, 5}, {2, 5, 3, 5, 13, 20}, {1, 4, 4, 4, 32, 64}, {3, 2, 5, 7, 16, 9}};

// taps one frame before, at, and one after; nothing before the first and after the last frame of a video
double naive(const FramesCase& c, const HostImages& x, const HostMatrix& w, uint32_t image, uint32_t pixel, uint32_t n,
             double& magnitude)
{
    double sum = 0;
    const uint32_t frame = image % c.frames;
    for (uint32_t tap = 0; tap < 3; ++tap) {
        if (frame + tap < 1 || frame + tap > c.frames)
            continue;
        for (uint32_t k = 0; k < c.channels; ++k) {
            const double term = double(x.at(image + tap - 1, pixel / c.width, pixel % c.width, k)) *
                                w.at(n, tap * round_up(c.channels, 8) + k);
            sum += term;
            magnitude += std::abs(term);
        }
    }
    return sum;
}

void check(const FramesCase& c, DType dtype)
{
    SCOPED_TRACE(fmt::format("{} videos of {} frames {}x{}x{} {}", c.videos, c.frames, c.height, c.width, c.channels,
                             dtype_name(dtype)));
    KernelCase k(test_device());
    const HostImages x = random_images(k, c.videos * c.frames, c.height, c.width, c.channels, dtype);
    const HostMatrix w = k.random(c.outputs, 3 * round_up(c.channels, 8), dtype);
    const HostMatrix bias = k.random(1, c.outputs, DType::f32);
    ConvOptions options;
    options.taps = {.height = 3, .width = 1, .padding_y = 1};
    options.dtype = dtype;
    const FeatureMap in = x.input(k);
    const FeatureMap y = conv2d(k.graph, frames_as_rows(in, c.frames), {}, k.input(w), k.input(bias), options);
    ASSERT_EQ(y.data.rows, in.data.rows);
    const HostImages got{c.height, c.width, k.run(y.data)};
    for (uint32_t image = 0; image < in.batch; ++image)
        for (uint32_t pixel = 0; pixel < c.height * c.width; ++pixel)
            for (uint32_t n = 0; n < c.outputs; ++n) {
                double magnitude = 0;
                const double sum = naive(c, x, w, image, pixel, n, magnitude) + bias.at(0, n);
                const double tolerance = 1e-6 * (magnitude + 1) + (dtype == DType::f16 ? 6e-4 * std::abs(sum) : 0);
                ASSERT_NEAR(got.at(image, pixel / c.width, pixel % c.width, n), sum, tolerance)
                    << "image " << image << " pixel " << pixel << " output " << n;
            }
}

TEST(kernel_frames_as_rows, lets_a_convolution_reach_to_the_same_pixel_of_the_frames_around)
{
    for (const FramesCase& c : kCases)
        for (DType dtype : {DType::f32, DType::f16})
            check(c, dtype);
}

} // namespace kernel_frames_as_rows_test
} // namespace semrover
