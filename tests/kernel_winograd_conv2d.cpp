// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "tests/support/kernel_case.h"

#include <cmath>

namespace semrover {
namespace kernel_winograd_conv2d_test {

struct WinogradCase {
    uint32_t batch, height, width, channels, outputs;
    uint32_t up_height = 0, up_width = 0;
    bool bias = true, addends = false;
};

// one pixel; whole tiles; odd sizes and channels, two images; one more than a tile; upsampling to even and odd sizes
const WinogradCase kCases[] = {
    {1, 1, 1, 1, 1, 0, 0, false}, {1, 8, 8, 8, 16},       {2, 5, 7, 13, 20},  {1, 9, 13, 40, 72},
    {1, 4, 5, 8, 8, 8, 10},       {2, 4, 5, 16, 8, 7, 9}, {1, 3, 50, 64, 64}, {2, 6, 9, 16, 20, 0, 0, true, true},
};

struct Convolution {
    FeatureMap x; // sizes only
    HostMatrix data, w, bias, y, table, residual;
    std::vector<uint32_t> table_row;
    uint32_t bands = 0;
};

Convolution convolve(const WinogradCase& c, DType dtype, DType w_dtype)
{
    KernelCase k(test_device());
    Convolution r;
    r.x = {{}, c.batch, c.height, c.width};
    r.data = k.random(c.batch * r.x.image_rows(), c.channels, dtype);
    r.w = k.random(c.outputs, 9 * round_up(c.channels, kRowPadding), w_dtype);
    r.bias = k.random(1, c.outputs, DType::f32);
    ConvOptions o;
    o.upsampled_height = c.up_height;
    o.upsampled_width = c.up_width;
    o.dtype = dtype;
    r.table = k.random(3, c.outputs + 12, DType::f32);
    r.table_row = k.indices(c.batch, 3);
    r.residual = k.random(r.data.rows, c.outputs, dtype);
    ConvAddends add;
    if (c.addends) {
        add.shift = {k.input(r.table), k.input(r.table_row), 4};
        add.residual = r.x.with(k.input(r.residual));
    }
    const Tensor u = winograd_weight(k.graph, k.input(r.w));
    const Tensor bias = c.bias ? k.input(r.bias) : Tensor{};
    const FeatureMap y = winograd_conv2d(k.graph, r.x.with(k.input(r.data)), u, bias, o, add);
    EXPECT_EQ(y.height, c.up_height ? c.up_height : c.height);
    EXPECT_EQ(y.width, c.up_width ? c.up_width : c.width);
    r.y = k.run(y.data);
    k.expect_zero_padding(r.y);
    for (const Pass& pass : k.plan().passes)
        r.bands += pass.kernel->name == "winograd_output";
    return r;
}

// one pixel and channel of y, in double; magnitude: sum of |terms|
double reference(const WinogradCase& c, const Convolution& r, uint32_t image, int y, int x, uint32_t n,
                 double& magnitude)
{
    const bool up = c.up_height != 0;
    const int seen_height = int(up ? c.up_height : c.height), seen_width = int(up ? c.up_width : c.width);
    double sum = c.bias ? r.bias.at(0, n) : 0;
    if (c.addends)
        sum += double(r.table.at(r.table_row[image], 4 + n)) +
               r.residual.at(image * r.x.image_rows() + uint32_t(y) * c.width + uint32_t(x), n);
    magnitude = std::abs(sum);
    for (int tap = 0; tap < 9; ++tap) {
        const int sy = y + tap / 3 - 1, sx = x + tap % 3 - 1;
        if (sy < 0 || sx < 0 || sy >= seen_height || sx >= seen_width)
            continue;
        const uint32_t row = image * r.x.image_rows() + uint32_t(sy >> up) * c.width + uint32_t(sx >> up);
        for (uint32_t k = 0; k < c.channels; ++k) {
            const double term =
                double(r.data.at(row, k)) * r.w.at(n, uint32_t(tap) * round_up(c.channels, kRowPadding) + k);
            sum += term;
            magnitude += std::abs(term);
        }
    }
    return sum;
}

// every `step`th pixel, and the last one
void check(const WinogradCase& c, const Convolution& r, DType dtype, uint32_t step)
{
    const uint32_t height = c.up_height ? c.up_height : c.height, width = c.up_width ? c.up_width : c.width;
    const uint32_t image_rows = r.y.rows / c.batch;
    for (uint32_t image = 0; image < c.batch; ++image)
        for (uint32_t at = 0; at < height * width; at = at + step < height * width ? at + step : at + 1)
            for (uint32_t n = 0; n < c.outputs; ++n) {
                double magnitude;
                const double v = reference(c, r, image, int(at / width), int(at % width), n, magnitude);
                const double half = dtype == DType::f16 ? 3e-8 + 6e-4 * std::abs(v) : 0;
                ASSERT_NEAR(r.y.at(image * image_rows + at, n), v, 1e-6 * (10 + magnitude) + half)
                    << "image " << image << " pixel " << at << " channel " << n;
            }
    for (float v : r.y.values) // padding rows too
        ASSERT_TRUE(std::isfinite(v));
}

TEST(kernel_winograd_conv2d, matches_a_convolution_in_double)
{
    for (const WinogradCase& c : kCases)
        for (DType dtype : {DType::f32, DType::f16}) {
            SCOPED_TRACE(fmt::format("{} x {}x{}x{} -> {} {}", c.batch, c.height, c.width, c.channels, c.outputs,
                                     dtype_name(dtype)));
            check(c, convolve(c, dtype, dtype), dtype, 1);
        }
    for (const WinogradCase& c : {WinogradCase{1, 9, 13, 32, 72}, WinogradCase{2, 5, 7, 96, 20}})
        check(c, convolve(c, DType::f16, DType::q8_0), DType::f16, 1);
}

TEST(kernel_winograd_conv2d, does_large_images_in_bands_of_tiles)
{
    if (test_device().limits().max_texel_elements < 4u << 20)
        GTEST_SKIP() << "bands are of 64 MiB, which this device cannot bind as texels";
    const WinogradCase c{1, 259, 261, 64, 64};
    const Convolution r = convolve(c, DType::f16, DType::f16);
    EXPECT_GT(r.bands, 1u);
    check(c, r, DType::f16, 997);
}

// Winograd's sums have other bits than direct ones
TEST(kernel_winograd_conv2d, is_chosen_by_the_image_and_not_by_how_many_there_are)
{
    DeviceLimits limits;
    limits.max_texel_elements = 1 << 27;
    ConvOptions o;
    o.kernel = 3;
    uint32_t chosen = 0, others = 0;
    for (uint32_t height = 4; height <= 40; ++height)
        for (uint32_t width = 4; width <= 40; width += 3) {
            const auto prefers = [&](uint32_t images) {
                Graph g(limits);
                return prefers_winograd(limits, feature_map(g, images, height, width, 128, DType::f16, "x"), 128, o);
            };
            for (uint32_t images : {2u, 3u, 8u})
                ASSERT_EQ(prefers(images), prefers(1)) << images << " images of " << width << "x" << height;
            ++(prefers(1) ? chosen : others);
        }
    EXPECT_GT(chosen, 50u);
    EXPECT_GT(others, 50u);
}

} // namespace kernel_winograd_conv2d_test
} // namespace semrover
