// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "engine/job/lidar_returns.h"
#include "tests/support/splat_case.h"
#include "tests/support/sweep_case.h"

#include <numbers>

namespace semrover {
namespace engine_sweep_test {

using std::numbers::pi;

// splats all around the origin, 0.3 to 30 m away, of all sizes; the numbers as fp32 has them
std::vector<HostSplat> splats_around(uint32_t n, uint32_t seed)
{
    std::vector<HostSplat> splats = random_splats(n, seed, 0.02, 1);
    std::mt19937 random(seed + 1);
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> unit(0, 1);
    for (HostSplat& s : splats) {
        const double azimuth = 2 * pi * unit(random), up = 0.35 * normal(random),
                     away = 0.3 * std::pow(100, unit(random));
        const Point3 p = {std::cos(up) * std::cos(azimuth), std::cos(up) * std::sin(azimuth), std::sin(up)};
        for (size_t axis = 0; axis < 3; ++axis)
            s.position[axis] = double(float(p[axis] * away));
        for (double* sigma : {&s.sigma_u, &s.sigma_v})
            *sigma = double(float(*sigma * away * 0.3));
    }
    return splats;
}

DrawnScene scene_on_device(const std::vector<HostSplat>& host)
{
    Splats splats;
    std::vector<uint32_t> owners;
    for (const HostSplat& s : host) {
        const auto floats = [](const Vector& v) { return std::array<float, 3>{float(v[0]), float(v[1]), float(v[2])}; };
        splats.position.push_back(floats(s.position));
        splats.normal.push_back(floats(s.normal));
        splats.color.push_back(floats(s.color));
        splats.sigma_u.push_back(float(s.sigma_u));
        splats.sigma_v.push_back(float(s.sigma_v));
        splats.opacity.push_back(float(s.opacity));
        splats.label.push_back(uint8_t(owners.size() % 20));
        owners.push_back(1 + uint32_t(owners.size()));
    }
    return {SplatScene::create(test_device(), splats, owners).value()};
}

// what a ray meets, in double, of every splat (docs/method.md §5.8)
struct Met {
    double alpha = 0, range = 0;
    Vector normal{};
    int64_t splat = -1;
};

// how far away the splats are, each when a column of the ray's part of the sweep looks at it
std::vector<double> keys_of(const std::vector<HostSplat>& splats, const LidarSweep& sweep, uint32_t beam,
                            uint32_t column)
{
    const Lidar& lidar = *sweep.lidar;
    const SweepPicture picture(lidar);
    const uint32_t parts = divide_up(picture.width, std::min(512u, lidar.columns / 2));
    const uint32_t width = divide_up(picture.width, parts);
    const double first = double(uint32_t(int(column) + picture.shifts[beam] - picture.first) / width * width);
    double least = 0, most = 0;
    for (size_t i = 0; i < lidar.beams.size(); ++i) {
        least = std::min(least, double(picture.first - picture.shifts[i]));
        most = std::max(most, picture.first - picture.shifts[i] + lidar.beams[i].delay / lidar.column_microseconds());
    }
    std::vector<double> keys;
    for (const HostSplat& s : splats) {
        double share = 0.5;
        const auto seen = [&] { return transform(inverse(interpolate(sweep.begin, sweep.end, share)), s.position); };
        for (int i = 0; i < 4; ++i) {
            const Point3 at = seen();
            double x = (std::atan2(-at[1], at[0]) - lidar.start) / lidar.step() - picture.first - first;
            x -= lidar.columns * std::floor((x - 0.5 * width) / lidar.columns + 0.5);
            share = std::clamp((x + first + (least + most) / 2) / lidar.columns, 0.0, 1.0);
        }
        const Point3 at = seen();
        keys.push_back(std::sqrt(dot(at, at)));
    }
    return keys;
}

Met cast(const std::vector<HostSplat>& splats, const LidarSweep& sweep, uint32_t beam, uint32_t column)
{
    static const Intrinsics sphere = whole_sphere(2, 1); // depths from the camera
    static const Lens lens(sphere);
    const SplatRules rules{.near = 0.05};
    const Rigid world_to_sensor = inverse(sweep.at(beam, column));
    LensCamera camera{sphere, {}};
    std::ranges::copy(std::span(world_to_sensor).first(12), camera.view.begin());
    const Point3 ray = sweep.lidar->ray(beam, column);
    std::vector<size_t> order(splats.size());
    std::iota(order.begin(), order.end(), 0);
    const std::vector<double> keys = keys_of(splats, sweep, beam, column);
    std::ranges::stable_sort(order, {}, [&](size_t i) { return keys[i]; });
    ReferencePixel pixel;
    double t = 1;
    for (const size_t i : order) {
        LensSplat placed = place(splats[i], camera, lens, rules);
        placed.pixel.reset(); // no screen filter
        double z = 0;
        const double alpha = placed.kept ? alpha_at(placed, splats[i], camera, lens, 0, 0, ray, rules, z) : 0;
        if (!cover(pixel, t, splats[i], placed.normal, alpha, z, i, rules))
            break;
    }
    return {1 - t, pixel.median, pixel.normal, pixel.median_splat};
}

void expect_as_cast(const std::vector<HostSplat>& splats, const LidarSweep& sweep)
{
    const Lidar& lidar = *sweep.lidar;
    const SweepPicture picture(lidar);
    const SweepImage image = draw_sweep(scene_on_device(splats), sweep);
    Misses misses;
    size_t rays = 0, met = 0, others = 0;
    for (uint32_t beam = 0; beam < lidar.beams.size(); ++beam)
        for (uint32_t column = 0; column < lidar.columns; column += lidar.beams[beam].every) {
            const Met expect = cast(splats, sweep, beam, column);
            const size_t at = pixel_of(picture, beam, column);
            misses.add(image.alpha[at], expect.alpha, 2e-3);
            misses.add(image.range[at], expect.range, 1e-3 + 2e-4 * expect.range);
            for (size_t axis = 0; axis < 3; ++axis) // the reference has them in the sensor's axes then
                misses.add(image.normal[at * 3 + axis], expect.normal[axis], 2e-3);
            others += image.instance[at] != uint32_t(expect.splat + 1) ||
                      image.label[at] != (expect.splat < 0 ? ~0u : uint32_t(expect.splat % 20));
            met += expect.alpha > 0.5;
            ++rays;
        }
    EXPECT_GT(met, rays / 10);
    EXPECT_LE(misses.some, rays * 5 / 1000);
    EXPECT_LE(misses.gross, rays * 5 / 2000);
    EXPECT_LE(others, rays / 200 + 1);
}

LidarSweep sweep_of(Lidar lidar, const Rigid& begin, const Rigid& end)
{
    return {1, "top", std::make_shared<const Lidar>(std::move(lidar)), begin, end};
}

Lidar lidar_of(uint32_t columns, bool clockwise, std::initializer_list<LidarBeam> beams)
{
    return {.columns = columns,
            .rate = 10,
            .clockwise = clockwise,
            .start = 2.5,
            .nearest = 0.1,
            .farthest = 100,
            .farthest_at_tenth = 100,
            .beams = beams};
}

const Rigid kStill = rigid_from_quaternion({0.1, -0.2, 0.3}, {0.05, -0.1, 0.6, 0.79}, "still").value();

TEST(engine_sweep, matches_a_ray_caster_in_double)
{
    const std::vector<HostSplat> splats = splats_around(300, 3);
    for (const bool clockwise : {true, false}) {
        const Lidar lidar = lidar_of(180, clockwise,
                                     {{0.5, 0},
                                      {0.3, 0.2, 0, 2},
                                      {0.28, -0.21},
                                      {0.1, 0.013},
                                      {0, -0.1, 0, 3},
                                      {-0.2, 0.5},
                                      {-0.21, -0.01},
                                      {-0.9, 0.02}});
        expect_as_cast(splats, sweep_of(lidar, kStill, kStill));
    }
}

TEST(engine_sweep, matches_it_for_tables_of_sensors_and_of_the_least_size)
{
    const std::vector<HostSplat> splats = splats_around(40, 8), more = splats_around(300, 9);
    Lidar xt32 = named_lidar("xt32").value();
    xt32.columns = 1100; // three parts
    expect_as_cast(splats, sweep_of(xt32, kStill, kStill));
    expect_as_cast(more, sweep_of(lidar_of(4, true, {{0.1, 0.9}, {-0.1, -0.7}}), kStill, kStill));
    expect_as_cast(more, sweep_of(lidar_of(5, false, {{0, 0}}), kStill, kStill));
}

TEST(engine_sweep, matches_it_where_the_sensor_moves)
{
    const std::vector<HostSplat> splats = splats_around(200, 21);
    Lidar lidar = lidar_of(240, true, {{0.5, 0.3, 300}, {0.1, -0.2}, {0, 0.1, 900}, {-0.15, 0, 0, 2}, {-0.4, -0.3}});
    for (const auto& [x, yaw] : {std::pair{0.5, 0.0}, {3.0, 0.1}, {0.0, 0.6}, {-2.0, -0.3}}) {
        const Rigid move =
            rigid_from_quaternion({x, 0.1 * x, -0.02}, {0.01, 0, std::sin(yaw / 2), std::cos(yaw / 2)}, "move").value();
        SCOPED_TRACE(fmt::format("{} m, {} radians", x, yaw));
        expect_as_cast(splats, sweep_of(lidar, kStill, compose(kStill, move)));
    }
}

// y = 4, from x = -10 to 20
std::vector<HostSplat> wall()
{
    std::vector<HostSplat> splats;
    for (double x = -10; x < 20; x += 0.2)
        for (double z = -2; z < 3; z += 0.2)
            splats.push_back({{double(float(x)), 4, double(float(z))}, {0, -1, 0}, {0.5, 0.5, 0.5}, 0.2, 0.2, 1});
    return splats;
}

TEST(engine_sweep, points_of_a_wall_stay_on_it_while_the_sensor_moves)
{
    const Lidar lidar = lidar_of(720, true, {{0.2, 0.1, 40}, {0, -0.1}, {-0.2, 0.05, 100}});
    const Rigid begin = rigid_from_quaternion({0, 0, 0}, {0, 0, 0.05, 0.9987}, "begin").value();
    const Rigid end = rigid_from_quaternion({3, -0.5, 0.1}, {0.01, -0.01, -0.1, 0.995}, "end").value();
    const LidarSweep sweep = sweep_of(lidar, begin, end);
    const std::vector<LidarPoint> points = lidar_returns(sweep, draw_sweep(scene_on_device(wall()), sweep), 0.5f);
    EXPECT_GT(points.size(), 600u);
    double skewed = 0;
    for (const LidarPoint& p : points) {
        ASSERT_NEAR(transform(end, {p.x, p.y, p.z})[1], 4, 2e-4) << "at " << p.time << " us";
        // what a sensor would say that knew nothing of its motion
        const Point3 then =
            transform(inverse(interpolate(begin, end, p.time * 1e-6 * lidar.rate)), transform(end, {p.x, p.y, p.z}));
        skewed = std::max(skewed, std::abs(transform(end, then)[1] - 4));
    }
    EXPECT_GT(skewed, 0.3);
}

// splats that a part may lose: as wide as the sky, on a part's edges, around and above the sensor
TEST(engine_sweep, no_ray_loses_a_splat)
{
    const Lidar lidar = lidar_of(96, true, {{1.2, 0.1}, {0.4, -0.2}, {0, 0.3}, {-0.4, 0}, {-1.2, 0.02}});
    std::mt19937 random(5);
    std::normal_distribution<double> normal;
    for (int i = 0; i < 60; ++i) {
        HostSplat s = splats_around(1, 100 + uint32_t(i))[0];
        const double scale = i % 3 == 0 ? 0.05 : i % 3 == 1 ? 1 : 8; // of the size
        s.sigma_u = double(float(s.sigma_u * scale));
        s.sigma_v = double(float(s.sigma_v * scale));
        if (i % 5 == 4)
            s.position = {double(float(0.02 * normal(random))), 0.01, i % 2 ? 2.0 : -2.0};
        const Rigid move = rigid_from_quaternion({1.5, -0.2, 0}, {0, 0, 0.1, 0.995}, "move").value();
        const LidarSweep sweep = sweep_of(lidar, kIdentity, i % 2 ? move : kIdentity);
        const SweepImage image = draw_sweep(scene_on_device({s}), sweep);
        const SweepPicture picture(lidar);
        for (uint32_t beam = 0; beam < lidar.beams.size(); ++beam)
            for (uint32_t column = 0; column < lidar.columns; ++column) {
                const double expect = cast({s}, sweep, beam, column).alpha;
                const double found = image.alpha[pixel_of(picture, beam, column)];
                const bool threshold = std::abs(std::max(expect, found) - 1.0 / 255) < 2e-5;
                ASSERT_TRUE(threshold || std::abs(found - expect) < 2e-3)
                    << "splat " << i << ", beam " << beam << ", column " << column << ": " << found << ", not "
                    << expect;
            }
    }
}

} // namespace engine_sweep_test
} // namespace semrover
