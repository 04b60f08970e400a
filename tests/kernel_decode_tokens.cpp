// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "kernels/sampling.h"
#include "tests/support/kernel_case.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace semrover {
namespace kernel_decode_tokens_test {

using Normalization = std::array<float, 12>; // mean, std
constexpr Normalization kNone = {-0.f, -0.f, -0.f, -0.f, -0.f, -0.f, 1, 1, 1, 1, 1, 1};
constexpr Normalization kSome = {0.01f, -0.02f, 0.1f, 0.2f, -0.1f, 0.05f, 0.5f, 0.6f, 0.4f, 0.7f, 0.3f, 1.2f};

struct Stored {
    std::array<uint16_t, 3> place;
    std::array<uint8_t, 3> color;
};

// a token's points one by one, in the order of their distances as doubles
std::vector<Stored> expected(const float* token, uint32_t n, const Normalization& norm, float half_voxel)
{
    const auto value = [&](uint32_t i, uint32_t c) {
        const float scaled = token[6 * i + c] * norm[6 + c];
        return std::clamp(scaled + norm[c], -1.f, 1.f);
    };
    std::vector<Stored> points(n);
    std::vector<std::array<double, 4>> keys(n);
    for (uint32_t i = 0; i < n; ++i)
        for (uint32_t a = 0; a < 3; ++a) {
            points[i].place[a] = float_to_half(value(i, a) * half_voxel);
            const double metres = half_to_float(points[i].place[a]);
            keys[i][0] += metres * metres;
            keys[i][1 + a] = metres;
            points[i].color[a] = uint8_t(std::lround((value(i, 3 + a) + 1) * 127.5f));
        }
    std::vector<uint32_t> order(n);
    std::iota(order.begin(), order.end(), 0);
    std::ranges::stable_sort(order, [&](uint32_t a, uint32_t b) { return keys[a] < keys[b]; });
    std::vector<Stored> sorted;
    for (const uint32_t i : order)
        sorted.push_back(points[i]);
    return sorted;
}

std::vector<uint32_t> decoded(const HostMatrix& tokens, const Normalization& norm, float half_voxel)
{
    KernelCase k(test_device());
    const uint32_t words = tokens.cols / 2;
    const Tensor out = k.output(tokens.rows, words, DType::u32, words);
    k.graph.keep(
        decode_tokens(k.graph, k.input(tokens), k.input(std::vector<float>(norm.begin(), norm.end()), 6), half_voxel),
        out);
    const Status status = k.compile_and_run();
    EXPECT_TRUE(status) << status.error().message;
    return k.read_array<uint32_t>(out);
}

void expect_decoded(const HostMatrix& tokens, const Normalization& norm, float half_voxel)
{
    const uint32_t n = tokens.cols / 6;
    const std::vector<uint32_t> words = decoded(tokens, norm, half_voxel);
    ASSERT_EQ(words.size(), size_t(tokens.rows) * 3 * n);
    for (uint32_t r = 0; r < tokens.rows; ++r) {
        const std::vector<Stored> points = expected(&tokens.values[size_t(r) * tokens.ld], n, norm, half_voxel);
        for (uint32_t i = 0; i < n; ++i) {
            const uint32_t* w = &words[3 * (size_t(r) * n + i)];
            const Stored& e = points[i];
            ASSERT_EQ(w[0], uint32_t(e.place[0]) | uint32_t(e.place[1]) << 16) << "token " << r << " point " << i;
            ASSERT_EQ(w[1], e.place[2]) << "token " << r << " point " << i;
            ASSERT_EQ(w[2], e.color[0] | uint32_t(e.color[1]) << 8 | uint32_t(e.color[2]) << 16)
                << "token " << r << " point " << i;
        }
    }
}

TEST(kernel_decode_tokens, has_the_bits_of_points_decoded_one_by_one)
{
    for (const uint32_t n : {1u, 3u, 20u, 33u})
        for (const Normalization& norm : {kNone, kSome})
            for (const float half_voxel : {0.3f, 0.1f, 5e-5f}) {
                KernelCase k(test_device(), n);
                expect_decoded(k.random(37, 6 * n, DType::f32, 1.2f), norm, half_voxel);
            }
}

// few places, so that many points are as far, or at the same place; both zeros; numbers beyond the voxel
TEST(kernel_decode_tokens, orders_ties_by_place_and_then_as_they_come)
{
    const float places[] = {0.f, -0.f, 0.5f, -0.5f, 0.25f, 3, -3, 1e-6f, -1e-7f};
    HostMatrix tokens(50, 6 * 20, DType::f32);
    KernelCase k(test_device());
    const std::vector<uint32_t> chosen = k.indices(50 * 60, std::size(places));
    for (uint32_t i = 0; i < chosen.size(); ++i) {
        tokens.set(i / 60, i % 60 / 3 * 6 + i % 3, places[chosen[i]]);
        tokens.set(i / 60, i % 60 / 3 * 6 + 3 + i % 3, float(i % 256) / 255);
    }
    expect_decoded(tokens, kNone, 0.3f);
}

// every fp16 number up to a voxel's border, at distances whose squares are close
TEST(kernel_decode_tokens, rounds_and_orders_the_smallest_and_the_largest_offsets)
{
    std::vector<float> values;
    for (uint32_t h = 0; h < 0x3c00; h += 7)
        for (const float sign : {1.f, -1.f})
            values.push_back(sign * std::nextafter(half_to_float(uint16_t(h)), h % 2 ? 2.f : -2.f));
    const uint32_t rows = uint32_t(values.size() / 60);
    HostMatrix tokens(rows, 6 * 20, DType::f32);
    for (uint32_t i = 0; i < rows * 60; ++i)
        tokens.set(i / 60, i % 60 / 3 * 6 + i % 3, values[i]);
    for (const float half_voxel : {1.f, 0.5f})
        expect_decoded(tokens, kNone, half_voxel);
    // coordinates of 31 bits in units of the smallest number: the third of them decides
    HostMatrix wide(1, 12, DType::f32);
    for (uint32_t c = 0; c < 3; ++c) {
        wide.set(0, c, 1);
        wide.set(0, 6 + c, c == 2 ? 0.9995f : 1);
    }
    const std::vector<uint32_t> words = decoded(wide, kNone, kMostHalfVoxel);
    EXPECT_EQ(words[1], float_to_half(0.9995f * kMostHalfVoxel));
    EXPECT_EQ(words[4], float_to_half(kMostHalfVoxel));
}

TEST(kernel_decode_tokens, rounds_colours_to_the_nearest_and_halves_up)
{
    HostMatrix tokens(1, 6 * 513, DType::f32);
    for (uint32_t i = 0; i < 513; ++i)
        for (uint32_t c = 0; c < 3; ++c) {
            const float v = float(i) / 255 - 1; // every second one is halfway
            tokens.set(0, 6 * i + 3 + c, c == 0 ? v : std::nextafter(v, c == 1 ? -2.f : 2.f));
        }
    expect_decoded(tokens, kNone, 0.3f);
}

TEST(kernel_decode_tokens, marks_points_with_numbers_that_are_not_finite)
{
    for (const float wrong : {INFINITY, -INFINITY, std::nanf("")})
        for (const uint32_t channel : {0u, 4u, 11u}) {
            HostMatrix tokens(2, 12, DType::f32);
            tokens.set(1, channel, wrong);
            const std::vector<uint32_t> words = decoded(tokens, kNone, 0.3f);
            EXPECT_EQ(words[1] >> 31 | words[4] >> 31, 0u);
            EXPECT_EQ((words[7] >> 31) + (words[10] >> 31), 1u) << wrong << " in channel " << channel;
        }
}

} // namespace kernel_decode_tokens_test
} // namespace semrover
