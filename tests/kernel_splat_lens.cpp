// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "lens_trip.spv.h"
#include "tests/support/splat_case.h"

#include <numbers>

namespace semrover {
namespace kernel_splat_lens_test {

constexpr std::array<double, 12> kStraight = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};

using semrover::narrowed;

// numbers as fp32 has them
Intrinsics narrowed(Intrinsics k)
{
    for (double* v : {&k.fx, &k.fy, &k.cx, &k.cy})
        *v = narrowed(*v);
    for (double& v : k.distortion)
        v = narrowed(v);
    return k;
}

Intrinsics lens(CameraModel model, uint32_t width, uint32_t height, std::array<double, 12> distortion = {},
                double focal = 0.6)
{
    if (model == CameraModel::equirectangular)
        return narrowed(whole_sphere(width, height));
    return narrowed(
        {focal * width, 1.04 * focal * width, width / 2.0 + 1.3, height / 2.0 - 0.7, width, height, model, distortion});
}

const std::array<double, 12> kBarrel = {-0.3, 0.1, 0.002, -0.001, -0.01};
const std::array<double, 12> kRational = {0.4, -0.05, 0.001, 0.0015, 0.01, 0.75, 0.1, 0.02};
const std::array<double, 12> kKannala = {-0.03, 0.012, -0.006, 0.0009};

const std::array<double, 12> kPrism = {-0.25, 0.08, 0.002, -0.001, 0, 0, 0, 0, 0.02, -0.01, -0.015, 0.005};

// an f-theta lens that sees up to an angle, with its polynomial from angles to pixels or back
Intrinsics ftheta(uint32_t width, uint32_t height, bool backward, double angle)
{
    const double f = 0.5 * width / angle;
    Distortion d = {f, 0.02 * f, -0.03 * f, 0, 0.002 * f, 1.01, 0.004, -0.003, angle, 0};
    if (backward)
        d = {1 / f, 0, 0.02 / (f * f * f), 0, 0, 0.99, -0.003, 0.005, angle, 1};
    return narrowed(Intrinsics{1, 1, width / 2.0 + 0.4, height / 2.0 - 0.6, width, height, CameraModel::ftheta, d});
}

std::array<double, 12> turned(double yaw, double pitch, double shift)
{
    const double c = std::cos(yaw), s = std::sin(yaw), d = std::cos(pitch), t = std::sin(pitch);
    std::array<double, 12> view = {c, 0, s, shift, t * s, d, -t * c, 0.1, -d * s, t, d * c, -0.2};
    for (double& v : view)
        v = narrowed(v);
    return view;
}

struct LensCase {
    Intrinsics intrinsics;
    uint32_t splats, cameras;
};

std::vector<LensCase> lens_cases()
{
    return {{lens(CameraModel::opencv, 1, 1, kBarrel), 40, 1},
            {lens(CameraModel::opencv, 96, 64, kBarrel), 300, 1},
            {lens(CameraModel::opencv, 77, 53, kRational, 0.35), 200, 3},
            {lens(CameraModel::opencv, 90, 70, kPrism, 0.5), 300, 1},
            {ftheta(90, 70, false, 1.2), 300, 1},
            {ftheta(64, 64, true, 1.9), 300, 2},
            {lens(CameraModel::fisheye, 1, 1), 40, 1},
            {lens(CameraModel::fisheye, 90, 70, kKannala, 0.4), 300, 1},
            {lens(CameraModel::fisheye, 61, 67, {}, 0.2), 300, 2}, // sees behind itself
            {lens(CameraModel::equirectangular, 2, 1), 30, 1},
            {lens(CameraModel::equirectangular, 128, 64), 400, 1},
            {lens(CameraModel::equirectangular, 75, 41), 300, 2}};
}

TEST(kernel_splat_lens, matches_a_ray_caster_in_double)
{
    for (const LensCase& c : lens_cases()) {
        const Intrinsics& k = c.intrinsics;
        SCOPED_TRACE(fmt::format("{} {} x {}", name_of(k.model), k.width, k.height));
        const std::vector<HostSplat> splats = splats_around(c.splats, 7, 0.03);
        std::vector<LensCamera> cameras;
        for (uint32_t i = 0; i < c.cameras; ++i)
            cameras.push_back({k, turned(0.4 * i, 0.1, -0.1 * i)});
        const SplatPixels got = run_splats(splats, cameras);
        for (uint32_t i = 0; i < c.cameras; ++i)
            compare(got, render_reference(splats, cameras[i]), i);
    }
}

// docs/method.md §5.4, bounds: one splat, seen from anywhere, no pixel with alpha >= 1/255 is lost
TEST(kernel_splat_lens, bounds_hold_every_pixel)
{
    const Intrinsics models[] = {lens(CameraModel::opencv, 80, 60, kBarrel),
                                 lens(CameraModel::opencv, 80, 60, kRational, 0.35),
                                 lens(CameraModel::fisheye, 64, 64, kKannala, 0.25),
                                 lens(CameraModel::fisheye, 64, 64, {}, 0.17),
                                 lens(CameraModel::equirectangular, 96, 48),
                                 lens(CameraModel::opencv, 80, 60, kPrism, 0.5),
                                 ftheta(80, 60, false, 1.3),
                                 ftheta(64, 64, true, 2.2)};
    std::vector<HostSplat> splats = splats_around(60, 11, 0.01, 0.8);
    for (size_t i = 0; i < splats.size(); ++i) {
        if (i % 3 == 0) // close, so that the camera may be within the splat's sphere
            for (double& v : splats[i].position)
                v = narrowed(v * 0.12);
        if (i % 5 == 4) { // at a pole of a panorama, straight behind the others
            splats[i].position = {narrowed(0.01 * double(i)), i % 2 ? 2.0 : -2.0, 0.02};
            splats[i].normal = {0, 1, 0};
        }
        for (const Intrinsics& k : models) {
            const LensCamera camera{k, i % 5 == 4 && k.model != CameraModel::equirectangular
                                           ? std::array<double, 12>{1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0}
                                           : kStraight};
            const SplatPixels got = run_splats({splats[i]}, std::vector{camera});
            const Lens mapping(k);
            const LensSplat placed = place(splats[i], camera, mapping, {});
            for (uint32_t at = 0; at < k.width * k.height; ++at) {
                const double x = at % k.width + 0.5, y = at / k.width + 0.5, found = got.color[at * 4 + 3];
                const auto ray = mapping.ray(x, y);
                double z = 0, alpha = 0;
                if (ray && placed.kept)
                    alpha = alpha_at(placed, splats[i], camera, mapping, x, y, *ray, {}, z);
                const bool near = ray && std::abs(dot(placed.normal, placed.center) / dot(placed.normal, *ray) *
                                                      (k.model == CameraModel::opencv ? (*ray)[2] : 1) -
                                                  0.2) < 1e-4;
                const bool threshold = std::abs(std::max(alpha, found) - 1.0 / 255) < 2e-5 || near;
                ASSERT_TRUE(threshold || std::abs(found - alpha) < 2e-3)
                    << "splat " << i << " of " << name_of(k.model) << " at " << x << ", " << y << ": " << found
                    << ", not " << alpha;
            }
        }
    }
}

// pixels of pictures of 1920 x 1200: their rays as the host has them, and their way there and back
TEST(kernel_splat_lens, the_device_finds_rays_and_pixels_as_the_host_does)
{
    const uint32_t width = 1920, height = 1200;
    struct {
        Intrinsics k;
        double pixels, rays; // tolerances
    } const cases[] = {
        {lens(CameraModel::opencv, width, height, kBarrel), 1e-3, 1e-6},
        {lens(CameraModel::opencv, width, height, kRational, 0.35), 1e-3, 3e-6}, // it rises little far out
        {lens(CameraModel::opencv, width, height, kPrism, 0.5), 1e-3, 1e-6},
        {lens(CameraModel::fisheye, width, height, kKannala, 0.25), 1e-3, 1e-6},
        {lens(CameraModel::equirectangular, width, height), 1e-3, 1e-6},
        {ftheta(width, height, false, 1.2), 1e-3, 1e-6},
        {ftheta(width, height, true, 1.9), 1e-3, 1e-6}};
    for (const auto& [k, pixel_tolerance, ray_tolerance] : cases) {
        std::vector<float> pixels, table(kLensCameraFloats);
        for (uint32_t y = 0; y < height; y += 13)
            for (uint32_t x = 0; x < width; x += 7)
                pixels.insert(pixels.end(), {float(x) + 0.5f, float(y) + 0.5f});
        write_row(splat_camera(k, {}), table);
        KernelCase c(test_device());
        const LensTripPush push{.count = uint32_t(pixels.size() / 2)};
        const Tensor y = c.output(push.count * 2, 4, DType::f32, 4);
        c.graph.dispatch(kernel::lens_trip,
                         {{"Cameras", c.input(table, kLensCameraFloats)}, {"Pixels", c.input(pixels, 2)}, {"Y", y}},
                         push, threads(push.count), {.constants = {{"kModel", uint32_t(k.model)}}});
        const Status status = c.compile_and_run();
        ASSERT_TRUE(status) << status.error().message;
        const auto got = c.read_array<float>(y);
        const Lens host(k);
        double trip = 0, ray = 0;
        size_t seen = 0, differ = 0;
        for (size_t i = 0; i < push.count; ++i) {
            const auto expect = host.ray(pixels[2 * i], pixels[2 * i + 1]);
            differ += expect.has_value() != (got[8 * i + 3] != 0);
            if (!expect || got[8 * i + 3] == 0)
                continue;
            ++seen;
            for (size_t a = 0; a < 3; ++a)
                ray = std::max(ray, std::abs(got[8 * i + a] - (*expect)[a]));
            for (size_t a = 0; a < 2; ++a)
                trip = std::max(trip, std::abs(double(got[8 * i + 4 + a]) - pixels[2 * i + a]));
        }
        fmt::print("{}: {} rays, off by {:.2g}; there and back by {:.2g} pixels\n", name_of(k.model), seen, ray, trip);
        EXPECT_GT(seen, push.count / 3u);
        EXPECT_LE(differ, push.count / 500u); // at the edge of the lens
        EXPECT_LT(ray, ray_tolerance) << name_of(k.model);
        EXPECT_LT(trip, pixel_tolerance) << name_of(k.model);
    }
}

TEST(kernel_splat_lens, an_opencv_lens_without_distortion_is_a_pinhole)
{
    const std::vector<HostSplat> splats = random_splats(600, 7, 0.03);
    const Intrinsics k = lens(CameraModel::opencv, 130, 66);
    const HostCamera pinhole{k.fx, k.fy, k.cx, k.cy, turned(0.2, 0, -0.1)};
    const SplatPixels got = run_splats(splats, std::vector{LensCamera{k, pinhole.view}}),
                      expect = run_splats(splats, std::vector{pinhole}, {.width = 130, .height = 66});
    size_t off = 0;
    for (size_t i = 0; i < got.color.size(); ++i) {
        off += !(std::abs(got.color[i] - expect.color[i]) <= 2e-3);
        off += !(std::abs(got.surface[i] - expect.surface[i]) <= 2e-2);
    }
    EXPECT_LE(off, got.color.size() / 1000);
    EXPECT_GT(expect.visible, 500u);
}

// the middle of a dot, by its weights in the picture
std::array<double, 2> middle_of(const SplatPixels& image, uint32_t width)
{
    double weight = 0, x = 0, y = 0;
    for (size_t i = 0; i < image.color.size() / 4; ++i) {
        const double a = image.color[i * 4 + 3];
        weight += a;
        x += a * (double(i % width) + 0.5);
        y += a * (double(i / width) + 0.5);
    }
    return {x / weight, y / weight};
}

// section 7.7: with all k = 0 a dot at an angle t from the axis is f t away from the centre
TEST(kernel_splat_lens, a_fisheye_without_distortion_puts_a_grid_of_dots_at_f_times_their_angles)
{
    const uint32_t size = 201;
    const double focal = 50;
    const Intrinsics k{focal, focal, 100.5, 100.5, size, size, CameraModel::fisheye};
    for (const double angle : {0.0, 0.3, 0.9, 1.5, 1.8})
        for (const double around : {0.0, 1.0, 2.5, 4.0}) {
            const HostSplat dot{{narrowed(5 * std::sin(angle) * std::cos(around)),
                                 narrowed(5 * std::sin(angle) * std::sin(around)), narrowed(5 * std::cos(angle))},
                                {0, 0, 1},
                                {1, 1, 1},
                                1e-3,
                                1e-3,
                                0.9};
            const auto middle = middle_of(run_splats({dot}, std::vector{LensCamera{k, kStraight}}), size);
            EXPECT_NEAR(middle[0], 100.5 + focal * angle * std::cos(around), 0.02) << angle << ", " << around;
            EXPECT_NEAR(middle[1], 100.5 + focal * angle * std::sin(around), 0.02) << angle << ", " << around;
        }
}

TEST(kernel_splat_lens, a_splat_on_the_seam_of_a_panorama_appears_on_both_sides)
{
    const uint32_t width = 160, height = 80;
    const HostSplat behind{{0, 0, -3}, {0, 0, 1}, {1, 1, 1}, 0.3, 0.3, 0.9};
    const LensCamera camera{lens(CameraModel::equirectangular, width, height), kStraight};
    const SplatPixels got = run_splats({behind}, std::vector{camera});
    EXPECT_LE(got.pairs, 2u * 4u); // tiles on both sides, not those between
    const auto alpha = [&](uint32_t x) { return got.color[(height / 2 * width + x) * 4 + 3]; };
    // half a pixel away in both directions, 3 m off
    const double across = 3 * std::numbers::pi / width / 0.3, down = 3 * std::numbers::pi / height / 2 / 0.3;
    EXPECT_NEAR(alpha(0), 0.9 * std::exp(-(across * across + down * down) / 2), 2e-3);
    for (uint32_t x = 0; x < width / 2; ++x)
        EXPECT_NEAR(alpha(x), alpha(width - 1 - x), 1e-5) << x;
    EXPECT_EQ(alpha(width / 4), 0);
    HostSplat dot = behind; // smaller than a pixel: the screen filter goes around too
    dot.sigma_u = dot.sigma_v = 1e-4;
    const SplatPixels speck = run_splats({dot}, std::vector{camera});
    EXPECT_GT(speck.color[(height / 2 * width) * 4 + 3], 0.3);
    EXPECT_NEAR(speck.color[(height / 2 * width) * 4 + 3], speck.color[(height / 2 * width + width - 1) * 4 + 3], 1e-4);
}

// sheets of splats on spheres around the camera, each of one colour, so that it does not matter which of two neighbours
// is in front: a pinhole sorts along z, a panorama by distance
std::vector<HostSplat> sheets()
{
    std::vector<HostSplat> out;
    std::mt19937 random(3);
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> unit(0, 1);
    for (const double away : {2.0, 4.0, 8.0})
        for (int i = 0; i < 900; ++i) {
            Vector n = {normal(random), normal(random), normal(random)};
            const double length = std::sqrt(dot(n, n));
            HostSplat s;
            for (size_t a = 0; a < 3; ++a) {
                n[a] = narrowed(n[a] / length);
                s.position[a] = narrowed(n[a] * away);
                s.color[a] = narrowed(0.5 + 0.4 * std::sin(2 * double(a) + away));
            }
            if (away < 8 && n[0] + 0.5 * n[1] > -0.2) // holes, through which the next sheet is seen
                continue;
            s.normal = n;
            s.sigma_u = s.sigma_v = 0.1 * away;
            s.opacity = 1;
            out.push_back(s);
        }
    return out;
}

// section 7.7: one scene through a pinhole and through a panorama that is sampled where the pinhole's rays meet it
TEST(kernel_splat_lens, a_panorama_holds_the_picture_of_a_pinhole)
{
    const uint32_t width = 80, height = 60, around = 1600, down = 800;
    const std::vector<HostSplat> splats = sheets();
    const HostCamera pinhole{narrowed(56.3), narrowed(57.1), 41, 29.5, turned(2.9, 0.3, 0)};
    const LensCamera panorama{lens(CameraModel::equirectangular, around, down), pinhole.view};
    const SplatPixels expect =
        run_splats(splats, std::vector{pinhole}, {.width = width, .height = height, .screen_variance = 0});
    const SplatPixels got = run_splats(splats, std::vector{panorama}, {.screen_variance = 0});
    const Lens sphere(panorama.intrinsics);
    double square = 0;
    for (uint32_t y = 0; y < height; ++y)
        for (uint32_t x = 0; x < width; ++x) {
            const auto at =
                sphere.project({(x + 0.5 - pinhole.cx) / pinhole.fx, (y + 0.5 - pinhole.cy) / pinhole.fy, 1});
            const double u = at->x - 0.5, v = at->y - 0.5;
            const auto left = uint32_t(std::floor(u)), top = uint32_t(std::floor(v));
            for (size_t c = 0; c < 3; ++c) {
                const auto value = [&](uint32_t i, uint32_t j) {
                    return double(got.color[(size_t(j) * around + i % around) * 4 + c]);
                };
                const double s = u - left, t = v - top;
                const double sampled = (1 - t) * ((1 - s) * value(left, top) + s * value(left + 1, top)) +
                                       t * ((1 - s) * value(left, top + 1) + s * value(left + 1, top + 1));
                square += std::pow(sampled - expect.color[(y * width + x) * 4 + c], 2);
            }
        }
    const double decibels = -10 * std::log10(square / (3.0 * width * height));
    EXPECT_GT(decibels, 45);
    RecordProperty("decibels", fmt::format("{:.1f}", decibels));
}

TEST(kernel_splat_lens, depth_is_along_z_or_from_the_camera)
{
    const HostSplat wall{{0, 0, 3}, {0, 0, -1}, {1, 1, 1}, 20, 20, 1}; // z = 3
    const Intrinsics narrow = lens(CameraModel::fisheye, 64, 64, {}, 0.9),
                     wide = lens(CameraModel::fisheye, 64, 64, {}, 0.2);
    EXPECT_FALSE(Lens(narrow).radial_depth());
    EXPECT_TRUE(Lens(wide).radial_depth());
    for (const Intrinsics& k :
         {lens(CameraModel::opencv, 64, 64, kBarrel), narrow, wide, lens(CameraModel::equirectangular, 64, 32)}) {
        const SplatPixels got = run_splats({wall}, std::vector{LensCamera{k, kStraight}});
        const Lens mapping(k);
        size_t seen = 0;
        for (uint32_t at = 0; at < k.width * k.height; ++at) {
            const auto ray = mapping.ray(at % k.width + 0.5, at / k.width + 0.5);
            if (!ray || got.color[at * 4 + 3] < 0.5)
                continue;
            ASSERT_NEAR(got.depth[at * 2], mapping.radial_depth() ? 3 / (*ray)[2] : 3, 1e-3) << at;
            ++seen;
        }
        EXPECT_GT(seen, 100u) << name_of(k.model);
    }
}

// k1 = -0.4 folds at r = 0.91, which is seen 0.61 focal lengths from the centre
TEST(kernel_splat_lens, nothing_is_drawn_where_a_lens_folds_back)
{
    const Intrinsics k{40, 40, 32, 32, 64, 64, CameraModel::opencv, {-0.4}};
    const SplatPixels got =
        run_splats({{{0, 0, 3}, {0, 0, -1}, {1, 1, 1}, 50, 50, 1}}, std::vector{LensCamera{k, kStraight}});
    const double edge = 40 * std::sqrt(1 / 1.2) * (1 - 0.4 / 1.2);
    for (uint32_t y = 0; y < 64; ++y)
        for (uint32_t x = 0; x < 64; ++x) {
            const double away = std::hypot(x + 0.5 - 32, y + 0.5 - 32), alpha = got.color[(y * 64 + x) * 4 + 3];
            if (std::abs(away - edge) > 0.05) {
                ASSERT_EQ(alpha > 0.9, away < edge) << x << ", " << y << ": " << alpha;
            }
            if (away > edge + 0.05) {
                ASSERT_EQ(alpha, 0);
                ASSERT_EQ(got.ids[(y * 64 + x) * 2], ~0u);
            }
        }
}

TEST(kernel_splat_lens, the_image_does_not_depend_on_tiles_nor_on_the_run)
{
    const std::vector<HostSplat> splats = splats_around(3000, 3, 1e-3, 0.2);
    for (const Intrinsics& k :
         {lens(CameraModel::equirectangular, 150, 70), lens(CameraModel::fisheye, 90, 70, kKannala, 0.25)}) {
        const std::vector cameras = {LensCamera{k, kStraight}};
        const SplatPixels first = run_splats(splats, cameras, {.tile = 16});
        EXPECT_TRUE(same(first, run_splats(splats, cameras, {.tile = 16})));
        EXPECT_TRUE(same(first, run_splats(splats, cameras, {.tile = 32})));
        EXPECT_TRUE(same(first, run_splats(splats, cameras, {.tile = 1024})));
    }
}

TEST(kernel_splat_lens, what_is_not_a_splat_is_skipped)
{
    std::vector<HostSplat> splats = splats_around(60, 5);
    const std::vector cameras = {LensCamera{lens(CameraModel::equirectangular, 64, 32), kStraight}};
    const SplatPixels clean = run_splats(splats, cameras);
    std::vector<HostSplat> bad(7, splats[0]);
    bad[0].position[1] = NAN;
    bad[1].position = {0, 0, 0};
    bad[2].normal = {0, 0, 0};
    bad[3].opacity = 0;
    bad[4].sigma_u = 0;
    bad[5].sigma_v = -1;
    bad[6].color[1] = NAN;
    splats.insert(splats.end(), bad.begin(), bad.end());
    const SplatPixels got = run_splats(splats, cameras);
    EXPECT_TRUE(same(clean, got));
    EXPECT_EQ(got.visible, clean.visible);
}

TEST(kernel_splat_lens, a_splat_seen_edge_on_is_a_dot)
{
    const HostSplat edge{{0, 0, 3}, {0, 1, 0}, {1, 1, 1}, 0.3, 0.3, 0.9};
    const Intrinsics k{50, 50, 32.5, 32.5, 65, 65, CameraModel::fisheye};
    const SplatPixels got = run_splats({edge}, std::vector{LensCamera{k, kStraight}});
    EXPECT_NEAR(got.color[(32 * 65 + 32) * 4 + 3], 0.9, 1e-5);
    EXPECT_NEAR(got.depth[(32 * 65 + 32) * 2], 3, 1e-5);
    EXPECT_EQ(got.color[(32 * 65 + 36) * 4 + 3], 0);
}

} // namespace kernel_splat_lens_test
} // namespace semrover
