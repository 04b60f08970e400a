// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "kernels/recognition.h"
#include "tests/support/feature_map_case.h"

#include <cmath>

namespace semrover {
namespace kernel_resize_bilinear_test {

struct ResizeCase {
    uint32_t images, height, width, out_height, out_width;
};
// one pixel either way; the same size; smaller, larger, one of each; more than the device's rows of a group
const ResizeCase kCases[] = {{1, 1, 1, 1, 1},        {1, 1, 1, 5, 7},   {2, 6, 5, 6, 5},
                             {3, 31, 18, 7, 9},      {2, 5, 7, 23, 29}, {1, 40, 3, 9, 17},
                             {1, 424, 616, 149, 99}, {1, 2, 2, 4, 4},   {1, 37, 3001, 3, 2}};

double source(uint32_t i, uint32_t in, uint32_t out)
{
    return std::max((i + 0.5) * double(in) / double(out) - 0.5, 0.);
}

double resized(const ResizeCase& c, const std::vector<uint8_t>& bytes, uint32_t image, uint32_t y, uint32_t x,
               uint32_t channel, const std::array<float, 3>& shift, const std::array<float, 3>& scale)
{
    const double v = source(y, c.height, c.out_height), u = source(x, c.width, c.out_width);
    const auto at = [&](uint32_t row, uint32_t col) {
        row = std::min(row, c.height - 1);
        col = std::min(col, c.width - 1);
        return double(bytes[((size_t(image) * c.height + row) * c.width + col) * 3 + channel]);
    };
    const uint32_t row = uint32_t(v), col = uint32_t(u);
    const double b = v - row, a = u - col;
    const double top = (1 - a) * at(row, col) + a * at(row, col + 1);
    const double bottom = (1 - a) * at(row + 1, col) + a * at(row + 1, col + 1);
    return (2 * ((1 - b) * top + b * bottom) / 255 - 1 - shift[channel]) / scale[channel];
}

void check(const ResizeCase& c, DType dtype, const std::array<float, 3>& shift = {0, 0, 0},
           const std::array<float, 3>& scale = {1, 1, 1})
{
    SCOPED_TRACE(fmt::format("{} x {}x{} -> {}x{} {}", c.images, c.height, c.width, c.out_height, c.out_width,
                             dtype_name(dtype)));
    KernelCase k(test_device());
    const size_t image_bytes = size_t(c.height) * c.width * 3;
    std::vector<uint8_t> bytes;
    for (uint32_t v : k.indices(uint32_t(c.images * image_bytes), 256))
        bytes.push_back(uint8_t(v));
    const uint32_t words = rgb_words(c.height, c.width);
    std::vector<uint32_t> packed(c.images * words, 0xffffffffu);
    for (uint32_t i = 0; i < c.images; ++i)
        std::memcpy(&packed[i * words], &bytes[i * image_bytes], image_bytes);
    const FeatureMap y = resize_bilinear(k.graph, k.input(packed, words),
                                         {c.height, c.width, c.out_height, c.out_width, dtype, shift, scale});
    const HostImages got{y.height, y.width, k.run(y.data)};
    for (uint32_t i = 0; i < c.images; ++i)
        for (uint32_t p = 0; p < y.pixels(); ++p)
            for (uint32_t n = 0; n < 3; ++n) {
                const double v = resized(c, bytes, i, p / y.width, p % y.width, n, shift, scale);
                const double tolerance = 1e-6 / scale[n] + (dtype == DType::f16 ? 5e-4 * std::max(std::abs(v), 1.) : 0);
                ASSERT_NEAR(got.at(i, p / y.width, p % y.width, n), v, tolerance) << "image " << i << " pixel " << p;
            }
    k.expect_zero_padding(got.rows);
}

TEST(kernel_resize_bilinear, matches_interpolation_in_double)
{
    for (const ResizeCase& c : kCases)
        for (DType dtype : {DType::f32, DType::f16})
            check(c, dtype);
}

TEST(kernel_resize_bilinear, shifts_and_scales_channels)
{
    check({2, 6, 5, 6, 5}, DType::f32, {-.030f, -.088f, -.188f}, {.458f, .448f, .450f});
    check({1, 31, 18, 7, 9}, DType::f16, {0.5f, 0, -2}, {2, 1, 0.25f});
}

} // namespace kernel_resize_bilinear_test
} // namespace semrover
