// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
// fp16 is stored rounded to nearest, ties to even, whatever the device's packHalf2x16 does
#include "half_rounding.spv.h"
#include "kernels/network.h"
#include "tests/support/kernel_case.h"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>

namespace semrover {
namespace kernel_half_rounding_test {

// every fp16 number, the float halfway to the next and that one's neighbours, both signs; inf, NaN, fp32's smallest
std::vector<float> near_halves()
{
    std::vector<float> values;
    for (uint32_t h = 0; h < 0x7c00; ++h) {
        const float low = half_to_float(uint16_t(h));
        const float high = h == 0x7bff ? 65536.f : half_to_float(uint16_t(h + 1));
        const float middle = (low + high) / 2;
        for (float v : {low, std::nextafter(low, high), std::nextafter(middle, low), middle,
                        std::nextafter(middle, high), std::nextafter(high, low)})
            values.insert(values.end(), {v, -v});
    }
    for (float v : {65536.f, 70000.f, 1e6f, 1e10f, 3e38f, INFINITY, 1e-30f, 1e-38f, std::nanf(""), 1e34f, 5e34f})
        values.insert(values.end(), {v, -v});
    if (values.size() % 2)
        values.push_back(0);
    return values;
}

bool same_half(uint16_t a, uint16_t b)
{
    return a == b || (std::isnan(half_to_float(a)) && std::isnan(half_to_float(b)));
}

uint16_t half_at(const std::vector<uint32_t>& words, size_t value, size_t column)
{
    return uint16_t(words[value / 2 * 4 + column] >> value % 2 * 16);
}

TEST(kernel_half_rounding, is_to_nearest_even_where_the_device_rounds_toward_zero_too)
{
    const std::vector<float> x = near_halves();
    KernelCase k(test_device());
    const HalfRoundingPush push{.count = uint32_t(x.size() / 2)};
    const Tensor y = k.output(push.count, 4, DType::u32, 4);
    k.graph.dispatch(kernel::half_rounding, {{"X", k.input(x)}, {"Y", y}}, push, threads(push.count), {});
    const Status status = k.compile_and_run();
    ASSERT_TRUE(status) << status.error().message;
    const auto words = k.read_array<uint32_t>(y);
    size_t truncated = 0;
    for (size_t i = 0; i < x.size(); ++i) {
        const uint16_t expected = float_to_half(x[i]);
        ASSERT_TRUE(same_half(half_at(words, i, 0), expected)) << std::hexfloat << x[i];
        ASSERT_TRUE(same_half(half_at(words, i, 1), expected)) << std::hexfloat << x[i];
        truncated += !same_half(half_at(words, i, 2), expected);
        if (!std::isnan(x[i])) {
            const float share = std::min(std::abs(x[i]), 1.f);
            ASSERT_TRUE(same_half(half_at(words, i, 3), float_to_half(share))) << std::hexfloat << share;
        }
    }
    EXPECT_GT(truncated, x.size() / 4); // the test's own rounding toward zero is one
}

// numbers that fp16 holds, in a matrix of either type
HostMatrix halves(KernelCase& k, uint32_t rows, uint32_t cols, DType dtype, float scale)
{
    HostMatrix m = k.random(rows, cols, DType::f16, scale);
    m.dtype = dtype;
    return m;
}

struct Convolution {
    FeatureMap x;
    Tensor w;
    ConvOptions options;
};

Convolution convolution(KernelCase& k, DType dtype)
{
    Convolution c;
    c.x = {k.input(halves(k, 80, 16, DType::f16, 200)), 1, 8, 10};
    c.w = k.input(halves(k, 24, 9 * round_up(16u, kRowPadding), DType::f16, 200));
    c.options.dtype = dtype;
    return c;
}

// an op with results of a type; some exceed fp16's range
struct StoringOp {
    const char* name;
    std::function<Tensor(KernelCase&, DType)> record;
};

const StoringOp kStoringOps[] = {
    {"gemm",
     [](KernelCase& k, DType dtype) {
         const HostMatrix x = halves(k, 70, 40, DType::f16, 200), w = halves(k, 72, 40, DType::f16, 200);
         return gemm(k.graph, k.input(x), k.input(w), {}, {.dtype = dtype});
     }},
    {"conv2d",
     [](KernelCase& k, DType dtype) {
         const Convolution c = convolution(k, dtype);
         return conv2d(k.graph, c.x, {}, c.w, {}, c.options).data;
     }},
    {"winograd_conv2d",
     [](KernelCase& k, DType dtype) {
         const Convolution c = convolution(k, dtype);
         return winograd_conv2d(k.graph, c.x, winograd_weight(k.graph, c.w), {}, c.options).data;
     }},
    {"embedding",
     [](KernelCase& k, DType dtype) {
         const std::vector<uint32_t> index = k.indices(50, 30);
         HostMatrix table = k.random(30, 40, DType::f32, 20000);
         return embedding(k.graph, k.input(index), k.input(table), {}, dtype);
     }},
    {"sinusoid",
     [](KernelCase& k, DType dtype) {
         const std::vector<float> x = {0.1f, 3, 77, 999}, frequencies = {1, 0.3f, 0.01f, 1e-4f};
         return sinusoid(k.graph, k.input(x), k.input(frequencies), true, dtype);
     }},
    {"gelu", [](KernelCase& k, DType dtype) { return gelu(k.graph, k.input(halves(k, 30, 40, dtype, 3))); }},
    {"silu", [](KernelCase& k, DType dtype) { return silu(k.graph, k.input(halves(k, 30, 40, dtype, 3))); }},
    {"geglu", [](KernelCase& k, DType dtype) { return geglu(k.graph, k.input(halves(k, 30, 80, dtype, 400))); }},
    {"add",
     [](KernelCase& k, DType dtype) {
         const HostMatrix x = halves(k, 30, 40, dtype, 30000), residual = halves(k, 30, 40, dtype, 60000);
         return add(k.graph, k.input(x), k.input(residual));
     }},
    {"layer_norm",
     [](KernelCase& k, DType dtype) {
         const HostMatrix x = halves(k, 30, 40, dtype, 3), weight = k.random(1, 40, DType::f32, 40000);
         return layer_norm(k.graph, k.input(x), k.input(weight), k.input(k.random(1, 40, DType::f32)), 1e-5f);
     }},
};

TEST(kernel_half_rounding, of_every_op_is_that_of_its_fp32_results)
{
    for (const StoringOp& op : kStoringOps) {
        SCOPED_TRACE(op.name);
        KernelCase whole(test_device()), half(test_device());
        const HostMatrix expected = whole.run(op.record(whole, DType::f32));
        const HostMatrix y = half.run(op.record(half, DType::f16));
        ASSERT_EQ(y.dtype, DType::f16);
        for (uint32_t r = 0; r < y.rows; ++r)
            for (uint32_t c = 0; c < y.cols; ++c)
                ASSERT_TRUE(same_half(float_to_half(y.at(r, c)), float_to_half(expected.at(r, c))))
                    << r << " " << c << ": " << expected.at(r, c);
    }
}

// Unpacking is exact, and so is loading factors of cooperative matrices, which are fp16 in memory. The driver does
// round weights of flash attention; their totals are sums of what was rounded.
bool rounds_nothing(const std::string& text, size_t at)
{
    const auto follows = [&](const std::string& word) {
        return at >= word.size() && text.compare(at - word.size(), word.size(), word) == 0;
    };
    return follows("un") || follows("coopmat<");
}

TEST(kernel_half_rounding, is_left_to_the_driver_by_no_shader)
{
    for (const auto& entry : std::filesystem::recursive_directory_iterator(SEMROVER_SOURCE_DIR "/shaders")) {
        if (!entry.is_regular_file() || entry.path().filename() == "half.glsl")
            continue;
        std::ifstream file(entry.path());
        const std::string text{std::istreambuf_iterator<char>(file), {}};
        for (const char* call : {"packHalf2x16(", "float16_t", "f16vec"}) {
            for (size_t at = 0; (at = text.find(call, at)) != std::string::npos; ++at)
                EXPECT_TRUE(rounds_nothing(text, at)) << entry.path() << ": " << call;
        }
    }
}

} // namespace kernel_half_rounding_test
} // namespace semrover
