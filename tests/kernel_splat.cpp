// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "tests/support/splat_case.h"

#include <numbers>

namespace semrover {
namespace kernel_splat_test {

struct SplatCase {
    uint32_t splats, width, height, cameras;
    double smallest, largest; // sigmas, metres
};

// one pixel; one splat; odd sizes; specks smaller than a pixel; several cameras; many splats
const SplatCase kCases[] = {
    {40, 1, 1, 1, 0.05, 0.4},     {1, 33, 17, 1, 0.3, 0.3},      {300, 96, 64, 1, 0.03, 0.35},
    {150, 77, 53, 3, 0.03, 0.35}, {2000, 61, 47, 1, 1e-3, 1e-2}, {3000, 130, 66, 2, 0.02, 0.1},
};

TEST(kernel_splat, matches_a_rasterizer_in_double)
{
    for (const SplatCase& c : kCases) {
        SCOPED_TRACE(fmt::format("{} splats, {} x {}, {} cameras", c.splats, c.width, c.height, c.cameras));
        const std::vector<HostSplat> splats = random_splats(c.splats, 7, c.smallest, c.largest);
        std::vector<HostCamera> cameras;
        for (uint32_t i = 0; i < c.cameras; ++i)
            cameras.push_back(camera_for(c.width, c.height, 0.2 * i, -0.3 * i));
        const SplatPixels got = run_splats(splats, cameras, {.width = c.width, .height = c.height});
        for (uint32_t i = 0; i < c.cameras; ++i)
            compare(got, render_reference(splats, cameras[i], c.width, c.height), i);
    }
}

TEST(kernel_splat, the_image_does_not_depend_on_tiles_nor_on_the_run)
{
    const std::vector<HostSplat> splats = random_splats(4000, 3, 1e-3, 0.2);
    const std::vector<HostCamera> cameras = {camera_for(150, 70)};
    const SplatPixels first = run_splats(splats, cameras, {.width = 150, .height = 70, .tile = 16});
    EXPECT_TRUE(same(first, run_splats(splats, cameras, {.width = 150, .height = 70, .tile = 16})));
    EXPECT_TRUE(same(first, run_splats(splats, cameras, {.width = 150, .height = 70, .tile = 32})));
    EXPECT_TRUE(same(first, run_splats(splats, cameras, {.width = 150, .height = 70, .tile = 1024})));
}

TEST(kernel_splat, the_image_does_not_depend_on_the_order_in_the_file_unless_depths_tie)
{
    std::vector<HostSplat> splats = random_splats(500, 3);
    const std::vector<HostCamera> cameras = {camera_for(90, 60)};
    const SplatPixels first = run_splats(splats, cameras, {.width = 90, .height = 60});
    std::reverse(splats.begin(), splats.end());
    const SplatPixels second = run_splats(splats, cameras, {.width = 90, .height = 60});
    EXPECT_EQ(first.color, second.color);
    EXPECT_EQ(first.depth, second.depth);
}

TEST(kernel_splat, equal_depths_blend_by_index)
{
    std::vector<HostSplat> splats(2, {{0, 0, 2}, {0, 0, 1}, {1, 0, 0}, 0.2, 0.2, 0.7});
    splats[1].color = {0, 1, 0};
    const SplatPixels got = run_splats(splats, {camera_for(32, 32)}, {.width = 32, .height = 32});
    const size_t middle = 15 * 32 + 17;
    EXPECT_GT(got.color[middle * 4], 0.6);
    EXPECT_LT(got.color[middle * 4 + 1], 0.3);
    EXPECT_EQ(got.ids[middle * 2 + 1], 1000u);
}

// first and last tile that a splat's outline at 1/255 crosses, in x or y, as sampled; none on the image: {1, 0}
std::array<int64_t, 2> sampled_tiles(const ReferenceSplat& s, const Vector& row, double center, double opacity,
                                     uint32_t size)
{
    const double c = std::sqrt(2 * std::log(255 * opacity));
    double low = center - c * std::sqrt(0.5), high = center + c * std::sqrt(0.5);
    for (double angle = 0; angle < 2 * std::numbers::pi; angle += 0.01) {
        const Vector uv = {c * std::cos(angle), c * std::sin(angle), 1};
        low = std::min(low, dot(row, uv) / dot(s.tw, uv));
        high = std::max(high, dot(row, uv) / dot(s.tw, uv));
    }
    if (high < 0 || low >= size)
        return {1, 0};
    return {int64_t(std::max(low, 0.0) / 16), int64_t(std::min(high, size - 1.0) / 16)};
}

// docs/method.md §5.3, bounds: one splat, seen from anywhere, no pixel with alpha >= 1/255 is lost, and no tile is
// listed beyond a ring around its outline, unless that reaches the camera's plane
TEST(kernel_splat, bounds_hold_every_pixel_and_little_more)
{
    const uint32_t width = 96, height = 80;
    std::vector<HostSplat> splats = random_splats(200, 11, 0.01, 0.8);
    for (size_t i = 0; i < splats.size(); ++i) {
        if (i % 3 == 0) // close, so that it may reach the camera's plane
            splats[i].position[2] = 0.3 + 0.01 * double(i % 7);
        const SplatPixels got =
            run_splats({splats[i]}, {camera_for(width, height)}, {.width = width, .height = height});
        const ReferenceSplat placed = place(splats[i], camera_for(width, height));
        for (uint32_t y = 0; y < height; ++y)
            for (uint32_t x = 0; x < width; ++x) {
                double z;
                const double alpha = alpha_at(placed, splats[i].opacity, x + 0.5, y + 0.5, {}, z);
                const double found = got.color[(y * width + x) * 4 + 3];
                const bool threshold = std::abs(std::max(alpha, found) - 1.0 / 255) < 2e-5 || std::abs(z - 0.2) < 1e-4;
                ASSERT_TRUE(threshold || std::abs(found - alpha) < 2e-3)
                    << "splat " << i << " at " << x << ", " << y << ": " << found << ", not " << alpha;
            }
        if (placed.tw[2] <= 3.34 * std::hypot(placed.tw[0], placed.tw[1]))
            continue;
        const auto x = sampled_tiles(placed, placed.tu, placed.center[0], splats[i].opacity, width);
        const auto y = sampled_tiles(placed, placed.tv, placed.center[1], splats[i].opacity, height);
        ASSERT_LE(got.pairs, (x[1] - x[0] + 3) * (y[1] - y[0] + 3)) << "splat " << i;
    }
}

// section 7.2 (gsplat#863): across a tilted splat depth is that of the ray's hit, linear in 1/z, not that of the centre
TEST(kernel_splat, depth_follows_the_surface)
{
    const uint32_t size = 64;
    const HostSplat tilted = {{0, 0, 3}, {0, std::sqrt(0.5), -std::sqrt(0.5)}, {1, 1, 1}, 0.4, 0.4, 1};
    const HostCamera camera = {60, 60, 32, 32, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}};
    const SplatPixels got = run_splats({tilted}, {camera}, {.width = size, .height = size});
    for (uint32_t y = 26; y < 38; ++y) {
        const double ray = (y + 0.5 - 32) / 60; // y = ray z meets z - 3 = y: z = 3 / (1 - ray)
        ASSERT_NEAR(got.depth[(y * size + 32) * 2], 3 / (1 - ray), 1e-4) << y;
        ASSERT_NEAR(got.depth[(y * size + 32) * 2 + 1], 3 / (1 - ray), 1e-4) << y;
    }
}

// every pixel of two cameras with a limit of its own: before both splats, between them, behind them, without end, and
// of a z-buffer that is reversed
TEST(kernel_splat, what_lies_behind_a_z_buffer_is_not_seen)
{
    const uint32_t width = 37, height = 21, pixels = width * height;
    const HostSplat near = {{0, 0, 2}, {0, 0, 1}, {1, 0, 0}, 0.5, 0.5, 0.6},
                    far = {{0, 0, 4}, {0, 0, 1}, {0, 1, 0}, 1, 1, 0.8};
    const std::vector<HostCamera> cameras = {camera_for(width, height), camera_for(width, height, 0.1)};
    const SplatOptions options{.width = width, .height = height};
    HostSplat behind = near;
    behind.position[2] = -2;
    const SplatPixels none = run_splats({behind}, cameras, options), first = run_splats({near}, cameras, options),
                      both = run_splats({near, far}, cameras, options);
    const float metres[] = {1.5f, 3, 6, 1e9f};
    const SplatPixels* expected[] = {&none, &first, &both, &both};
    HostDepth standard{{}, {10.f * 0.1f / (0.1f - 10), 10 / (10 - 0.1f)}}, reversed{{}, {0.1f, 0}};
    for (uint32_t i = 0; i < 2 * pixels; ++i) {
        const float m = metres[i % 4];
        standard.z.push_back(i % 4 == 3 ? 2.f : standard.scale[1] + standard.scale[0] / m); // 2: beyond all distances
        reversed.z.push_back(i % 4 == 3 ? 0.f : 0.1f / m);
    }
    for (const HostDepth& test : {standard, reversed}) {
        const SplatPixels got = run_splats({near, far}, cameras, options, test);
        for (uint32_t i = 0; i < 2 * pixels; ++i) {
            const SplatPixels& e = *expected[i % 4];
            for (uint32_t c = 0; c < 4; ++c)
                ASSERT_EQ(got.color[4 * i + c], e.color[4 * i + c]) << i;
            ASSERT_EQ(got.depth[2 * i + 1], e.depth[2 * i + 1]) << i;
            ASSERT_EQ(got.ids[2 * i + 1], e.ids[2 * i + 1]) << i;
        }
    }
    EXPECT_NE(first.color, none.color);
    EXPECT_NE(first.color, both.color);
}

TEST(kernel_splat, what_is_not_a_splat_is_skipped)
{
    std::vector<HostSplat> splats = random_splats(60, 5);
    const std::vector<HostCamera> cameras = {camera_for(64, 48)};
    const SplatPixels clean = run_splats(splats, cameras, {.width = 64, .height = 48});
    std::vector<HostSplat> bad(9, splats[0]);
    bad[0].position[1] = NAN;
    bad[1].position[0] = INFINITY;
    bad[2].normal = {0, 0, 0};
    bad[3].normal[2] = NAN;
    bad[4].opacity = 0;
    bad[5].opacity = 0.5 / 255;
    bad[6].sigma_u = 0;
    bad[7].sigma_v = -1;
    bad[8].color[1] = NAN;
    splats.insert(splats.end(), bad.begin(), bad.end());
    const SplatPixels got = run_splats(splats, cameras, {.width = 64, .height = 48});
    EXPECT_TRUE(same(clean, got));
    EXPECT_EQ(got.visible, clean.visible);
}

TEST(kernel_splat, an_image_without_visible_splats_is_empty)
{
    HostSplat behind = random_splats(1, 1)[0];
    behind.position[2] = -3;
    const SplatPixels got = run_splats({behind}, {camera_for(40, 30)}, {.width = 40, .height = 30});
    EXPECT_EQ(got.visible, 0u);
    EXPECT_EQ(got.pairs, 0u);
    EXPECT_EQ(got.color, std::vector<float>(40 * 30 * 4, 0));
    EXPECT_EQ(got.ids, std::vector<uint32_t>(40 * 30 * 2, ~0u));
}

// section 7.9: a target of one pixel at (10.5, 20.5) lights the pixel (10, 20), and its neighbours only faintly
TEST(kernel_splat, pixel_centres_are_at_one_half)
{
    const HostCamera camera = {50, 50, 10.5, 20.5, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}};
    const SplatPixels got =
        run_splats({{{0, 0, 5}, {0, 0, 1}, {1, 1, 1}, 1e-3, 1e-3, 1}}, {camera}, {.width = 32, .height = 32});
    for (uint32_t y = 0; y < 32; ++y)
        for (uint32_t x = 0; x < 32; ++x) {
            const double r2 = 2 * (std::pow(x - 10.0, 2) + std::pow(y - 20.0, 2)),
                         alpha = std::min(0.99, std::exp(-r2 / 2));
            ASSERT_NEAR(got.color[(y * 32 + x) * 4 + 3], alpha < 1.0 / 255 ? 0 : alpha, 1e-5) << x << ", " << y;
        }
}

