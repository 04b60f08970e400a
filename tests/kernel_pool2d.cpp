// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "kernels/recognition.h"
#include "tests/support/feature_map_case.h"

#include <cmath>

namespace semrover {
namespace kernel_pool2d_test {

struct PoolCase {
    uint32_t batch, height, width, channels;
    PoolOptions options;
};

// one pixel; Inception's three kinds; the mean of whole images; members of groups; odd windows and strides
const PoolCase kCases[] = {
    {1, 1, 1, 1, {false, 1, 1, 1, 1, 0, 0}},     {2, 9, 8, 13, {false, 3, 3, 2, 2, 0, 0}},
    {2, 7, 7, 24, {true, 3, 3, 1, 1, 1, 1}},     {1, 8, 8, 20, {false, 3, 3, 1, 1, 1, 1}},
    {3, 8, 8, 40, {true, 8, 8, 1, 1, 0, 0}},     {1, 96, 1, 33, {false, 32, 1, 32, 1, 0, 0}},
    {2, 11, 17, 8, {true, 4, 5, 3, 2, 2, 3}},    {1, 5, 6, 9, {false, 2, 6, 3, 1, 1, 0}},
    {2, 147, 33, 16, {false, 3, 3, 2, 2, 0, 0}},
};

double pooled(const PoolCase& c, const HostImages& x, uint32_t image, uint32_t oy, uint32_t ox, uint32_t channel)
{
    const PoolOptions& o = c.options;
    double sum = 0, most = -INFINITY;
    int count = 0;
    for (int i = 0; i < int(o.kernel_height); ++i)
        for (int j = 0; j < int(o.kernel_width); ++j) {
            const int y = int(oy * o.stride_y) - int(o.padding_y) + i, at = int(ox * o.stride_x) - int(o.padding_x) + j;
            if (y < 0 || at < 0 || y >= int(c.height) || at >= int(c.width))
                continue;
            const double v = x.at(image, uint32_t(y), uint32_t(at), channel);
            sum += v;
            most = std::max(most, v);
            ++count;
        }
    return o.mean ? sum / count : most;
}

void check(const PoolCase& c, DType dtype)
{
    SCOPED_TRACE(fmt::format("{} x {}x{}x{} window {}x{} {}", c.batch, c.height, c.width, c.channels,
                             c.options.kernel_height, c.options.kernel_width, dtype_name(dtype)));
    KernelCase k(test_device());
    const HostImages x = random_images(k, c.batch, c.height, c.width, c.channels, dtype);
    const FeatureMap y = pool2d(k.graph, x.input(k), c.options);
    const HostImages got{y.height, y.width, k.run(y.data)};
    ASSERT_EQ(y.height, (c.height + 2 * c.options.padding_y - c.options.kernel_height) / c.options.stride_y + 1);
    ASSERT_EQ(y.width, (c.width + 2 * c.options.padding_x - c.options.kernel_width) / c.options.stride_x + 1);
    for (uint32_t image = 0; image < y.batch; ++image)
        for (uint32_t p = 0; p < y.pixels(); ++p)
            for (uint32_t n = 0; n < c.channels; ++n) {
                const double v = pooled(c, x, image, p / y.width, p % y.width, n);
                const double tolerance = c.options.mean ? 1e-6 + (dtype == DType::f16 ? 5e-4 * std::abs(v) : 0) : 0;
                ASSERT_NEAR(got.at(image, p / y.width, p % y.width, n), v, tolerance)
                    << "image " << image << " pixel " << p << " channel " << n;
            }
    k.expect_zero_padding(got.rows);
}

TEST(kernel_pool2d, matches_windows_in_double_that_leave_out_what_is_outside)
{
    for (const PoolCase& c : kCases)
        for (DType dtype : {DType::f32, DType::f16})
            check(c, dtype);
}

TEST(kernel_pool2d, writes_columns_of_a_wider_tensor_and_no_others)
{
    KernelCase k(test_device());
    const HostImages x = random_images(k, 1, 6, 5, 11, DType::f32);
    const Tensor wide = k.output(round_up(30, kImageRowPadding), 40, DType::f32);
    pool2d(k.graph, x.input(k), {.padding_y = 1, .padding_x = 1}, {.whole = wide, .col = 8});
    ASSERT_TRUE(k.compile_and_run());
    const HostMatrix got = k.read(wide);
    for (uint32_t r = 0; r < 30; ++r) {
        ASSERT_TRUE(std::isnan(got.at(r, 7)) && std::isnan(got.at(r, 24)));
        ASSERT_EQ(got.at(r, 19), 0);
        ASSERT_EQ(got.at(r, 18),
                  float(pooled({1, 6, 5, 11, {.padding_y = 1, .padding_x = 1}}, x, 0, r / 5, r % 5, 10)));
    }
}

// on a device that binds less than the tensors
TEST(kernel_pool2d, gives_the_same_bits_in_bands_of_rows)
{
    std::vector<float> results[2];
    for (const bool banded : {false, true}) {
        auto device = Device::create({.limits = banded ? "range=32768" : ""});
        ASSERT_TRUE(device) << device.error().message;
        KernelCase k(**device);
        const HostImages x = random_images(k, 2, 37, 23, 24, DType::f32);
        const FeatureMap y = pool2d(k.graph, x.input(k), {.mean = true, .padding_y = 1, .padding_x = 1});
        results[banded] = k.run(y.data).values;
        EXPECT_EQ(k.plan().passes.size() > 1, banded);
    }
    EXPECT_EQ(results[0], results[1]);
}

} // namespace kernel_pool2d_test
} // namespace semrover
