// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "tests/support/kernel_case.h"

#include <cmath>

namespace semrover {
namespace kernel_head_rms_norm_test {

struct HeadCase {
    uint32_t rows, heads, head_dim, groups;
};
const HeadCase kCases[] = {{1, 1, 8, 1}, {24, 2, 32, 1}, {25, 3, 24, 2}, {131, 8, 128, 2}};
constexpr float kEps = 1e-6f;

void check(const HeadCase& c, DType dtype)
{
    SCOPED_TRACE(
        fmt::format("{} rows, {} heads of {}, groups {} {}", c.rows, c.heads, c.head_dim, c.groups, dtype_name(dtype)));
    KernelCase k(test_device());
    const uint32_t rows = c.rows * c.groups, dim = c.heads * c.head_dim;
    const HostMatrix x = k.random(rows, 3 * dim, dtype), w = k.random(2 * c.groups, c.head_dim, DType::f32);
    const HostMatrix got = k.run(head_rms_norm(k.graph, k.input(x), k.input(w), c.heads, kEps, c.groups));
    for (uint32_t r = 0; r < rows; ++r)
        for (uint32_t slot = 0; slot < 3 * c.heads; ++slot) {
            const uint32_t first = slot * c.head_dim, part = slot / c.heads;
            double squares = 0;
            for (uint32_t i = 0; i < c.head_dim; ++i)
                squares += double(x.at(r, first + i)) * x.at(r, first + i);
            const double inverse = 1 / std::sqrt(squares / c.head_dim + kEps);
            for (uint32_t i = 0; i < c.head_dim; ++i) {
                double v = x.at(r, first + i); // values are copied
                if (part < 2)
                    v *= inverse * w.at(r / c.rows * 2 + part, i);
                const double tolerance =
                    part == 2 ? 0 : 1e-6 * (1 + std::abs(v)) + (dtype == DType::f16 ? 3e-8 + 6e-4 * std::abs(v) : 0);
                ASSERT_NEAR(got.at(r, first + i), v, tolerance) << "row " << r << " column " << first + i;
            }
        }
}

TEST(kernel_head_rms_norm, normalises_queries_and_keys_of_each_head_and_copies_values)
{
    for (const HeadCase& c : kCases)
        for (DType dtype : {DType::f32, DType::f16})
            check(c, dtype);
}

TEST(kernel_head_rms_norm, keeps_a_head_of_zeros_finite)
{
    KernelCase k(test_device());
    const HostMatrix x(2, 3 * 16, DType::f32), w = k.random(2, 16, DType::f32);
    const HostMatrix got = k.run(head_rms_norm(k.graph, k.input(x), k.input(w), 1, kEps, 1));
    for (float v : got.values)
        EXPECT_EQ(v, 0.f);
}

} // namespace kernel_head_rms_norm_test
} // namespace semrover
