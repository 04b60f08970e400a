// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "tests/support/kernel_case.h"

#include <cmath>

namespace semrover {
namespace kernel_modulate_test {

struct RowCase {
    uint32_t rows, cols, groups, column = 5; // column: of the table's first shift
};
// one element; aligned; odd tails; two groups; more columns than registers keep; a table that starts aligned
const RowCase kCases[] = {{1, 1, 1},    {3, 64, 1},    {25, 65, 1},   {24, 120, 2},
                          {7, 1301, 2}, {131, 520, 1}, {5, 384, 2, 8}};
constexpr float kEps = 1e-6f;

// half a unit in the last place of an fp16 result, a little widened; 3e-8 is half the smallest number
double half_error(DType dtype, double v)
{
    return dtype == DType::f16 ? 3e-8 + 6e-4 * std::abs(v) : 0;
}

template <typename Check>
void for_every_case(Check check)
{
    for (const RowCase& c : kCases)
        for (DType dtype : {DType::f32, DType::f16}) {
            SCOPED_TRACE(fmt::format("[{}, {}] groups {} {}", c.rows, c.cols, c.groups, dtype_name(dtype)));
            check(c, dtype);
        }
}

// LayerNorm in double, then shift and scale from the table
double modulated(const HostMatrix& x, uint32_t row, uint32_t col, double scale, double shift)
{
    double mean = 0, variance = 0;
    for (uint32_t c = 0; c < x.cols; ++c)
        mean += x.at(row, c);
    mean /= x.cols;
    for (uint32_t c = 0; c < x.cols; ++c)
        variance += (x.at(row, c) - mean) * (x.at(row, c) - mean);
    return (x.at(row, col) - mean) / std::sqrt(variance / x.cols + kEps) * (1 + scale) + shift;
}

TEST(kernel_modulate, matches_a_layer_norm_in_double)
{
    for_every_case([](const RowCase& c, DType dtype) {
        KernelCase k(test_device());
        const uint32_t rows = c.rows * c.groups, column = c.column, step = 2 * c.cols + column % 4 + 4, times = 3;
        const HostMatrix x = k.random(rows, c.cols, dtype),
                         table = k.random(times, column + step * c.groups + 8, DType::f32);
        const std::vector<uint32_t> time = k.indices(rows, times);
        const uint32_t scale_col = column + c.cols;
        const Modulation shift{k.input(table), k.input(time), column, step};
        const HostMatrix got = k.run(modulate(k.graph, k.input(x), shift, scale_col, kEps, c.groups));
        for (uint32_t r = 0; r < rows; ++r)
            for (uint32_t n = 0; n < c.cols; ++n) {
                const uint32_t at = r / c.rows * step + n;
                const double v = modulated(x, r, n, table.at(time[r], scale_col + at), table.at(time[r], column + at));
                ASSERT_NEAR(got.at(r, n), v, 4e-6 + half_error(dtype, v)) << "row " << r << " column " << n;
            }
        k.expect_zero_padding(got);
    });
}

TEST(kernel_modulate, keeps_its_digits_when_the_mean_is_a_thousand_deviations_away)
{
    KernelCase k(test_device());
    HostMatrix x = k.random(3, 520, DType::f32);
    for (uint32_t r = 0; r < 3; ++r)
        for (uint32_t c = 0; c < x.cols; ++c)
            x.set(r, c, x.at(r, c) + 1000);
    const HostMatrix table(1, 1040, DType::f32);
    const Modulation none{k.input(table), k.input(std::vector<uint32_t>(3, 0)), 0, 0};
    const HostMatrix got = k.run(modulate(k.graph, k.input(x), none, 520, kEps));
    for (uint32_t r = 0; r < 3; ++r)
        for (uint32_t c = 0; c < x.cols; ++c) // 2.4e-4 measured where one lane sums the whole row
            ASSERT_NEAR(got.at(r, c), modulated(x, r, c, 0, 0), 4e-4);
}

TEST(kernel_modulate, gives_the_shift_where_a_row_is_constant)
{
    KernelCase k(test_device());
    HostMatrix x(2, 72, DType::f32), table = k.random(1, 144, DType::f32);
    for (uint32_t c = 0; c < x.cols; ++c)
        x.set(0, c, 2);
    const Modulation shift{k.input(table), k.input(std::vector<uint32_t>(2, 0)), 0, 0};
    const HostMatrix got = k.run(modulate(k.graph, k.input(x), shift, 72, kEps));
    for (uint32_t r = 0; r < 2; ++r)
        for (uint32_t c = 0; c < x.cols; ++c)
            ASSERT_EQ(got.at(r, c), table.at(0, c));
}

TEST(kernel_modulate, gives_a_row_the_same_bits_wherever_it_stands)
{
    KernelCase k(test_device()), alone(test_device());
    const HostMatrix x = k.random(70, 65, DType::f32), table = k.random(1, 130, DType::f32);
    HostMatrix row(1, 65, DType::f32);
    for (uint32_t c = 0; c < 65; ++c)
        row.set(0, c, x.at(67, c));
    const Modulation all{k.input(table), k.input(std::vector<uint32_t>(70, 0)), 0, 0};
    const Modulation one{alone.input(table), alone.input(std::vector<uint32_t>(1, 0)), 0, 0};
    const HostMatrix many = k.run(modulate(k.graph, k.input(x), all, 65, kEps));
    const HostMatrix single = alone.run(modulate(alone.graph, alone.input(row), one, 65, kEps));
    for (uint32_t c = 0; c < 65; ++c)
        ASSERT_EQ(many.at(67, c), single.at(0, c));
}

TEST(kernel_modulate, takes_more_rows_than_one_dimension_of_a_dispatch)
{
    KernelCase k(test_device());
    const uint32_t rows = 70001;
    const HostMatrix x = k.random(rows, 3, DType::f16), table = k.random(1, 8, DType::f32);
    const Modulation shift{k.input(table), k.input(std::vector<uint32_t>(rows, 0)), 0, 0};
    const HostMatrix got = k.run(modulate(k.graph, k.input(x), shift, 3, kEps));
    for (uint32_t r : {0u, 65534u, 65535u, 65536u, rows - 1})
        for (uint32_t c = 0; c < 3; ++c) {
            const double v = modulated(x, r, c, table.at(0, 3 + c), table.at(0, c));
            ASSERT_NEAR(got.at(r, c), v, 1e-5 + half_error(DType::f16, v)) << "row " << r;
        }
}

TEST(kernel_gated_add, adds_gated_rows_to_the_residual)
{
    for_every_case([](const RowCase& c, DType dtype) {
        KernelCase k(test_device());
        const uint32_t rows = c.rows * c.groups, step = c.cols + 5, times = 4;
        const HostMatrix x = k.random(rows, c.cols, dtype), residual = k.random(rows, c.cols, dtype);
        const HostMatrix table = k.random(times, 2 + step * c.groups + 8, DType::f32);
        const std::vector<uint32_t> time = k.indices(rows, times);
        const Modulation gate{k.input(table), k.input(time), 2, step};
        const HostMatrix got = k.run(gated_add(k.graph, k.input(x), gate, k.input(residual), c.groups));
        for (uint32_t r = 0; r < rows; ++r)
            for (uint32_t n = 0; n < c.cols; ++n) {
                const double v = residual.at(r, n) + double(table.at(time[r], 2 + r / c.rows * step + n)) * x.at(r, n);
                ASSERT_NEAR(got.at(r, n), v, 1e-6 * (2 + std::abs(v)) + half_error(dtype, v))
                    << "row " << r << " column " << n;
            }
        k.expect_zero_padding(got);
    });
}

TEST(kernel_add, adds_in_either_precision_and_writes_where_it_is_told)
{
    for_every_case([](const RowCase& c, DType dtype) {
        KernelCase k(test_device());
        const HostMatrix x = k.random(c.rows, c.cols, DType::f32), residual = k.random(c.rows, c.cols, dtype);
        const Tensor out = k.output(c.rows, c.cols, dtype);
        add(k.graph, k.input(x), k.input(residual), {.whole = out});
        const Status status = k.compile_and_run();
        ASSERT_TRUE(status) << status.error().message;
        const HostMatrix got = k.read(out);
        for (uint32_t r = 0; r < c.rows; ++r)
            for (uint32_t n = 0; n < c.cols; ++n) {
                const double v = double(x.at(r, n)) + residual.at(r, n);
                ASSERT_NEAR(got.at(r, n), v, 1e-7 * (2 + std::abs(v)) + half_error(dtype, v))
                    << "row " << r << " column " << n;
            }
        k.expect_zero_padding(got);
    });
}

} // namespace kernel_modulate_test
} // namespace semrover
