// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "factor_rate.spv.h"
#include "kernels/network/matmul_tiles.h"
#include "tests/support/kernel_case.h"

// What is timed is done: nothing is optimised away, and factors are those that were meant.
namespace semrover {
namespace kernel_factor_rate_test {

constexpr uint32_t kUnits = 256, kRounds = 3, kGroups = 2;

HostMatrix result_of(KernelCase& k, const HostMatrix& x, DispatchOptions options, uint32_t excluded)
{
    options.variant = &k.graph.variant(kernel::factor_rate, {}, {}, excluded);
    const Tensor y = k.graph.matrix(8, 256, DType::f32);
    k.graph.dispatch(kernel::factor_rate, {{"X", k.input(x)}, {"Y", y}}, FactorRatePush{kRounds, kUnits},
                     groups(kGroups), std::move(options));
    return k.run(y);
}

TEST(kernel_factor_rate, reads_what_it_says)
{
    KernelCase k(test_device());
    const HostMatrix x = k.random(1, kUnits * 8, DType::f16);
    const auto word = [&](uint32_t i) {
        return uint32_t(float_to_half(x.values[2 * i])) | uint32_t(float_to_half(x.values[2 * i + 1])) << 16;
    };
    const HostMatrix y = result_of(k, x, {}, kFeatureCooperativeMatrix);
    for (uint32_t thread = 0; thread < kGroups * 128; ++thread) {
        uint32_t all = 0;
        for (uint32_t i = 0; i < 8 * kRounds; ++i)
            for (uint32_t c = 0; c < 4; ++c)
                all ^= word((thread + i * 128 * 1021) % kUnits * 4 + c);
        ASSERT_EQ(y.values[thread], float((all ^ all >> 16) & 0xffff)) << thread;
    }
}

struct Factors {
    const HostMatrix& x;
    MatrixShape m;
    uint32_t source;

    // of [row or column][k], by the units of 16 bytes that it lies in
    double at(uint32_t factor, uint32_t row, uint32_t k) const
    {
        const uint32_t of_factor = std::max(m.m, m.n) * m.k / 8, row_units = 4 * m.k / 8 + 1;
        const uint32_t in_memory = factor * of_factor % kUnits + row * (m.k / 8);
        const uint32_t staged = (factor / 4 * 16 % 128 + row) * row_units + factor % 4 * (m.k / 8);
        return x.values[((source == 1 ? staged : in_memory) + k / 8) % kUnits * 8 + k % 8];
    }
};

// by every eight factors that are loaded, in registers once
double sum_of(const Factors& f, uint32_t products, uint32_t first, uint32_t row, uint32_t col)
{
    const uint32_t in_round = std::max(products, 16u);
    double sum = 0;
    for (uint32_t n = 0; n < kRounds * in_round; ++n) {
        const uint32_t in = n % in_round, factor = first + (f.source == 0 ? 0 : n / products * 8);
        for (uint32_t k = 0; k < f.m.k; ++k)
            sum += f.at(factor + in % 4, row, k) * f.at(factor + 4 + (in / 4 + in) % 4, col, k);
    }
    return sum;
}

TEST(kernel_factor_rate, multiplies_what_it_says)
{
    const DeviceLimits& limits = test_device().limits();
    if (!(Graph(limits).variant(kernel::factor_rate).features & kFeatureCooperativeMatrix))
        GTEST_SKIP() << "no matrix units here";
    const MatrixShape& m = limits.matrix;
    for (const auto& [source, products] : {std::pair{0u, 16u}, {1u, 4u}, {1u, 32u}, {2u, 8u}, {2u, 16u}}) {
        KernelCase k(test_device());
        const HostMatrix x = k.random(1, kUnits * 8, DType::f16);
        DispatchOptions options;
        options.constants = group_constants(limits, {{"kSource", source}, {"kProducts", products}});
        const HostMatrix y = result_of(k, x, std::move(options), 0);
        const Factors factors{x, m, source};
        double worst = 0;
        for (uint32_t i = 0; i < 4 * kGroups * m.m * m.n; ++i) {
            const uint32_t subgroup = i / (m.m * m.n), in_matrix = i % (m.m * m.n);
            const double wanted = sum_of(factors, products, subgroup * 8 * 37, in_matrix / m.n, in_matrix % m.n);
            worst = std::max(worst, std::abs(y.values[i] - wanted));
        }
        EXPECT_LT(worst, 1e-4) << source << " " << products; // measured: 1.9e-5
    }
}

} // namespace kernel_factor_rate_test
} // namespace semrover
