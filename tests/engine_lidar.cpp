// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/camera/rig.h"
#include "engine/job/lidar_returns.h"
#include "engine/shards/shard_index.h"
#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"

#include <cmath>
#include <cstring>
#include <numbers>

namespace semrover {
namespace engine_lidar_test {

using std::numbers::pi;

constexpr const char* kLidar = R"({"columns":360,"rate":20,"range":[0.5,100],"range_at_10_percent":40,
    "elevations":[10,0,-10.5],"azimuths":[0,3.4,-1],"times":[0,0,50],"every":[1,2,1]})";

Lidar made(std::string_view text = kLidar)
{
    const ScratchFolder folder;
    return read_lidar(folder.put("l.json", text)).value();
}

TEST(engine_lidar, the_shipped_sensors_have_the_beams_of_their_sources)
{
    struct Known {
        const char* name;
        size_t beams;
        uint32_t columns;
        double top, bottom; // degrees
    };
    for (const Known& k : {Known{"hdl-64e", 64, 2083, 4.97, -24.85},
                           {"ot128", 128, 3600, 14.985, -24.765},
                           {"pandar128", 128, 3600, 14.436, -25.01577},
                           {"xt32", 32, 2000, 14.972363, -16.023602}}) {
        const auto lidar = named_lidar(k.name);
        ASSERT_TRUE(lidar) << lidar.error().message;
        ASSERT_EQ(lidar->beams.size(), k.beams);
        EXPECT_EQ(lidar->columns, k.columns);
        EXPECT_NEAR(lidar->beams.front().elevation, k.top * pi / 180, 2e-4);
        EXPECT_NEAR(lidar->beams.back().elevation, k.bottom * pi / 180, 2e-4);
        EXPECT_EQ(lidar->rate, 10);
        // points a second, where a maker states them
        uint64_t rays = 0;
        for (const LidarBeam& b : lidar->beams)
            rays += lidar->columns / b.every;
        EXPECT_EQ(rays * 10, k.beams == 128 ? 3456000u : 10u * k.beams * k.columns);
    }
    EXPECT_TRUE(says(named_lidar("vlp-16"), "lidar 'vlp-16': expected a file, or one of hdl-64e, ot128"));
}

TEST(engine_lidar, rays_turn_clockwise_from_the_start_with_what_the_lidar_turns_until_they_are_fired)
{
    const Lidar lidar = made();
    const auto near = [](const Point3& a, const Point3& b) {
        return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]) < 1e-12;
    };
    const auto degrees = [](double v) { return v * pi / 180; };
    // behind, then on the left, ahead
    const double c = std::cos(degrees(10)), s = std::sin(degrees(10));
    EXPECT_TRUE(near(lidar.ray(0, 0), {-c, 0, s}));
    EXPECT_TRUE(near(lidar.ray(0, 90), {0, c, s}));
    EXPECT_TRUE(near(lidar.ray(0, 180), {c, 0, s}));
    EXPECT_TRUE(near(lidar.ray(1, 180), {std::cos(degrees(3.4)), -std::sin(degrees(3.4)), 0}));
    // 50 us at 20 turns a second are 0.36 degrees
    EXPECT_NEAR(lidar.beams[2].azimuth, degrees(-1 + 0.36), 1e-12);
    EXPECT_DOUBLE_EQ(lidar.firing_microseconds(2, 90), 12500 + 50);
    std::string text = kLidar;
    const Lidar other = made(text.insert(1, R"("direction":"counterclockwise","start":0,"first_ring":"bottom",)"));
    EXPECT_TRUE(near(other.ray(0, 90), {0, c, s}));
    EXPECT_NEAR(other.beams[2].azimuth, degrees(-1 - 0.36), 1e-12);
    EXPECT_EQ(other.ring(0), 2u);
    EXPECT_EQ(lidar.ring(0), 0u);
}

TEST(engine_lidar, a_column_of_pixels_looks_into_one_direction)
{
    for (const char* name : {"hdl-64e", "ot128", "pandar128", "xt32"}) {
        const Lidar lidar = named_lidar(name).value();
        const SweepPicture picture(lidar);
        for (uint32_t beam = 0; beam < lidar.beams.size(); ++beam) {
            EXPECT_LE(std::abs(picture.rests[beam]), 0.5001 * std::abs(lidar.step()));
            for (const uint32_t column : {0u, lidar.columns / 3, lidar.columns - 1}) {
                const int x = int(column) + picture.shifts[beam] - picture.first;
                ASSERT_TRUE(x >= 0 && x < int(picture.width));
                const double azimuth = lidar.start + lidar.step() * (x + picture.first) + picture.rests[beam];
                const Point3 ray = lidar.ray(beam, column);
                EXPECT_NEAR(std::remainder(std::atan2(-ray[1], ray[0]) - azimuth, 2 * pi), 0, 1e-12);
            }
        }
    }
}

