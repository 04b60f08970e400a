// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "tests/support/feature_map_case.h"

namespace semrover {
namespace kernel_channel_shift_test {

// of an image that no convolution makes, so that the op runs by itself
TEST(kernel_channel_shift, adds_the_row_of_each_image_to_every_pixel)
{
    for (const auto& [batch, height, width, channels] :
         {std::array{1u, 1u, 1u, 1u}, {2u, 8u, 8u, 64u}, {3u, 5u, 7u, 61u}})
        for (DType dtype : {DType::f32, DType::f16}) {
            KernelCase k(test_device());
            const HostImages x = random_images(k, batch, height, width, channels, dtype);
            const HostMatrix table = k.random(4, 80, DType::f32);
            const std::vector<uint32_t> table_row = k.indices(batch, 4);
            const FeatureMap y = channel_shift(k.graph, x.input(k), {k.input(table), k.input(table_row), 8});
            const HostImages got{y.height, y.width, k.run(y.data)};
            EXPECT_EQ(k.plan().passes.size(), 1u);
            for (uint32_t image = 0; image < batch; ++image)
                for (uint32_t p = 0; p < height * width; ++p)
                    for (uint32_t n = 0; n < channels; ++n) {
                        const uint32_t oy = p / width, ox = p % width;
                        const double expected = double(x.at(image, oy, ox, n)) + table.at(table_row[image], 8 + n);
                        const double relative = dtype == DType::f16 ? 4.9e-4 : 6e-8; // rounded once
                        ASSERT_NEAR(got.at(image, oy, ox, n), expected, relative * std::abs(expected) + 3e-8);
                    }
            k.expect_zero_padding(got.rows);
        }
}

} // namespace kernel_channel_shift_test
} // namespace semrover
