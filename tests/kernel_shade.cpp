// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "kernels/trace.h"
#include "tests/support/kernel_case.h"
#include "tools/trace/trace_scene.h"

#include <bit>
#include <cmath>

namespace semrover {
namespace kernel_shade_test {

constexpr uint32_t kWidth = 45, kHeight = 37; // odd on purpose
constexpr double kPi = 3.14159265358979323846;
constexpr double kSun[3] = {0.48, 0.36, 0.8}, kSunLight = 2.0, kAlbedo = 0.4, kEye = 2.0;

// a floor of 200 m, and a black board that stands on it and throws a shadow
Mesh floor_and_board()
{
    Mesh m;
    m.materials = {{.name = "floor", .color = {float(kAlbedo), float(kAlbedo), float(kAlbedo)}},
                   {.name = "board", .color = {0, 0, 0}}};
    const auto quad = [&](std::array<std::array<float, 3>, 4> p, uint32_t material, uint8_t label) {
        const uint32_t i = uint32_t(m.positions.size());
        m.positions.insert(m.positions.end(), p.begin(), p.end());
        m.faces.insert(m.faces.end(), {{i, i + 1, i + 2}, {i, i + 2, i + 3}});
        m.face_materials.insert(m.face_materials.end(), {material, material});
        m.face_labels.insert(m.face_labels.end(), {label, label});
    };
    quad({{{-100, -100, 0}, {100, -100, 0}, {100, 100, 0}, {-100, 100, 0}}}, 0, 0);
    quad({{{6, 3, 0}, {6, -1, 0}, {6, -1, 1.5}, {6, 3, 1.5}}}, 1, 3);
    return m;
}

constexpr uint32_t kOwners[] = {0, 0, (1u << 22) - 1, (1u << 22) - 1}; // of faces: the board is a thing

struct Pixel {
    uint32_t color, depth, normal, label;
};

// looks along x, level, from 2 m; sky is black, so that the sun is all the light there is
std::vector<Pixel> picture(float sky, uint32_t samples)
{
    KernelCase k(test_device());
    const auto scene = DeviceTraceScene::create(test_device(), trace_tables(floor_and_board(), {}, {}, kOwners));
    EXPECT_TRUE(scene);
    const float light = float(kSunLight);
    const std::vector<float> view = {30,
                                     30,
                                     kWidth / 2.f,
                                     kHeight / 2.f,
                                     0,
                                     -1,
                                     0,
                                     0,
                                     0,
                                     0,
                                     -1,
                                     0,
                                     1,
                                     0,
                                     0,
                                     float(kEye),
                                     float(kSun[0]),
                                     float(kSun[1]),
                                     float(kSun[2]),
                                     0,
                                     light,
                                     light,
                                     light,
                                     0,
                                     1,
                                     sky,
                                     0,
                                     1e12f,
                                     0,
                                     0,
                                     0,
                                     0};
    const Tensor y = shade(k.graph, scene->in(k.graph), k.input(view, 4),
                           {.width = kWidth, .height = kHeight, .samples = samples, .ambient_rays = 2});
    const Tensor out = k.output(y.rows, 4, DType::u32, 4);
    k.graph.keep(y, out);
    const Status status = k.compile_and_run();
    EXPECT_TRUE(status) << status.error().message;
    return k.read_array<Pixel>(out);
}

double srgb(double c)
{
    return c <= 0.0031308 ? 12.92 * c : 1.055 * std::pow(c, 1 / 2.4) - 0.055;
}

TEST(kernel_shade, a_floor_in_the_sun_follows_lambert_and_shadows_are_black)
{
    const std::vector<Pixel> pixels = picture(0, 1);
    const double lit = srgb(kAlbedo * kSunLight * kSun[2] / kPi) * 255;
    int shadowed = 0, sunny = 0, board = 0;
    for (uint32_t row = 0; row < kHeight; ++row)
        for (uint32_t col = 0; col < kWidth; ++col) {
            const Pixel& p = pixels[row * kWidth + col];
            SCOPED_TRACE(fmt::format("row {} column {}", row, col));
            const double right = (col + 0.5 - kWidth / 2.0) / 30, down = (row + 0.5 - kHeight / 2.0) / 30;
            const double y = -6 * right, z = kEye - 6 * down; // in the board's plane
            const double edge = std::max({-1 - y, y - 3, z - 1.5});
            if (std::abs(edge) < 0.02 || std::abs(down) < 0.021 || std::abs(z) < 0.05)
                continue;
            const double depth = std::bit_cast<float>(p.depth);
            if (edge < 0 && kEye / std::max(down, 1e-9) > 6) {
                ++board;
                EXPECT_EQ(p.label, 0x3fffff03u);
                EXPECT_NEAR(depth, 6, 1e-4);
                EXPECT_EQ(p.normal & 0xffffff, 0x810000u); // towards the camera: z = -127
            } else if (down < 0) {
                EXPECT_EQ(p.label, 10u);
                EXPECT_EQ(depth, 0);
            } else {
                EXPECT_EQ(p.label, 0u);
                const double far = kEye / down, fx = far, fy = -right * far;
                if (far > 99 || std::abs(fy) > 99)
                    continue;
                EXPECT_NEAR(depth, far, 1e-3 * far);
                EXPECT_EQ(p.normal & 0xffffff, 0x008100u); // up: y = -127
                const double t = (6 - fx) / kSun[0], by = fy + t * kSun[1], bz = t * kSun[2];
                const double cover = std::max({-1 - by, by - 3, bz - 1.5, -t});
                if (std::abs(cover) < 0.1)
                    continue;
                EXPECT_NEAR(p.color & 255, cover < 0 ? 0 : lit, 1.01);
                cover < 0 ? ++shadowed : ++sunny;
            }
        }
    EXPECT_GT(board, 50);
    EXPECT_GT(shadowed, 5);
    EXPECT_GT(sunny, 200);
}

TEST(kernel_shade, more_samples_leave_depth_and_labels_as_they_are)
{
    const std::vector<Pixel> one = picture(0.5f, 1), five = picture(0.5f, 5), again = picture(0.5f, 5);
    for (size_t i = 0; i < one.size(); ++i) {
        ASSERT_EQ(one[i].depth, five[i].depth);
        ASSERT_EQ(one[i].label, five[i].label);
        ASSERT_EQ(one[i].normal, five[i].normal);
        ASSERT_EQ(five[i].color, again[i].color);
    }
}

} // namespace kernel_shade_test
} // namespace semrover