TEST(engine_lidar, what_is_wrong_with_a_table_is_named)
{
    const ScratchFolder folder;
    const auto changed = [&](std::string_view from, std::string_view to) {
        std::string text = kLidar;
        const size_t at = text.find(from);
        EXPECT_NE(at, std::string::npos) << from;
        return read_lidar(folder.put("l.json", text.replace(at, from.size(), to)));
    };
    EXPECT_TRUE(says(read_lidar(folder.put("x", "[]")), "expected an object, found array"));
    EXPECT_TRUE(says(changed("\"rate\"", "\"rats\""), "rats"));
    EXPECT_TRUE(says(changed("\"rate\":20,", ""), "rate is missing"));
    EXPECT_TRUE(says(changed("360", "3"), "columns"));
    EXPECT_TRUE(says(changed("360", "65536"), "columns"));
    EXPECT_TRUE(says(changed("20", "0"), "rate"));
    EXPECT_TRUE(says(changed("[0.5,100]", "[100,0.5]"), "range: expected metres"));
    EXPECT_TRUE(says(changed("[0.5,100]", "[0.5]"), "range: expected an array of 2 numbers"));
    EXPECT_TRUE(says(changed("[10,0,-10.5]", "[]"), "elevations: expected an array of 1 to 1024"));
    EXPECT_TRUE(says(changed("[10,0,-10.5]", "[10,10,-10.5]"), "each below the one before"));
    EXPECT_TRUE(says(changed("[10,0,-10.5]", "[90,0,-10.5]"), "elevations: expected numbers from -89.9 to 89.9"));
    EXPECT_TRUE(says(changed("[0,3.4,-1]", "[0,3.4]"), "azimuths: expected a number for each of 3 beams, found 2"));
    EXPECT_TRUE(says(changed("[0,0,50]", "[0,0,-1]"), "times: expected numbers from 0"));
    EXPECT_TRUE(says(changed("[1,2,1]", "[1,1.5,1]"), "every: expected whole numbers"));
    EXPECT_TRUE(says(changed("[1,2,1]", "\"all\""), "every: expected an array of numbers"));
    EXPECT_TRUE(says(changed("{\"columns\"", "{\"direction\":\"left\",\"columns\""), "direction"));
}

TEST(engine_lidar, a_rig_has_lidars_beside_cameras)
{
    const ScratchFolder folder;
    folder.put("own.json", kLidar);
    const auto rig_of = [&](const std::string& lidar) {
        return read_rig(folder.put(
            "rig.json", R"({"sensors":[{"name":"front","width":8,"height":8,"fov":90,"sensor_to_vehicle":)"
                        R"({"rotation":[-0.5,0.5,-0.5,0.5]}},{"name":"top","lidar":)" +
                            lidar + R"(,"sensor_to_vehicle":{"translation":[1,0,2],"rotation":[0,0,1,0]}}]})"));
    };
    const auto rig = rig_of("\"own.json\"");
    ASSERT_TRUE(rig) << rig.error().message;
    ASSERT_EQ(rig->sensors.size(), 1u);
    ASSERT_EQ(rig->lidars.size(), 1u);
    EXPECT_EQ(rig->lidars[0].lidar->columns, 360u);
    EXPECT_EQ(rig_of("\"xt32\"").value().lidars[0].lidar->columns, 2000u);
    EXPECT_TRUE(says(rig_of("\"none\""), "expected a file, or one of"));
    EXPECT_TRUE(says(rig_of("3"), "lidar: expected the name of a lidar, a file or a table, found number"));
    EXPECT_TRUE(says(rig_of("\"xt32\",\"width\":3"), "unknown key 'width'"));
    CameraPath drive;
    for (const double x : {0.0, 2.0}) // a camera that looks along +x of the world
        drive.frames.push_back({x, "", {{0, -1, 0, 0, 0, 0, -1, 0, 1, 0, 0, -x, 0, 0, 0, 1}}, {}});
    const CameraPath path = expand_rig(*rig, drive).value();
    ASSERT_EQ(path.frames.size(), 2u);
    ASSERT_EQ(path.sweeps.size(), 2u);
    EXPECT_EQ(path.sweeps[1].sensor, "top");
    EXPECT_EQ(path.sweeps[1].time, 2);
    const Point3 ahead = transform(path.sweeps[1].end, {1, 0, 0}); // it looks backwards
    EXPECT_NEAR(ahead[0], 2, 1e-12);
    EXPECT_NEAR(ahead[2], 2, 1e-12);
    // a twentieth of a second at 1 m/s; before the first pose as after it
    EXPECT_NEAR(translation_of(path.sweeps[1].begin)[0], 3 - 0.05, 1e-12);
    EXPECT_NEAR(translation_of(path.sweeps[0].begin)[0], 1 - 0.05, 1e-12);
    EXPECT_NEAR(translation_of(path.sweeps[1].at(0, 180))[0], 3 - 0.025, 1e-12);
    drive.numbered = true;
    const CameraPath numbered = expand_rig(*rig, drive).value();
    EXPECT_EQ(numbered.sweeps[1].begin, numbered.sweeps[1].end);
    EXPECT_EQ(numbered.warnings.size(), 1u);
    drive.numbered = false;
    drive.frames[1].time = 0;
    EXPECT_TRUE(says(expand_rig(*rig, drive), "need poses at times that rise"));
}

