// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/kernel_case.h"

#include <cmath>

namespace semrover {
namespace {

struct GegluCase {
    uint32_t rows, cols; // of y
};
const GegluCase kCases[] = {{1, 8}, {3, 40}, {70, 1280}, {20, 5120}};

double gelu_reference(double v)
{
    return 0.5 * v * (1 + std::erf(v / std::sqrt(2.0)));
}

TEST(kernel_geglu, matches_its_formula_in_double)
{
    for (const GegluCase& c : kCases)
        for (DType dtype : {DType::f32, DType::f16}) {
            SCOPED_TRACE(fmt::format("[{}, {}] {}", c.rows, c.cols, dtype_name(dtype)));
            KernelCase k(test_device());
            HostMatrix x = k.random(c.rows, 2 * c.cols, dtype, 2);
            x.set(0, 0, 1);
            x.set(0, 8, 60000); // far out on both sides: the gate itself, and nothing
            x.set(0, 9, -60000);
            const HostMatrix got = k.run(geglu(k.graph, k.input(x)));
            ASSERT_EQ(got.cols, c.cols);
            for (uint32_t r = 0; r < c.rows; ++r)
                for (uint32_t n = 0; n < c.cols; ++n) {
                    const uint32_t at = n / 8 * 16 + n % 8;
                    const double h = x.at(r, at), v = h * gelu_reference(x.at(r, at + 8));
                    const double half = dtype == DType::f16 ? 3e-8 + 6e-4 * std::abs(v) : 0;
                    // an error of 1e-7 in erf is multiplied by half the gate, and h
                    const double tolerance = 5e-7 * (1 + std::abs(h * x.at(r, at + 8)));
                    ASSERT_NEAR(got.at(r, n), v, tolerance + half) << "row " << r << " column " << n;
                }
        }
}

// h = 2 / gate makes y = 1 + erf(gate / sqrt(2)): the shader's erf, but for two roundings
TEST(kernel_geglu, has_an_erf_of_single_precision)
{
    constexpr uint32_t kCount = 8 * 1500; // gates from -6 sqrt(2) to 6 sqrt(2)
    KernelCase k(test_device());
    HostMatrix x(1, 2 * kCount, DType::f32);
    const auto gate = [](uint32_t n) { return float((n + 0.5) / kCount * 12 - 6) * float(M_SQRT2); };
    for (uint32_t n = 0; n < kCount; ++n) {
        x.set(0, n / 8 * 16 + n % 8, 2 / gate(n));
        x.set(0, n / 8 * 16 + n % 8 + 8, gate(n));
    }
    const HostMatrix got = k.run(geglu(k.graph, k.input(x)));
    double worst = 0;
    for (uint32_t n = 0; n < kCount; ++n)
        worst = std::max(worst, std::abs(got.at(0, n) - (1 + std::erf(gate(n) * M_SQRT1_2))));
    EXPECT_LT(worst, 5e-7);
    RecordProperty("worst", fmt::format("{:.2e}", worst));
}

} // namespace
} // namespace semrover
