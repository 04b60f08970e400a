// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "tests/support/feature_map_case.h"

namespace semrover {
namespace kernel_split_k_reduce_test {

struct Case {
    uint32_t batch, height, width, channels, slices;
};

FeatureMap reduced(KernelCase& k, const Case& c, DType dtype, const HostMatrix& sums, Tensor bias)
{
    const FeatureMap y = feature_map(k.graph, c.batch, c.height, c.width, c.channels, dtype, "y");
    split_k_reduce(k.graph, k.input(sums), c.slices, bias, y);
    return y;
}

// every device runs it here; in conv2d only those with matrix units do
TEST(kernel_split_k_reduce, adds_slices_and_does_the_epilogue_of_the_convolution)
{
    for (const Case& c : {Case{1, 1, 1, 1, 2}, Case{2, 5, 7, 40, 4}, Case{3, 8, 8, 72, 16}, Case{2, 3, 5, 13, 8}})
        for (DType dtype : {DType::f32, DType::f16}) {
            SCOPED_TRACE(fmt::format("{} channels, {} slices, {}", c.channels, c.slices, dtype_name(dtype)));
            KernelCase k(test_device());
            const uint32_t ld = round_up(c.channels, kRowPadding), pixels = c.height * c.width;
            const HostImages residual = random_images(k, c.batch, c.height, c.width, c.channels, dtype);
            const HostMatrix sums = k.random(residual.rows.rows, c.slices * ld, DType::f32);
            const HostMatrix bias = k.random(1, c.channels, DType::f32), table = k.random(3, 80, DType::f32);
            const std::vector<uint32_t> table_row = k.indices(c.batch, 3);
            FeatureMap y = reduced(k, c, dtype, sums, k.input(bias));
            y = channel_shift(k.graph, y, {k.input(table), k.input(table_row), 4});
            y = y.with(add(k.graph, y.data, residual.input(k).data));
            const Tensor moments = channel_moments(k.graph, y);
            const Tensor out = k.output(moments.rows, moments.cols, DType::f32, moments.ld);
            k.graph.keep(moments, out);
            const HostImages got{y.height, y.width, k.run(y.data)};
            const HostMatrix statistics = k.read(out);
            EXPECT_EQ(k.plan().passes.size(), 1u); // everything is in the epilogue
            const uint32_t image_rows = y.image_rows();
            for (uint32_t image = 0; image < c.batch; ++image)
                for (uint32_t n = 0; n < c.channels; ++n) {
                    for (uint32_t p = 0; p < pixels; ++p) {
                        double v = double(bias.at(0, n)) + table.at(table_row[image], 4 + n), magnitude = 2;
                        for (uint32_t slice = 0; slice < c.slices; ++slice) {
                            v += sums.at(image * image_rows + p, slice * ld + n);
                            magnitude += std::abs(sums.at(image * image_rows + p, slice * ld + n));
                        }
                        v += residual.at(image, p / c.width, p % c.width, n);
                        ASSERT_NEAR(got.at(image, p / c.width, p % c.width, n), v,
                                    1e-6 * magnitude + (dtype == DType::f16 ? 6e-4 * std::abs(v) : 0));
                    }
                    for (uint32_t first = 0; first < pixels; first += 16) { // of what is stored
                        const uint32_t count = std::min(16u, pixels - first), row = (image * image_rows + first) / 16;
                        double mean = 0, m2 = 0;
                        for (uint32_t p = first; p < first + count; ++p)
                            mean += got.at(image, p / c.width, p % c.width, n) / double(count);
                        for (uint32_t p = first; p < first + count; ++p)
                            m2 += std::pow(got.at(image, p / c.width, p % c.width, n) - mean, 2);
                        ASSERT_NEAR(statistics.at(row, 2 * n), mean, 1e-5);
                        ASSERT_NEAR(statistics.at(row, 2 * n + 1), m2, 1e-5 * (1 + m2));
                    }
                }
            k.expect_zero_padding(got.rows);
        }
}

} // namespace kernel_split_k_reduce_test
} // namespace semrover
