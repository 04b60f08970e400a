// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "tests/support/feature_map_case.h"

#include <cmath>

namespace semrover {
namespace kernel_group_norm_test {

struct NormCase {
    uint32_t batch, height, width, channels, channels2, groups;
    bool silu;
    float mean;          // of x: a large one costs digits where sums of squares are taken naively
    uint32_t images = 1; // that have their statistics together
};

const NormCase kCases[] = {
    {1, 1, 1, 8, 0, 8, false, 0},
    {1, 1, 2, 8, 0, 1, false, 0},
    {2, 5, 7, 16, 0, 8, true, 0},
    {1, 9, 31, 20, 0, 5, true, 0},
    {2, 13, 19, 16, 8, 3, true, 0},
    {1, 4, 4, 24, 40, 8, false, 0},
    {2, 16, 16, 8, 0, 2, false, 300},
    {6, 5, 7, 16, 0, 8, true, 0, 3},
    {4, 1, 1, 8, 8, 16, false, 0, 4},
    {2, 9, 11, 24, 0, 3, true, 0, 2},
    // so many moments that a pass of their own merges chunks first: 18 and 21 of 16 pixels, the last one of one pixel
    // and of two; groups across both inputs; more channels than threads
    {2, 13, 21, 512, 0, 1, false, 0},
    {4, 14, 23, 72, 328, 2, true, 30, 2},
    {1, 13, 21, 512, 0, 1, false, 300},
};

struct Statistics {
    double mean = 0, var = 0;
};

double value(const NormCase& c, const HostImages& x, const HostImages& x2, uint32_t image, uint32_t pixel, uint32_t k)
{
    return k < c.channels ? x.at(image, pixel / c.width, pixel % c.width, k)
                          : x2.at(image, pixel / c.width, pixel % c.width, k - c.channels);
}

Statistics statistics(const NormCase& c, const HostImages& x, const HostImages& x2, uint32_t set, uint32_t group)
{
    const uint32_t size = (c.channels + c.channels2) / c.groups, pixels = c.height * c.width;
    const double count = double(c.images) * pixels * size;
    const auto sum = [&](const auto& term) {
        double s = 0;
        for (uint32_t i = set * c.images; i < (set + 1) * c.images; ++i)
            for (uint32_t p = 0; p < pixels; ++p)
                for (uint32_t k = group * size; k < (group + 1) * size; ++k)
                    s += term(value(c, x, x2, i, p, k));
        return s;
    };
    Statistics s;
    s.mean = sum([](double v) { return v; }) / count;
    s.var = sum([&](double v) { return (v - s.mean) * (v - s.mean); }) / count;
    return s;
}

// of all sets, group by group
std::vector<Statistics> statistics(const NormCase& c, const HostImages& x, const HostImages& x2)
{
    std::vector<Statistics> all;
    for (uint32_t set = 0; set < c.batch / c.images; ++set)
        for (uint32_t group = 0; group < c.groups; ++group)
            all.push_back(statistics(c, x, x2, set, group));
    return all;
}

void check(const NormCase& c, DType dtype)
{
    SCOPED_TRACE(fmt::format("{} x {}x{}x{}+{} groups {} of {} images {}", c.batch, c.height, c.width, c.channels,
                             c.channels2, c.groups, c.images, dtype_name(dtype)));
    KernelCase k(test_device());
    const uint32_t cols = c.channels + c.channels2;
    HostImages x = random_images(k, c.batch, c.height, c.width, c.channels, dtype);
    for (uint32_t r = 0; r < x.rows.rows; ++r)
        for (uint32_t i = 0; i < c.channels; ++i)
            x.rows.set(r, i, x.rows.at(r, i) + c.mean);
    const HostImages x2 = c.channels2 ? random_images(k, c.batch, c.height, c.width, c.channels2, dtype) : HostImages{};
    const HostMatrix weight = k.random(1, cols, DType::f32), bias = k.random(1, cols, DType::f32);
    const auto input = [&](const HostImages& images) {
        const FeatureMap map = images.input(k);
        return NormInput{map, channel_moments(k.graph, map)};
    };
    GroupNormOptions options;
    options.groups = c.groups;
    options.silu = c.silu;
    options.images = c.images;
    options.dtype = dtype;
    const FeatureMap y =
        group_norm(k.graph, input(x), c.channels2 ? input(x2) : NormInput{}, k.input(weight), k.input(bias), options);
    const HostImages got{c.height, c.width, k.run(y.data)};
    const std::vector<Statistics> expected = statistics(c, x, x2);
    for (uint32_t image = 0; image < c.batch; ++image)
        for (uint32_t p = 0; p < c.height * c.width; ++p)
            for (uint32_t i = 0; i < cols; ++i) {
                const Statistics& s = expected[image / c.images * c.groups + i / (cols / c.groups)];
                const double in = value(c, x, x2, image, p, i), scale = weight.at(0, i) / std::sqrt(s.var + 1e-5);
                const double normed = (in - s.mean) * scale + bias.at(0, i);
                const double v = c.silu ? normed / (1 + std::exp(-normed)) : normed;
                // of the terms x scale and mean scale, whose difference the kernel forms
                const double magnitude = (std::abs(in) + std::abs(s.mean)) * std::abs(scale) + std::abs(normed);
                const double tolerance = 1e-6 * (magnitude + 1) + (dtype == DType::f16 ? 6e-4 * std::abs(v) : 0);
                ASSERT_NEAR(got.at(image, p / c.width, p % c.width, i), v, tolerance)
                    << "image " << image << " pixel " << p << " channel " << i;
            }
    k.expect_zero_padding(got.rows);
}

TEST(kernel_group_norm, matches_two_passes_in_double)
{
    for (const NormCase& c : kCases)
        for (DType dtype : {DType::f32, DType::f16})
            check(c, dtype);
}

// weight / sqrt(eps) is in the hundreds there: what is left of x - mean would show, of the producer's statistics, too
TEST(kernel_group_norm, leaves_the_bias_of_a_group_of_one_pixel)
{
    for (DType dtype : {DType::f32, DType::f16}) {
        KernelCase k(test_device());
        const HostImages x = random_images(k, 2, 1, 1, 24, dtype);
        const HostMatrix w = k.random(40, 24, dtype, 8), weight = k.random(1, 40, DType::f32);
        const HostMatrix bias = k.random(1, 40, DType::f32);
        const FeatureMap in = x.input(k), made = in.with(gemm(k.graph, in.data, k.input(w), {}, {.dtype = dtype}));
        GroupNormOptions options;
        options.groups = 40;
        options.eps = 1e-6f;
        options.dtype = dtype;
        const NormInput input{made, channel_moments(k.graph, made)};
        const HostMatrix y = k.run(group_norm(k.graph, input, {}, k.input(weight), k.input(bias), options).data);
        for (uint32_t image = 0; image < 2; ++image)
            for (uint32_t c = 0; c < 40; ++c)
                ASSERT_NEAR(y.at(image * 16, c), bias.at(0, c),
                            dtype == DType::f16 ? 4.9e-4 * std::abs(bias.at(0, c)) : 0)
                    << "image " << image << " channel " << c;
    }
}

// statistics taken in the epilogue of the pass that makes x are those of a pass of their own
TEST(kernel_group_norm, takes_statistics_from_the_producer)
{
    for (DType dtype : {DType::f32, DType::f16}) {
        KernelCase k(test_device());
        const HostImages x = random_images(k, 2, 9, 11, 24, dtype);
        const HostMatrix w = k.random(40, 24, dtype), w3 = k.random(40, 9 * 24, dtype);
        const FeatureMap in = x.input(k), linear = in.with(gemm(k.graph, in.data, k.input(w), {}, {.dtype = dtype}));
        ConvOptions options;
        options.dtype = dtype;
        const FeatureMap spatial = conv2d(k.graph, in, {}, k.input(w3), {}, options);
        const FeatureMap sum = spatial.with(add(k.graph, spatial.data, linear.data));
        const Tensor of_linear = channel_moments(k.graph, linear), of_sum = channel_moments(k.graph, sum);
        const Tensor maps[] = {linear.data, sum.data, of_linear, of_sum};
        Tensor out[4];
        for (size_t i = 0; i < 4; ++i) {
            out[i] = k.output(maps[i].rows, maps[i].cols, maps[i].dtype, maps[i].ld);
            k.graph.keep(maps[i], out[i]);
        }
        ASSERT_TRUE(k.compile_and_run());
        EXPECT_EQ(k.plan().passes.size(), 2u); // the residual and both statistics are in the epilogues
        for (size_t i = 0; i < 2; ++i) {
            const HostMatrix values = k.read(out[i]), moments = k.read(out[2 + i]);
            for (uint32_t chunk = 0; chunk < moments.rows; ++chunk)
                for (uint32_t c = 0; c < 40; ++c) {
                    double mean = 0, m2 = 0;
                    uint32_t n = 0;
                    for (uint32_t r = chunk * 16; r < chunk * 16 + 16; ++r)
                        if (r % x.image_rows() < 99)
                            mean += values.at(r, c), ++n;
                    mean /= n;
                    for (uint32_t r = chunk * 16; r < chunk * 16 + 16; ++r)
                        if (r % x.image_rows() < 99)
                            m2 += (values.at(r, c) - mean) * (values.at(r, c) - mean);
                    const double tolerance = dtype == DType::f16 ? 1e-2 : 1e-5;
                    ASSERT_NEAR(moments.at(chunk, 2 * c), mean, tolerance) << chunk << " " << c;
                    ASSERT_NEAR(moments.at(chunk, 2 * c + 1), m2, tolerance * (1 + 10 * m2)) << chunk << " " << c;
                }
        }
    }
}

} // namespace kernel_group_norm_test
} // namespace semrover