TEST(kernel_splat, what_did_not_fit_is_counted)
{
    const std::vector<HostSplat> splats = random_splats(500, 3);
    const std::vector<HostCamera> cameras = {camera_for(90, 60)};
    const SplatPixels whole = run_splats(splats, cameras, {.width = 90, .height = 60});
    const SplatPixels few_pairs = run_splats(splats, cameras, {.width = 90, .height = 60, .max_pairs = 100});
    const SplatPixels few_splats = run_splats(splats, cameras, {.width = 90, .height = 60, .max_visible = 17});
    EXPECT_GT(whole.visible, 17u);
    EXPECT_GT(whole.pairs, 100u);
    EXPECT_EQ(few_pairs.pairs, whole.pairs);
    EXPECT_EQ(few_splats.visible, whole.visible);
}

// a turn about an axis of the scene and a shift, [3, 4] row-major
using Motion = std::array<double, 12>;

Vector turned(const Motion& m, const Vector& v)
{
    return {m[0] * v[0] + m[1] * v[1] + m[2] * v[2], m[4] * v[0] + m[5] * v[1] + m[6] * v[2],
            m[8] * v[0] + m[9] * v[1] + m[10] * v[2]};
}

HostSplat moved(HostSplat s, const Motion& m)
{
    const Vector p = turned(m, s.position);
    s.position = {p[0] + m[3], p[1] + m[7], p[2] + m[11]};
    s.normal = turned(m, s.normal);
    return s;
}