// of a lidar that stands at the origin: every ray meets a wall of `label`, at right angles, `range` metres away
SweepImage wall(const Lidar& lidar, uint32_t label, float range)
{
    const SweepPicture picture(lidar);
    SweepImage image{.width = picture.width};
    const size_t pixels = picture.width * lidar.beams.size();
    image.alpha.assign(pixels, 0.9f);
    image.range.assign(pixels, range);
    image.label.assign(pixels, label);
    image.instance.assign(pixels, 7);
    image.normal.resize(pixels * 3);
    for (uint32_t beam = 0; beam < lidar.beams.size(); ++beam)
        for (uint32_t column = 0; column < lidar.columns; ++column) {
            const Point3 ray = lidar.ray(beam, column);
            const size_t at = beam * picture.width + size_t(int(column) + picture.shifts[beam] - picture.first);
            for (size_t axis = 0; axis < 3; ++axis)
                image.normal[at * 3 + axis] = float(-0.9 * ray[axis]);
        }
    return image;
}

TEST(engine_lidar, returns_come_in_the_order_of_firing_where_their_rays_met_something)
{
    const Lidar lidar = made();
    const LidarSweep sweep{0, "top", std::make_shared<const Lidar>(lidar)};
    const std::vector<LidarPoint> points = lidar_returns(sweep, wall(lidar, 2, 20), 0.5f);
    ASSERT_EQ(points.size(), 360u * 2 + 180);
    const LidarPoint &first = points[0], &second = points[1], &third = points[2], &fourth = points[3];
    EXPECT_EQ(first.ring, 0);
    EXPECT_EQ(second.ring, 1);
    EXPECT_EQ(third.ring, 2);
    EXPECT_EQ(fourth.ring, 0); // of column 1, in which beam 1 is not fired
    EXPECT_EQ(points[4].ring, 2);
    EXPECT_EQ(third.time, 50u);
    EXPECT_EQ(fourth.time, uint32_t(std::lround(1e6 / 20 / 360)));
    for (const LidarPoint& p : points) {
        ASSERT_NEAR(std::hypot(p.x, p.y, p.z), 20, 1e-4);
        ASSERT_NEAR(p.intensity, lidar_reflectance(2), 1e-6);
        ASSERT_EQ(p.label, 2);
        ASSERT_EQ(p.instance, 7u);
    }
    EXPECT_NEAR(first.x, -20 * std::cos(pi / 18), 1e-5);
    EXPECT_NEAR(first.z, 20 * std::sin(pi / 18), 1e-5);
}

TEST(engine_lidar, returns_lie_where_their_rays_met_something_as_seen_from_the_end_of_the_sweep)
{
    const Lidar lidar = made();
    LidarSweep sweep{0, "top", std::make_shared<const Lidar>(lidar)};
    sweep.end = rigid_from_quaternion({2, 0.3, 0}, {0, 0, 0.1, 0.995}, "end").value();
    const std::vector<LidarPoint> points = lidar_returns(sweep, wall(lidar, 2, 20), 0.5f);
    for (const LidarPoint& p : points) {
        const double share = p.time * 1e-6 * lidar.rate; // what the file says is enough to go back
        const Point3 world = transform(sweep.end, {p.x, p.y, p.z});
        const Point3 then = transform(inverse(interpolate(sweep.begin, sweep.end, share)), world);
        ASSERT_NEAR(std::hypot(then[0], then[1], then[2]), 20, 1e-4);
    }
}

