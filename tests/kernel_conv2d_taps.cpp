// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "tests/support/feature_map_case.h"

#include <cmath>

namespace semrover {
namespace kernel_conv2d_taps_test {

struct TapsCase {
    uint32_t batch, height, width, channels, outputs, stride;
    ConvOptions::Taps taps;
};
// the rectangles of Inception, one with padding of its own, and the first layer of AlexNet
const TapsCase kTaps[] = {
    {1, 1, 1, 3, 5, 1, {1, 1, 0, 0}},      {2, 9, 8, 13, 20, 1, {1, 7, 0, 3}}, {2, 8, 9, 16, 40, 1, {7, 1, 3, 0}},
    {1, 6, 7, 24, 9, 1, {1, 3, 0, 1}},     {1, 7, 6, 8, 16, 1, {3, 1, 1, 0}},  {2, 7, 11, 11, 72, 1, {5, 5, 2, 2}},
    {1, 11, 9, 3, 32, 2, {3, 3, 0, 0}},    {2, 10, 9, 9, 8, 1, {3, 3, 0, 0}},  {1, 9, 9, 8, 8, 2, {5, 3, 1, 0}},
    {2, 33, 22, 3, 17, 4, {11, 11, 2, 2}},
};

double convolve(const TapsCase& c, const HostImages& x, const HostMatrix& w, uint32_t image, int oy, int ox, uint32_t n,
                double& magnitude)
{
    double sum = 0;
    for (uint32_t tap = 0; tap < c.taps.height * c.taps.width; ++tap) {
        const int y = oy * int(c.stride) - int(c.taps.padding_y) + int(tap / c.taps.width);
        const int x_at = ox * int(c.stride) - int(c.taps.padding_x) + int(tap % c.taps.width);
        if (y < 0 || x_at < 0 || y >= int(c.height) || x_at >= int(c.width))
            continue;
        for (uint32_t k = 0; k < c.channels; ++k) {
            const double term =
                double(x.at(image, uint32_t(y), uint32_t(x_at), k)) * w.at(n, tap * round_up(c.channels, 8) + k);
            sum += term;
            magnitude += std::abs(term);
        }
    }
    return sum;
}

TEST(kernel_conv2d_taps, takes_rectangles_of_taps_and_writes_relu_into_columns_of_a_wider_tensor)
{
    for (const TapsCase& c : kTaps)
        for (DType dtype : {DType::f32, DType::f16}) {
            if (dtype == DType::f16 && c.outputs % 8 == 0)
                continue; // a pipeline more to compile and nothing new
            SCOPED_TRACE(fmt::format("{}x{} taps {}", c.taps.height, c.taps.width, dtype_name(dtype)));
            KernelCase k(test_device());
            const HostImages x = random_images(k, c.batch, c.height, c.width, c.channels, dtype);
            const uint32_t depth = c.taps.height * c.taps.width * round_up(c.channels, 8);
            const HostMatrix w = k.random(c.outputs, depth, dtype), bias = k.random(1, c.outputs, DType::f32);
            ConvOptions options;
            options.taps = c.taps;
            options.stride = c.stride;
            options.dtype = dtype;
            const FeatureMap y = conv2d(k.graph, x.input(k), {}, k.input(w), k.input(bias), options);
            ASSERT_EQ(y.height, (c.height + 2 * c.taps.padding_y - c.taps.height) / c.stride + 1);
            ASSERT_EQ(y.width, (c.width + 2 * c.taps.padding_x - c.taps.width) / c.stride + 1);
            const Tensor wide = k.output(y.data.rows, 16 + c.outputs + 24, dtype);
            relu(k.graph, y.data, {.whole = wide, .col = 16});
            const Status status = k.compile_and_run();
            ASSERT_TRUE(status) << status.error().message;
            EXPECT_EQ(k.plan().passes.size(), 1u);
            const HostImages got{y.height, y.width, k.read(wide)};
            for (uint32_t image = 0; image < y.batch; ++image)
                for (uint32_t p = 0; p < y.pixels(); ++p)
                    for (uint32_t n = 0; n < c.outputs; ++n) {
                        const uint32_t oy = p / y.width, ox = p % y.width;
                        double magnitude = 0;
                        const double v =
                            std::max(0., convolve(c, x, w, image, int(oy), int(ox), n, magnitude) + bias.at(0, n));
                        const double tolerance = 1e-6 * (magnitude + 4) + (dtype == DType::f16 ? 6e-4 * v : 0);
                        ASSERT_NEAR(got.at(image, oy, ox, 16 + n), v, tolerance) << "pixel " << p << " channel " << n;
                    }
            for (uint32_t r = 0; r < got.rows.rows; ++r) { // what others write is left alone
                ASSERT_TRUE(std::isnan(got.rows.at(r, 15)));
                ASSERT_TRUE(std::isnan(got.rows.at(r, 16 + round_up(c.outputs, 8))));
            }
        }
}

} // namespace kernel_conv2d_taps_test
} // namespace semrover