// camera after motion, as the table has it
void append_view(std::vector<float>& views, const std::array<double, 12>& camera, const Motion& m)
{
    for (size_t row = 0; row < 3; ++row)
        for (size_t column = 0; column < 4; ++column) {
            double sum = column == 3 ? camera[row * 4 + 3] : 0;
            for (size_t i = 0; i < 3; ++i)
                sum += camera[row * 4 + i] * m[i * 4 + column];
            views.push_back(float(sum));
        }
}

// two movers among splats that stand, for two cameras; the second one is not there for the second camera
TEST(kernel_splat, things_that_move_are_drawn_where_they_are_and_others_stay)
{
    const uint32_t width = 96, height = 64;
    std::vector<HostSplat> splats = random_splats(400, 19, 0.05, 0.3);
    const std::vector<HostCamera> cameras = {camera_for(width, height), camera_for(width, height, 0.2, -0.3)};
    const double c = std::cos(0.4), s = std::sin(0.4);
    const Motion motions[2] = {{c, 0, s, -0.8, 0, 1, 0, 0.3, -s, 0, c, 0.9},
                               {c, -s, 0, 0.2, s, c, 0, -0.4, 0, 0, 1, 0.5}};
    HostMovers movers;
    for (uint32_t i = 0; i < splats.size(); ++i) {
        splats[i].sigma_v = splats[i].sigma_u; // round: axes follow from the normal, which turns
        movers.owners.push_back(i % 4 == 3 ? 5 + (i % 8 == 7) : 7 * i);
    }
    movers.rows = {0, 0, 0, 0, 0, 1, 2};
    for (size_t camera = 0; camera < 2; ++camera) {
        append_view(movers.views, cameras[camera].view, motions[0]);
        if (camera == 0)
            append_view(movers.views, cameras[camera].view, motions[1]);
        else
            movers.views.insert(movers.views.end(), 12, 0.f);
    }
    const SplatPixels got = run_splats(splats, cameras, {.width = width, .height = height}, {}, movers);
    for (size_t camera = 0; camera < 2; ++camera) {
        std::vector<HostSplat> there;
        for (uint32_t i = 0; i < splats.size(); ++i) {
            there.push_back(i % 4 == 3 ? moved(splats[i], motions[i % 8 == 7]) : splats[i]);
            if (camera == 1 && i % 8 == 7)
                there.back().opacity = 0;
        }
        const std::vector<ReferencePixel> expect = render_reference(there, cameras[camera], width, height);
        Misses misses;
        size_t owners_differ = 0, of_movers = 0;
        for (size_t i = 0; i < expect.size(); ++i) {
            const size_t at = camera * expect.size() + i;
            for (size_t a = 0; a < 3; ++a)
                misses.add(got.color[at * 4 + a], expect[i].color[a], 2e-3);
            const uint32_t owner = expect[i].splat < 0 ? 0 : movers.owners[size_t(expect[i].splat)];
            owners_differ += got.owners[at] != owner;
            of_movers += owner == 5 || owner == 6;
        }
        EXPECT_LE(misses.some, expect.size() * 3 / 1000) << camera;
        EXPECT_LE(owners_differ, expect.size() / 200 + 1) << camera;
        EXPECT_GT(of_movers, expect.size() / 20) << camera;
    }
}

} // namespace kernel_splat_test
} // namespace semrover