TEST(engine_lidar, returns_are_lost_where_too_little_light_comes_back)
{
    const Lidar lidar = made(); // 40 m at a tenth
    const LidarSweep sweep{0, "top", std::make_shared<const Lidar>(lidar)};
    const auto count = [&](const SweepImage& image) { return lidar_returns(sweep, image, 0.5f).size(); };
    EXPECT_EQ(count(wall(lidar, 0, 0.49f)), 0u);
    EXPECT_GT(count(wall(lidar, 0, 0.51f)), 0u);
    EXPECT_EQ(count(wall(lidar, 10, 5)), 0u); // sky
    const double farthest = 40 * std::sqrt(lidar_reflectance(0) / 0.1);
    EXPECT_GT(count(wall(lidar, 0, float(farthest - 0.01))), 0u);
    EXPECT_EQ(count(wall(lidar, 0, float(farthest + 0.01))), 0u);
    EXPECT_GT(count(wall(lidar, 7, 99.9f)), 0u); // a sign
    EXPECT_EQ(count(wall(lidar, 7, 100.1f)), 0u);
    SweepImage thin = wall(lidar, 0, 5);
    thin.alpha.assign(thin.alpha.size(), 0.49f);
    EXPECT_EQ(count(thin), 0u);
}

template <typename T>
std::vector<T> values_of(std::span<const std::byte> bytes)
{
    std::vector<T> values(bytes.size() / sizeof(T));
    std::memcpy(values.data(), bytes.data(), values.size() * sizeof(T));
    return values;
}

TEST(engine_lidar, points_become_the_files_that_other_programs_read)
{
    const std::vector<LidarPoint> points = {{1, 2, 3, 0.5f, 4, 13, 99999, 70000}, {-1, -2, -3, 1, 127, 19, 0, 0}};
    const std::vector<std::byte> npy = encode_lidar(points, LidarFormat::npy);
    const std::string_view text(reinterpret_cast<const char*>(npy.data()), npy.size());
    EXPECT_NE(text.find("'<f4'"), std::string_view::npos);
    EXPECT_NE(text.find("(2, 8)"), std::string_view::npos);
    EXPECT_EQ(values_of<float>(std::span(npy).last(64)),
              (std::vector<float>{1, 2, 3, 0.5f, 4, 99999, 13, 70000, -1, -2, -3, 1, 127, 0, 19, 0}));
    EXPECT_EQ(values_of<float>(encode_lidar(points, LidarFormat::kitti)),
              (std::vector<float>{1, 2, 3, 0.5f, -1, -2, -3, 1}));
    EXPECT_EQ(values_of<float>(encode_lidar(points, LidarFormat::nuscenes)),
              (std::vector<float>{1, 2, 3, 127.5f, 4, -1, -2, -3, 255, 127}));
    const std::vector<std::byte> pcd = encode_lidar(points, LidarFormat::pcd);
    const std::string head(reinterpret_cast<const char*>(pcd.data()), pcd.size() - 56);
    EXPECT_TRUE(head.ends_with("POINTS 2\nDATA binary\n"));
    EXPECT_EQ(values_of<uint16_t>(std::span(pcd).last(56))[8], 4);      // ring
    EXPECT_EQ(values_of<uint16_t>(std::span(pcd).last(56))[9], 13);     // label
    EXPECT_EQ(values_of<uint32_t>(std::span(pcd).last(56))[5], 99999u); // t
    EXPECT_EQ(values_of<uint32_t>(std::span(pcd).last(56))[6], 70000u); // instance
    EXPECT_EQ(encode_lidar({}, LidarFormat::kitti).size(), 0u);
}

TEST(engine_lidar, shards_take_the_files_of_points)
{
    for (const std::string_view ending : kLidarEndings) {
        const auto picture = shard_picture(fmt::format("top/points/000012.{}", ending));
        ASSERT_TRUE(picture) << ending;
        EXPECT_EQ(picture->camera, "top");
        EXPECT_EQ(picture->kind, "points");
        EXPECT_EQ(member_name("S_", *picture), fmt::format("S_000012.top.points.{}", ending));
    }
    EXPECT_FALSE(shard_picture("top/points/000012.pcd.gz"));
}

} // namespace engine_lidar_test
} // namespace semrover
