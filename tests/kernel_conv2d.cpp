// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "tests/support/feature_map_case.h"

#include <cmath>

namespace semrover {
namespace kernel_conv2d_test {

struct ConvCase {
    uint32_t batch = 1, height = 1, width = 1, channels = 1, channels2 = 0, outputs = 1, kernel = 3, stride = 1;
    bool end_padding = false;
    uint32_t up_height = 0, up_width = 0; // 0: not upsampled
    bool bias = true, shift = false, silu = false, residual = false;
};

// one pixel; aligned; odd sizes and channels; two inputs; strides and paddings; upsampling to even and odd sizes; every
// epilogue; more than one tile of every variant; a K that GPUs cut into slices, in long steps or not
const ConvCase kCases[] = {
    {.height = 1, .width = 1, .channels = 1, .outputs = 1, .bias = false},
    {.height = 4, .width = 4, .channels = 8, .outputs = 16},
    {.batch = 2, .height = 5, .width = 7, .channels = 13, .outputs = 20, .shift = true},
    {.height = 9, .width = 6, .channels = 16, .channels2 = 8, .outputs = 24, .residual = true},
    {.batch = 2, .height = 3, .width = 5, .channels = 24, .channels2 = 11, .outputs = 9, .kernel = 1, .residual = true},
    {.height = 7, .width = 9, .channels = 8, .outputs = 40, .stride = 2, .silu = true},
    {.batch = 2, .height = 8, .width = 6, .channels = 8, .outputs = 12, .stride = 2, .end_padding = true},
    {.height = 7, .width = 5, .channels = 16, .outputs = 8, .stride = 2, .end_padding = true, .bias = false},
    {.height = 4, .width = 5, .channels = 8, .outputs = 8, .up_height = 8, .up_width = 10},
    {.batch = 2, .height = 4, .width = 5, .channels = 8, .outputs = 8, .up_height = 7, .up_width = 9},
    {.batch = 2, .height = 11, .width = 13, .channels = 40, .outputs = 72, .shift = true, .residual = true},
    {.batch = 2, .height = 23, .width = 24, .channels = 8, .outputs = 509, .shift = true, .residual = true},
    {.batch = 2,
     .height = 3,
     .width = 4,
     .channels = 264,
     .channels2 = 250,
     .outputs = 72,
     .shift = true,
     .silu = true,
     .residual = true},
    {.height = 3,
     .width = 4,
     .channels = 256,
     .channels2 = 250,
     .outputs = 72,
     .shift = true,
     .silu = true,
     .residual = true},
};

// whole blocks of a tap's channels: one input, two, a kernel of one tap, stride, upsampling, and more scales than a
// texel has
const ConvCase kBlockCases[] = {
    {2, 5, 7, 32, 0, 20, 3, 1, false, 0, 0, true, true, false, false},
    {1, 9, 6, 64, 32, 24, 3, 1, false, 0, 0, true, false, false, true},
    {2, 3, 5, 48, 80, 9, 1, 1, false, 0, 0, true, false, false, true},
    {1, 7, 9, 32, 0, 40, 3, 2, false, 0, 0, true, false, true, false},
    {1, 4, 5, 96, 0, 8, 3, 1, false, 7, 10, true, false, false, false},
    {2, 3, 4, 288, 256, 72, 3, 1, false, 0, 0, true, true, true, true},
};

// y of one output pixel and channel, in double; magnitude: sum of |terms|
double convolve(const ConvCase& c, const HostImages& x, const HostImages& x2, const HostMatrix& w, uint32_t image,
                int oy, int ox, uint32_t n, double& magnitude)
{
    const bool up = c.up_height != 0;
    const int seen_height = int(up ? c.up_height : c.height), seen_width = int(up ? c.up_width : c.width);
    const int padding = c.kernel == 1 || c.end_padding ? 0 : 1;
    const uint32_t cols = round_up(c.channels, 8), cols2 = round_up(c.channels2, 8);
    double sum = 0;
    for (uint32_t tap = 0; tap < c.kernel * c.kernel; ++tap) {
        const int y = oy * int(c.stride) - padding + int(tap / c.kernel);
        const int x_at = ox * int(c.stride) - padding + int(tap % c.kernel);
        if (y < 0 || x_at < 0 || y >= seen_height || x_at >= seen_width)
            continue;
        const uint32_t sy = uint32_t(y) >> up, sx = uint32_t(x_at) >> up;
        const auto add = [&](double a, double b) {
            sum += a * b;
            magnitude += std::abs(a * b);
        };
        for (uint32_t k = 0; k < c.channels; ++k)
            add(x.at(image, sy, sx, k), w.at(n, tap * (cols + cols2) + k));
        for (uint32_t k = 0; k < c.channels2; ++k)
            add(x2.at(image, sy, sx, k), w.at(n, tap * (cols + cols2) + cols + k));
    }
    return sum;
}

HostMatrix first_rows(const HostMatrix& m, uint32_t rows)
{
    HostMatrix first(rows, m.cols, m.dtype);
    for (uint32_t r = 0; r < rows; ++r)
        for (uint32_t c = 0; c < m.cols; ++c)
            first.set(r, c, m.at(r, c));
    return first;
}

// weights in the kernel's layout; the columns that pad an input meet zeros
HostMatrix packed_weights(KernelCase& k, const ConvCase& c, DType dtype)
{
    return k.random(c.outputs, c.kernel * c.kernel * (round_up(c.channels, 8) + round_up(c.channels2, 8)), dtype);
}

ConvOptions options_of(const ConvCase& c, DType dtype)
{
    ConvOptions o;
    o.kernel = c.kernel;
    o.stride = c.stride;
    o.end_padding = c.end_padding;
    o.upsampled_height = c.up_height;
    o.upsampled_width = c.up_width;
    o.dtype = dtype;
    return o;
}

void check(const ConvCase& c, DType dtype, DType w_dtype)
{
    SCOPED_TRACE(fmt::format("{} x {}x{}x{}+{} -> {} kernel {} stride {} {} {}", c.batch, c.height, c.width, c.channels,
                             c.channels2, c.outputs, c.kernel, c.stride, dtype_name(dtype), dtype_name(w_dtype)));
    KernelCase k(test_device());
    const HostImages x = random_images(k, c.batch, c.height, c.width, c.channels, dtype);
    const HostImages x2 = c.channels2 ? random_images(k, c.batch, c.height, c.width, c.channels2, dtype) : HostImages{};
    const HostMatrix w = packed_weights(k, c, w_dtype), bias = k.random(1, c.outputs, DType::f32);
    const HostMatrix table = k.random(3, c.outputs + 12, DType::f32);
    const std::vector<uint32_t> table_row = k.indices(c.batch, 3);
    FeatureMap y = conv2d(k.graph, x.input(k), c.channels2 ? x2.input(k) : FeatureMap{}, k.input(w),
                          c.bias ? k.input(bias) : Tensor{}, options_of(c, dtype));
    if (c.shift)
        y = channel_shift(k.graph, y, {k.input(table), k.input(table_row), 4});
    if (c.silu)
        y = y.with(silu(k.graph, y.data));
    const HostImages residual = random_images(k, y.batch, y.height, y.width, c.outputs, dtype);
    if (c.residual)
        y = y.with(add(k.graph, y.data, residual.input(k).data));
    const HostImages got{y.height, y.width, k.run(y.data)};
    const bool slices = k.plan().passes[0].variant->constant("kSlices") && c.channels >= 256;
    EXPECT_EQ(k.plan().passes.size(), slices ? 2u : 1u); // everything is in the epilogue
    // matrix units take fp16: others are rounded to it
    const bool rounded = w_dtype != DType::f16 && k.plan().passes[0].variant->name == "coopmat";
    for (uint32_t image = 0; image < y.batch; ++image)
        for (uint32_t p = 0; p < y.pixels(); ++p)
            for (uint32_t n = 0; n < c.outputs; ++n) {
                const uint32_t oy = p / y.width, ox = p % y.width;
                double magnitude = 0, v = convolve(c, x, x2, w, image, int(oy), int(ox), n, magnitude);
                v += c.bias ? bias.at(0, n) : 0;
                v += c.shift ? table.at(table_row[image], 4 + n) : 0;
                v = c.silu ? v / (1 + std::exp(-v)) : v;
                v += c.residual ? residual.at(image, oy, ox, n) : 0;
                const double tolerance = 1e-6 * (magnitude + 4) + (dtype == DType::f16 ? 6e-4 * std::abs(v) : 0) +
                                         (rounded ? 4.9e-4 * magnitude : 0);
                ASSERT_NEAR(got.at(image, oy, ox, n), v, tolerance)
                    << "image " << image << " pixel " << oy << ", " << ox << " channel " << n;
            }
    k.expect_zero_padding(got.rows);
}

TEST(kernel_conv2d, matches_a_sum_in_double_with_every_epilogue)
{
    for (const ConvCase& c : kCases)
        for (DType dtype : {DType::f32, DType::f16})
            check(c, dtype, dtype);
}

TEST(kernel_conv2d, takes_weights_of_another_type_than_its_input)
{
    for (const ConvCase& c : kBlockCases)
        for (DType dtype : {DType::f32, DType::f16})
            check(c, dtype, DType::q8_0);
    check(kCases[3], DType::f32, DType::f16);
    check(kCases[3], DType::f16, DType::f32);
}

// an image alone, and beside others that make a GPU's tiles larger: output and moments
TEST(kernel_conv2d, gives_an_image_the_same_bits_beside_others)
{
    const ConvCase wide{
        .batch = 24, .height = 7, .width = 9, .channels = 16, .channels2 = 8, .outputs = 520, .residual = true},
        deep{.batch = 6, .height = 7, .width = 9, .channels = 256, .channels2 = 56, .outputs = 72, .residual = true};
    for (const auto& [c, dtype] : {std::pair{wide, DType::f32}, {wide, DType::f16}, {deep, DType::f16}}) {
        std::vector<float> results[2];
        for (const uint32_t batch : {c.batch, 1u}) {
            KernelCase k(test_device());
            HostImages x = random_images(k, c.batch, c.height, c.width, c.channels, dtype);
            HostImages x2 = random_images(k, c.batch, c.height, c.width, c.channels2, dtype);
            HostImages residual = random_images(k, c.batch, c.height, c.width, c.outputs, dtype);
            const HostMatrix w = packed_weights(k, c, dtype), bias = k.random(1, c.outputs, DType::f32);
            for (HostImages* images : {&x, &x2, &residual})
                images->rows = first_rows(images->rows, batch * images->image_rows());
            FeatureMap y = conv2d(k.graph, x.input(k), x2.input(k), k.input(w), k.input(bias), options_of(c, dtype));
            y = y.with(add(k.graph, y.data, residual.input(k).data));
            const Tensor moments = channel_moments(k.graph, y);
            const Tensor out = k.output(moments.rows, moments.cols, DType::f32, moments.ld);
            k.graph.keep(moments, out);
            std::vector<float>& result = results[batch == 1];
            for (const HostMatrix& m : {first_rows(k.run(y.data), y.image_rows()),
                                        first_rows(k.read(out), y.image_rows() / kImageRowPadding)})
                for (uint32_t row = 0; row < m.rows; ++row)
                    for (uint32_t col = 0; col < m.cols; ++col)
                        result.push_back(m.at(row, col));
        }
        EXPECT_EQ(results[0], results[1]) << dtype_name(dtype);
    }
}

// output and moments; passes: how many there are
std::vector<float> run_with_moments(const ConvCase& c, DType dtype, const std::string& limits, size_t& passes)
{
    auto device = Device::create({.limits = limits});
    SR_ASSERT(bool(device), "{}", device.error().message);
    KernelCase k(**device);
    const HostImages x = random_images(k, c.batch, c.height, c.width, c.channels, dtype);
    const HostImages x2 = c.channels2 ? random_images(k, c.batch, c.height, c.width, c.channels2, dtype) : HostImages{};
    const HostMatrix w = packed_weights(k, c, dtype), bias = k.random(1, c.outputs, DType::f32);
    const HostMatrix table = k.random(3, c.outputs, DType::f32);
    FeatureMap y = conv2d(k.graph, x.input(k), c.channels2 ? x2.input(k) : FeatureMap{}, k.input(w), k.input(bias),
                          options_of(c, dtype));
    if (c.shift)
        y = channel_shift(k.graph, y, {k.input(table), k.input(std::vector<uint32_t>(c.batch, 1)), 0});
    const Tensor moments = channel_moments(k.graph, y);
    const Tensor out = k.output(moments.rows, moments.cols, DType::f32, moments.ld);
    k.graph.keep(moments, out);
    std::vector<float> values = k.run(y.data).values;
    const HostMatrix got = k.read(out);
    values.insert(values.end(), got.values.begin(), got.values.end());
    passes = k.plan().passes.size();
    return values;
}

// the same convolution on a device that binds less than its tensors: bands with the rows around them; and bands of
// whole images where their sums are in slices
TEST(kernel_conv2d, gives_the_same_bits_in_bands_of_rows)
{
    struct Case {
        ConvCase c;
        DType dtype;
        const char* limits;
    };
    ConvCase two{.height = 37, .width = 23, .channels = 16, .channels2 = 8, .outputs = 24, .shift = true},
        strided{.height = 38, .width = 22, .channels = 16, .outputs = 24, .stride = 2, .end_padding = true},
        upsampled{.height = 19, .width = 23, .channels = 16, .outputs = 24, .up_height = 37, .up_width = 45},
        deep{.height = 7, .width = 9, .channels = 256, .channels2 = 56, .outputs = 72, .shift = true};
    two.batch = 2;
    deep.batch = 24;
    two.residual = deep.residual = true;
    const char *low = "range=32768,texels=2048", *higher = "range=450000,texels=28125";
    for (const Case& t : {Case{two, DType::f32, low}, Case{strided, DType::f32, low}, Case{upsampled, DType::f32, low},
                          Case{deep, DType::f16, higher}}) {
        size_t passes = 0, cut = 0;
        EXPECT_EQ(run_with_moments(t.c, t.dtype, "", passes), run_with_moments(t.c, t.dtype, t.limits, cut));
        EXPECT_GT(cut, passes);
    }
}

} // namespace kernel_conv2d_test
} // namespace semrover
