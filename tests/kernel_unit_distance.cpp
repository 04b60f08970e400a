// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "kernels/recognition.h"
#include "tests/support/feature_map_case.h"

#include <cmath>

namespace semrover {
namespace kernel_unit_distance_test {

constexpr float kEps = 1e-10f;

struct DistanceCase {
    uint32_t batch, height, width, channels;
};
// one number; fewer channels than a row is padded to; AlexNet's widest; several images; more pixels than a group
const DistanceCase kCases[] = {{1, 1, 1, 1}, {2, 3, 7, 13}, {1, 5, 6, 384}, {3, 4, 4, 24}, {1, 101, 67, 8}};

double distance(const DistanceCase& c, const HostMatrix& a, const HostMatrix& b, const HostMatrix& w, uint32_t row)
{
    double aa = 0, bb = 0, sum = 0;
    for (uint32_t n = 0; n < c.channels; ++n) {
        aa += double(a.at(row, n)) * a.at(row, n);
        bb += double(b.at(row, n)) * b.at(row, n);
    }
    for (uint32_t n = 0; n < c.channels; ++n)
        sum +=
            w.at(0, n) * std::pow(a.at(row, n) / (std::sqrt(aa) + 1e-10) - b.at(row, n) / (std::sqrt(bb) + 1e-10), 2);
    return sum;
}

void check(const DistanceCase& c, DType dtype)
{
    SCOPED_TRACE(fmt::format("{} x {}x{}x{} {}", c.batch, c.height, c.width, c.channels, dtype_name(dtype)));
    KernelCase k(test_device());
    HostImages a = random_images(k, c.batch, c.height, c.width, c.channels, dtype);
    HostImages b = random_images(k, c.batch, c.height, c.width, c.channels, dtype);
    const HostMatrix w = k.random(1, c.channels, DType::f32);
    for (uint32_t n = 0; n < c.channels; ++n) { // a pixel without any length, and one that is the same in both
        a.rows.set(0, n, 0);
        if (c.width > 1)
            b.rows.set(1, n, a.rows.at(1, n));
    }
    const FeatureMap y = unit_distance(k.graph, a.input(k), b.input(k), k.input(w), kEps);
    ASSERT_EQ(y.channels(), 1u);
    const HostImages got{y.height, y.width, k.run(y.data)};
    for (uint32_t image = 0; image < c.batch; ++image)
        for (uint32_t p = 0; p < y.pixels(); ++p) {
            const double v = distance(c, a.rows, b.rows, w, image * a.image_rows() + p);
            // |w| up to about 4, squared differences of unit vectors up to 4 together
            ASSERT_NEAR(got.at(image, p / y.width, p % y.width, 0), v, 4e-6) << "image " << image << " pixel " << p;
        }
    if (c.width > 1) {
        EXPECT_EQ(got.at(0, 0, 1, 0), 0);
    }
    k.expect_zero_padding(got.rows);
}

TEST(kernel_unit_distance, is_the_weighted_distance_of_directions_and_zero_of_equal_ones)
{
    for (const DistanceCase& c : kCases)
        for (DType dtype : {DType::f32, DType::f16})
            check(c, dtype);
}

} // namespace kernel_unit_distance_test
} // namespace semrover
