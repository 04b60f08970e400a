// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "tests/support/kernel_case.h"

#include <cmath>
#include <numbers>

namespace semrover {
namespace kernel_embedding_test {

struct EmbeddingCase {
    uint32_t rows, cols, classes;
    DType table, x, y;
};
const EmbeddingCase kCases[] = {
    {1, 1, 1, DType::f32, DType::f32, DType::f32},       {24, 64, 20, DType::f32, DType::f16, DType::f16},
    {25, 65, 20, DType::f16, DType::f32, DType::f32},    {131, 200, 7, DType::f16, DType::f16, DType::f16},
    {300, 1024, 20, DType::f32, DType::f32, DType::f16},
};

void check(const EmbeddingCase& c, bool add_x)
{
    SCOPED_TRACE(fmt::format("[{}, {}] of {} classes, add {}", c.rows, c.cols, c.classes, add_x));
    KernelCase k(test_device());
    const HostMatrix table = k.random(c.classes, c.cols, c.table), x = k.random(c.rows, c.cols, c.x);
    std::vector<uint32_t> index = k.indices(c.rows, c.classes);
    index.back() = 4000000000u; // clamped to the last class
    const HostMatrix got =
        k.run(embedding(k.graph, k.input(index), k.input(table), add_x ? k.input(x) : Tensor{}, c.y));
    for (uint32_t r = 0; r < c.rows; ++r)
        for (uint32_t n = 0; n < c.cols; ++n) {
            const double v = double(table.at(std::min(index[r], c.classes - 1), n)) + (add_x ? x.at(r, n) : 0);
            const double tolerance = c.y == DType::f16 ? 3e-8 + 6e-4 * std::abs(v) : 1e-7 * (1 + std::abs(v));
            ASSERT_NEAR(got.at(r, n), v, tolerance) << "row " << r << " column " << n;
        }
    k.expect_zero_padding(got);
}

TEST(kernel_embedding, looks_rows_up_and_adds_them)
{
    for (const EmbeddingCase& c : kCases)
        for (bool add_x : {false, true})
            check(c, add_x);
}

TEST(kernel_embedding, writes_into_a_part_of_other_memory_and_leaves_the_rest)
{
    KernelCase k(test_device());
    const HostMatrix table = k.random(3, 64, DType::f32);
    const Tensor out = k.output(8, 64, DType::f32);
    embedding(k.graph, k.input(std::vector<uint32_t>{2, 0, 1, 2}), k.input(table), {}, DType::f32, {out, 4});
    const Status status = k.compile_and_run();
    ASSERT_TRUE(status) << status.error().message;
    const HostMatrix got = k.read(out);
    for (uint32_t c = 0; c < 64; ++c) {
        EXPECT_EQ(got.at(4, c), table.at(2, c));
        EXPECT_EQ(got.at(5, c), table.at(0, c));
        EXPECT_TRUE(std::isnan(got.at(3, c))); // as it was
    }
}

struct SinusoidCase {
    uint32_t rows, axes, frequencies;
    bool cos_first;
};
const SinusoidCase kSinusoids[] = {{1, 1, 1, false}, {24, 1, 128, true}, {25, 3, 5, false}, {130, 3, 21, true}};

void check(const SinusoidCase& c, DType dtype)
{
    SCOPED_TRACE(fmt::format("{} rows, {} axes, {} frequencies {}", c.rows, c.axes, c.frequencies, dtype_name(dtype)));
    KernelCase k(test_device());
    std::mt19937 random(2);
    std::uniform_real_distribution<float> position(-1000, 1000);
    std::vector<float> x(c.rows * c.axes), frequency(c.frequencies);
    for (float& v : x)
        v = position(random);
    x.front() = 1000;
    for (uint32_t f = 0; f < c.frequencies; ++f)
        frequency[f] = std::pow(10000.f, -float(f) / float(c.frequencies));
    const HostMatrix got = k.run(sinusoid(k.graph, k.input(x, c.axes), k.input(frequency), c.cos_first, dtype));
    for (uint32_t r = 0; r < c.rows; ++r)
        for (uint32_t n = 0; n < c.axes * 2 * c.frequencies; ++n) {
            const uint32_t axis = n / (2 * c.frequencies), within = n % (2 * c.frequencies);
            const float angle = x[r * c.axes + axis] * frequency[within % c.frequencies]; // rounded as on the device
            const bool cosine = (within >= c.frequencies) != c.cos_first;
            const double v = cosine ? std::cos(double(angle)) : std::sin(double(angle));
            ASSERT_NEAR(got.at(r, n), v, dtype == DType::f16 ? 6e-4 : 1e-6) << "angle " << angle << " column " << n;
        }
    k.expect_zero_padding(got);
}

TEST(kernel_sinusoid, is_right_to_a_millionth_for_angles_up_to_1000)
{
    for (const SinusoidCase& c : kSinusoids)
        for (DType dtype : {DType::f32, DType::f16})
            check(c, dtype);
}

TEST(kernel_sinusoid, is_right_around_every_multiple_of_a_quarter_turn)
{
    KernelCase k(test_device());
    std::vector<float> x;
    for (int quarter = -640; quarter <= 640; ++quarter)
        for (float near : {-1e-3f, -1e-6f, 0.f, 1e-6f, 1e-3f})
            x.push_back(float(quarter * std::numbers::pi / 2) + near);
    const HostMatrix got = k.run(sinusoid(k.graph, k.input(x), k.input(std::vector<float>{1}), false, DType::f32));
    for (uint32_t r = 0; r < x.size(); ++r) {
        ASSERT_NEAR(got.at(r, 0), std::sin(double(x[r])), 1e-6) << "sin " << x[r];
        ASSERT_NEAR(got.at(r, 1), std::cos(double(x[r])), 1e-6) << "cos " << x[r];
    }
}

} // namespace kernel_embedding_test
} // namespace semrover
