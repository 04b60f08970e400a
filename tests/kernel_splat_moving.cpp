// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "tests/support/splat_case.h"

namespace semrover {
namespace kernel_splat_moving_test {

constexpr ShutterDirection kDirections[] = {ShutterDirection::down, ShutterDirection::up, ShutterDirection::right,
                                            ShutterDirection::left};

// how fast a camera is, in its own frame, and how long it reads
struct Speed {
    Point3 metres{}, radians{}; // a second
    double seconds = 0;
};

MovingCamera moving(const Intrinsics& k, ShutterDirection direction, const Speed& speed)
{
    MovingCamera camera{k, kIdentity, kIdentity, direction};
    const auto pose = [&](double seconds) {
        Point3 place, half;
        double angle = 0;
        for (size_t a = 0; a < 3; ++a) {
            place[a] = speed.metres[a] * seconds;
            angle += std::pow(speed.radians[a] * seconds, 2);
        }
        angle = std::sqrt(angle);
        for (size_t a = 0; a < 3; ++a)
            half[a] = angle > 0 ? std::sin(angle / 2) * speed.radians[a] * seconds / angle : 0;
        return rigid_from_quaternion(place, {half[0], half[1], half[2], std::cos(angle / 2)}, "pose").value();
    };
    camera.from = pose(-speed.seconds / 2);
    camera.to = pose(speed.seconds / 2);
    return camera;
}

Intrinsics view(CameraModel model, uint32_t width, uint32_t height, Distortion distortion = {}, double focal = 0.6)
{
    if (model == CameraModel::equirectangular)
        return whole_sphere(width, height);
    return {focal * width, 1.04 * focal * width, width / 2.0 + 1.3, height / 2.0 - 0.7, width, height, model,
            distortion};
}

std::vector<Intrinsics> views()
{
    return {view(CameraModel::pinhole, 96, 64), view(CameraModel::opencv, 80, 60, {-0.3, 0.1, 0.002, -0.001, -0.01}),
            view(CameraModel::fisheye, 64, 64, {-0.03, 0.012, -0.006, 0.0009}, 0.25),
            view(CameraModel::equirectangular, 96, 48)};
}

TEST(kernel_splat_moving, a_line_is_that_line_of_a_still_picture)
{
    std::vector<HostSplat> splats = splats_around(300, 7, 0.03);
    for (HostSplat& s : splats) // farther than a camera goes, so that one line sees the centre
        for (double& v : s.position)
            v = narrowed(v * 1.3 + std::copysign(0.5, v));
    const Speed town{{1, 0.2, 15}, {0.05, 0.4, -0.1}, 0.03}, swerve{{-6, 0.5, 20}, {-0.3, 0.9, 0.2}, 0.05};
    for (const Intrinsics& k : views())
        for (const ShutterDirection direction : kDirections)
            for (const Speed& speed : {town, swerve}) {
                SCOPED_TRACE(fmt::format("{} {} {}", name_of(k.model), name_of(direction), speed.seconds));
                const MovingCamera camera = moving(k, direction, speed);
                compare(run_splats(splats, std::vector{camera}), render_reference(splats, camera), 0);
            }
}

TEST(kernel_splat_moving, cameras_of_one_table_move_as_they_like)
{
    const std::vector<HostSplat> splats = splats_around(200, 9, 0.03);
    const Intrinsics k = view(CameraModel::opencv, 77, 53, {0.4, -0.05, 0.001, 0.0015, 0.01, 0.75, 0.1, 0.02}, 0.35);
    const std::vector cameras = {moving(k, ShutterDirection::down, {{0, 0, 10}, {}, 0.03}),
                                 moving(k, ShutterDirection::left, {{-3, 0, 0}, {0, 0.5, 0}, 0.02}),
                                 moving(k, ShutterDirection::up, {{}, {0, 0, 1}, 0.04})};
    const SplatPixels got = run_splats(splats, cameras);
    for (size_t i = 0; i < cameras.size(); ++i)
        compare(got, render_reference(splats, cameras[i]), i);
}

// alpha at a pixel by each line that may have the dot, and without a dot
std::vector<double> alphas_at(const HostSplat& s, const MovingCamera& c, const Lens& lens, uint32_t x, uint32_t y,
                              const std::vector<double>& shares)
{
    const auto ray = lens.ray(x + 0.5, y + 0.5);
    std::vector<double> alphas;
    const LensCamera still = c.at(c.share((c.by_rows() ? y : x) + 0.5));
    for (size_t i = 0; i <= shares.size(); ++i) {
        LensSplat own = place(s, c.at(i < shares.size() ? shares[i] : 0.5), lens, {});
        if (i == shares.size())
            own.pixel = {};
        double z;
        const LensSplat placed = in_line(s, still, own, lens, {});
        alphas.push_back(ray && placed.kept ? alpha_at(placed, s, still, lens, x + 0.5, y + 0.5, *ray, {}, z) : 0);
    }
    return alphas;
}

// docs/method.md §5.4, bounds: one splat, passed as fast as 40 m/s and 1 rad/s in 50 ms; no pixel is lost
TEST(kernel_splat_moving, bounds_hold_every_pixel)
{
    std::vector<HostSplat> splats = splats_around(48, 11, 0.01, 0.6);
    const Speed speeds[] = {{{0, 0, 40}, {0, 1, 0}, 0.05},
                            {{40, 0, 0}, {0, 0, 1}, 0.05},
                            {{-12, 30, 22}, {0.6, -0.6, 0.5}, 0.05},
                            {{0, 0, -40}, {1, 0, 0}, 0.05}};
    size_t certain = 0, cases = 0, seen = 0, lost = 0;
    double worst = 0;
    for (size_t i = 0; i < splats.size(); ++i) {
        const double away = std::sqrt(dot(splats[i].position, splats[i].position));
        for (double& v : splats[i].position) // half of them 1 m away and nearer, the others to 9 m
            v = narrowed(i % 2 ? v : v * (0.3 + 0.7 * double(i) / 48) / away);
        for (const Intrinsics& k : views()) {
            const MovingCamera camera = moving(k, kDirections[i / 2 % 4], speeds[(i / 8 + i) % 4]);
            const Lens lens(k);
            const SplatPixels got = run_splats({splats[i]}, std::vector{camera});
            const std::vector<double> shares = own_shares(splats[i], camera, lens, {});
            ++cases;
            certain += shares.size() == 1;
            for (uint32_t at = 0; at < k.width * k.height; ++at) {
                const uint32_t x = at % k.width, y = at / k.width;
                const double found = got.color[at * 4 + 3];
                double off = 1;
                for (const double alpha : alphas_at(splats[i], camera, lens, x, y, shares)) {
                    const bool threshold = std::abs(std::max(alpha, found) - 1.0 / 255) < 5e-5;
                    off = std::min(off, threshold ? 0 : std::abs(found - alpha));
                }
                seen += found > 0;
                lost += off > 2e-3;
                worst = std::max(worst, off);
                if (off > 2e-3 && lost < 20)
                    ADD_FAILURE() << "splat " << i << " " << name_of(k.model) << " at " << x << ", " << y << " found "
                                  << found << " of " << shares.size() << " off " << off;
            }
        }
    }
    fmt::print("{} of {} splats have one line, {} pixels seen, {} off, worst {:.2g}\n", certain, cases, seen, lost,
               worst);
    EXPECT_GT(certain, cases / 2);
    EXPECT_EQ(lost, 0u);
}

TEST(kernel_splat_moving, a_camera_that_hardly_moves_sees_what_one_that_stands_sees)
{
    const std::vector<HostSplat> splats = random_splats(600, 7, 0.03);
    for (const Intrinsics& k : views()) {
        const MovingCamera camera = moving(k, ShutterDirection::down, {{1e-4, 0, 1e-4}, {0, 1e-5, 0}, 0.03});
        const LensCamera still = camera.at(0.5);
        const SplatPixels got = run_splats(splats, std::vector{camera});
        const SplatPixels expect = run_splats(splats, std::vector{still});
        size_t off = 0;
        for (size_t i = 0; i < got.color.size(); ++i) {
            off += !(std::abs(got.color[i] - expect.color[i]) <= 2e-3);
            off += !(std::abs(got.surface[i] - expect.surface[i]) <= 2e-2);
        }
        if (k.model == CameraModel::pinhole) { // by its own kernels
            const SplatPixels pinhole = run_splats(splats, std::vector{HostCamera{k.fx, k.fy, k.cx, k.cy, still.view}},
                                                   {.width = k.width, .height = k.height});
            for (size_t i = 0; i < got.color.size(); ++i)
                off += !(std::abs(got.color[i] - pinhole.color[i]) <= 2e-3);
        }
        EXPECT_LE(off, got.color.size() / 1000) << name_of(k.model);
        EXPECT_EQ(got.visible, expect.visible) << name_of(k.model);
        EXPECT_LE(got.pairs, expect.pairs * 1.02) << name_of(k.model);
    }
}

TEST(kernel_splat_moving, the_image_does_not_depend_on_tiles_nor_on_the_run)
{
    const std::vector<HostSplat> splats = splats_around(3000, 3, 1e-3, 0.2);
    for (const Intrinsics& k : {view(CameraModel::pinhole, 150, 70), view(CameraModel::equirectangular, 150, 70)}) {
        const std::vector cameras = {moving(k, ShutterDirection::right, {{2, 0, 25}, {0, 0.6, 0}, 0.04})};
        const SplatPixels first = run_splats(splats, cameras, {.tile = 16});
        EXPECT_TRUE(same(first, run_splats(splats, cameras, {.tile = 16})));
        EXPECT_TRUE(same(first, run_splats(splats, cameras, {.tile = 32})));
        EXPECT_TRUE(same(first, run_splats(splats, cameras, {.tile = 1024})));
    }
}

// two things that move among splats that stand: one comes towards the camera and turns, one passes
TEST(kernel_splat_moving, things_move_while_a_picture_is_read_out)
{
    std::vector<HostSplat> splats = random_splats(1200, 19, 0.02, 0.1);
    const auto pose = [](double x, double z, double yaw) {
        return rigid_from_quaternion({x, 0.2, z}, {0, std::sin(yaw / 2), 0, std::cos(yaw / 2)}, "pose").value();
    };
    const HostMover kinds[] = {
        {}, {pose(0.5, 0.8, 0.1), pose(0.4, 0.3, 0.12)}, {pose(-0.4, 1, -0.2), pose(0.2, 1, -0.21)}};
    std::vector<HostMover> movers;
    HostMovers table{.owners = {}, .rows = {0, 1, 2}, .views = {}};
    for (uint32_t i = 0; i < splats.size(); ++i) {
        splats[i].sigma_v = splats[i].sigma_u; // round: axes follow from the normal, which turns
        table.owners.push_back(i % 4 == 3 ? 1 + (i % 8 == 7) : 0);
        movers.push_back(kinds[table.owners.back()]);
    }
    for (const Intrinsics& k : views())
        for (const double speed : {0.0, 12.0}) {
            const MovingCamera camera = moving(k, ShutterDirection::down, {{0, 0, speed}, {0, speed / 30, 0}, 0.03});
            HostMovers seen = table;
            for (const HostMover& m : {kinds[1], kinds[2]})
                for (const auto& row : moving_views(motion_of(camera.frame()), m.from, m.to, kIdentity))
                    seen.views.insert(seen.views.end(), row.begin(), row.end());
            const SplatPixels got = run_splats(splats, std::vector{camera}, {}, seen);
            compare(got, render_reference(splats, camera, {}, movers), 0, table.owners);
            EXPECT_GT(std::ranges::count(got.owners, 1u), 50) << name_of(k.model);
            seen.views.assign(seen.views.size(), 0); // not there
            const SplatPixels alone = run_splats(splats, std::vector{camera}, {}, seen);
            EXPECT_EQ(std::ranges::count(alone.owners, 1u) + std::ranges::count(alone.owners, 2u), 0);
        }
}

// a post in front of a camera that passes it: the line that is read later has it further along
TEST(kernel_splat_moving, a_post_leans_when_a_camera_passes_it)
{
    std::vector<HostSplat> post;
    for (int i = -40; i <= 40; ++i)
        post.push_back({{0, narrowed(i * 0.05), 4}, {0, 0, -1}, {1, 1, 1}, 0.02, 0.02, 1});
    const Intrinsics k{100, 100, 50, 50, 100, 100};
    const auto place_in = [&](const SplatPixels& image, uint32_t row) {
        double weight = 0, x = 0;
        for (uint32_t c = 0; c < 100; ++c) {
            weight += image.color[(row * 100 + c) * 4 + 3];
            x += image.color[(row * 100 + c) * 4 + 3] * (c + 0.5);
        }
        return x / weight;
    };
    for (const auto& [direction, sign] : {std::pair{ShutterDirection::down, -1}, {ShutterDirection::up, 1}}) {
        const SplatPixels got = run_splats(post, std::vector{moving(k, direction, {{10, 0, 0}, {}, 0.02})});
        // 0.2 m of 4 m: 5 pixels of 100 lines
        for (const uint32_t row : {10u, 50u, 90u})
            EXPECT_NEAR(place_in(got, row), 50 + sign * 5 * ((row + 0.5) / 100 - 0.5), 0.02) << row;
    }
}

} // namespace kernel_splat_moving_test
} // namespace semrover
