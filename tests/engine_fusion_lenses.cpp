// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
// What lenses and lidars saw, fused, against the street that they saw
#include "engine/format/lidar_points.h"
#include "engine/format/npy.h"
#include "engine/fusion/fuse.h"
#include "tests/support/kernel_case.h"
#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/street_scene.h"
#include "tools/fuse/fusion_folder.h"

#include <map>

namespace semrover {
namespace engine_fusion_lenses_test {

constexpr double kPi = 3.14159265358979;
const StreetScene kStreet;

double percentile(std::vector<double> values, double share)
{
    std::ranges::sort(values);
    return values.empty() ? 1e9 : values[size_t(double(values.size() - 1) * share)];
}

struct Measured {
    size_t faces = 0;
    double within = 0; // metres, 95 % of vertices
    double labels = 0; // share of faces with the right one
    double colors = 0; // share of vertices with that of the place's class, to 8 of 255
    std::map<uint8_t, size_t> classes = {};
};

Measured measure(const FusionFolder& folder, double max_depth)
{
    const auto made = fuse(test_device(), folder.frames(), {.max_depth = max_depth});
    EXPECT_TRUE(made) << made.error().message;
    Measured m;
    if (!made)
        return m;
    const Mesh& mesh = made->mesh;
    std::vector<double> distances;
    size_t colored = 0;
    for (size_t i = 0; i < mesh.positions.size(); ++i) {
        const Point3 p = {mesh.positions[i][0], mesh.positions[i][1], mesh.positions[i][2]};
        distances.push_back(std::abs(kStreet.distance(p)));
        const auto& truth = kPalette[kStreet.label(p)].color;
        bool same = true;
        for (size_t c = 0; c < 3; ++c)
            same = same && std::abs(int(truth[c]) - int(mesh.colors[i][c])) <= 8;
        colored += same;
    }
    size_t right = 0;
    for (size_t f = 0; f < mesh.faces.size(); ++f) {
        Point3 middle{};
        for (const uint32_t v : mesh.faces[f])
            for (size_t axis = 0; axis < 3; ++axis)
                middle[axis] += double(mesh.positions[v][axis]) / 3;
        right += mesh.face_labels[f] == kStreet.label(middle);
        ++m.classes[mesh.face_labels[f]];
    }
    m.faces = mesh.faces.size();
    m.within = percentile(distances, 0.95);
    m.labels = double(right) / double(m.faces);
    m.colors = double(colored) / double(mesh.positions.size());
    return m;
}

void put_pictures(const ScratchFolder& folder, const CameraPath& path, bool depth, bool labels = true)
{
    std::map<std::string, uint32_t> counts;
    for (const CameraFrame& f : path.frames) {
        const DepthImages images = kStreet.render(f);
        const uint32_t w = f.intrinsics.width, h = f.intrinsics.height;
        const auto place = [&](const char* kind) {
            const Path picture = folder / picture_name(f.camera, kind, counts[f.camera]);
            std::filesystem::create_directories(picture.parent_path());
            return picture;
        };
        std::vector<uint16_t> millimetres;
        for (const float d : images.depth)
            millimetres.push_back(uint16_t(std::lround(d * 1000)));
        if (depth) {
            ASSERT_TRUE(write_png_gray16(place("depth"), w, h, millimetres));
        }
        if (labels) {
            ASSERT_TRUE(write_png_gray8(place("label"), w, h, images.labels));
        }
        ASSERT_TRUE(write_png_rgb8(place("color"), w, h, images.colors));
        ++counts[f.camera];
    }
    ASSERT_TRUE(write_transforms(folder / "transforms.json", path));
}

Measured fused(const Intrinsics& lens, size_t frames)
{
    const ScratchFolder folder;
    CameraPath path{StreetScene::drive(frames)};
    for (CameraFrame& f : path.frames)
        f.intrinsics = lens;
    put_pictures(folder, path, true);
    const auto opened = FusionFolder::open(folder.path(), {});
    EXPECT_TRUE(opened) << opened.error().message;
    if (!opened || !const_cast<FusionFolder&>(*opened).check_labels())
        return {};
    EXPECT_EQ(opened->count(), frames);
    return measure(*opened, 9);
}

void expect_good(const Measured& m)
{
    testing::Test::RecordProperty("measured",
                                  fmt::format("{} faces, 95 % within {:.4f} m, labels {:.4f}, colours {:.4f}", m.faces,
                                              m.within, m.labels, m.colors));
    EXPECT_GT(m.faces, 5000u);
    EXPECT_LT(m.within, 0.06);
    EXPECT_GT(m.labels, 0.95);
    EXPECT_GT(m.colors, 0.9);
    for (const uint8_t label : {0, 1, 2, 13})
        EXPECT_GT(m.classes.at(label), 100u) << int(label);
}

TEST(EngineFusionLenses, a_lens_with_distortion_is_as_good_as_a_pinhole)
{
    Intrinsics lens = pinhole_from_fov(80, 160, 120);
    const Measured pinhole = fused(lens, 6);
    lens.model = CameraModel::opencv;
    lens.distortion = {-0.25, 0.06, 0.001, -0.002};
    const Measured bent = fused(lens, 6);
    expect_good(pinhole);
    expect_good(bent);
    EXPECT_LT(bent.within, pinhole.within + 0.01); // it sees further to the sides
}

TEST(EngineFusionLenses, fisheyes_and_panoramas_become_sides_of_a_cube)
{
    Intrinsics fisheye = fisheye_from_fov(190, 320, 240);
    fisheye.distortion = {0.02, -0.003};
    expect_good(fused(fisheye, 4));
    expect_good(fused(whole_sphere(512, 256), 4));
}

// a lidar that turns: a sweep at each moment, of beams that are 0.4 degrees apart near the horizon and 1 degree below
struct LidarDrive {
    static constexpr size_t kSweeps = 3;

    LidarDrive(bool labels_of_points, bool labels_of_pictures)
    {
        CameraPath path;
        for (const CameraFrame& f : StreetScene::drive(kSweeps))
            for (size_t side = 0; side < 4; ++side) {
                const Rigid pose = f.pose.camera_to_world();
                const double left = std::atan2(pose[6], pose[2]) + 0.5 * kPi * double(side);
                path.frames.push_back(
                    StreetScene::camera(translation_of(pose), left, 0.1, pinhole_from_fov(100, 160, 120)));
                path.frames.back().time = f.time + 0.03;
                path.frames.back().camera = std::string("camera") + char('0' + side);
            }
        put_pictures(folder, path, false, labels_of_pictures);
        std::filesystem::create_directories(folder / "buffer/camera0/depth"); // of `render`: not the frames' own
        const std::vector<uint16_t> other(160 * 120, 1000);
        EXPECT_TRUE(write_png_gray16(folder / "buffer/camera0/depth/000000.png", 160, 120, other));
        std::filesystem::create_directories(folder / "roof/points");
        Json sweeps = Json::array();
        for (size_t i = 0; i < kSweeps; ++i) {
            Rigid pose = path.frames[4 * i].pose.camera_to_world();
            const double left = std::atan2(pose[6], pose[2]);
            pose = {std::cos(left),
                    -std::sin(left),
                    0,
                    pose[3],
                    std::sin(left),
                    std::cos(left),
                    0,
                    pose[7],
                    0,
                    0,
                    1,
                    1.9,
                    0,
                    0,
                    0,
                    1};
            put_sweep(i, pose, labels_of_points);
            const std::vector<double> end(pose.begin(), pose.end());
            sweeps.push_back({{"time", int64_t(i) * 1000000}, {"duration", 100000}, {"begin", end}, {"end", end}});
        }
        folder.put("roof/sweeps.json", Json{{"format", kSweepsFormat}, {"version", 1}, {"sweeps", sweeps}}.dump());
    }

    void put_sweep(size_t number, const Rigid& pose, bool labels) const
    {
        std::vector<float> rows;
        for (size_t column = 0; column < 1800; ++column)
            for (double down = -10; down < 25; down += down < 8 ? 0.4 : 1) {
                const double left = 0.0035 * double(column) + 0.0003 * down, low = down * kPi / 180;
                const Point3 own = {std::cos(left) * std::cos(low), std::sin(left) * std::cos(low), -std::sin(low)};
                const Point3 ahead = transform(pose, own), from = translation_of(pose);
                const Point3 ray = {ahead[0] - from[0], ahead[1] - from[1], ahead[2] - from[2]};
                const auto seen = kStreet.along(from, ray);
                if (seen.metres > 60)
                    continue;
                for (const double axis : own)
                    rows.push_back(float(axis * seen.metres));
                for (const float rest : {0.5f, 0.f, 0.f, labels ? float(seen.label) : 255.f, 0.f})
                    rows.push_back(rest);
            }
        const auto bytes = std::as_bytes(std::span(rows));
        const auto file = encode_npy({DType::f32, {rows.size() / 8, 8}, {bytes.begin(), bytes.end()}});
        folder.put(fmt::format("roof/points/{:06}.npy", number),
                   {reinterpret_cast<const char*>(file.data()), file.size()});
    }

    ScratchFolder folder;
};

TEST(EngineFusionLenses, sweeps_of_a_lidar_are_coloured_by_cameras_and_labelled_by_points_or_pictures)
{
    for (const bool of_points : {true, false}) {
        const LidarDrive drive(of_points, !of_points);
        auto folder = FusionFolder::open(drive.folder.path(), {});
        ASSERT_TRUE(folder) << folder.error().message;
        ASSERT_TRUE(folder->check_labels());
        EXPECT_EQ(folder->cameras().size(), 4 * LidarDrive::kSweeps);
        EXPECT_EQ(folder->count(), 4 * LidarDrive::kSweeps); // pictures
        expect_good(measure(*folder, 12));
    }
}

TEST(EngineFusionLenses, sweeps_lie_where_the_path_is_placed)
{
    const LidarDrive drive(true, false);
    FusionFolderOptions options;
    const auto here = FusionFolder::open(drive.folder.path(), options);
    options.placement.origin = {100, -20, 3};
    options.placement.relative_to = PathPlacement::kFirst;
    const auto there = FusionFolder::open(drive.folder.path(), options);
    ASSERT_TRUE(here && there);
    // the first camera's frame in the path's world
    const Rigid first = StreetScene::camera({0, 0, 1.65}, 0, 0.1, pinhole_from_fov(100, 160, 120)).pose.world_to_camera;
    for (size_t i = 0; i < here->cameras().size(); ++i) {
        Rigid expect = compose(first, here->cameras()[i].pose.camera_to_world());
        for (size_t axis = 0; axis < 3; ++axis)
            expect[4 * axis + 3] += options.placement.origin[axis];
        const Rigid found = there->cameras()[i].pose.camera_to_world();
        for (size_t n = 0; n < 16; ++n)
            EXPECT_NEAR(found[n], expect[n], 1e-6) << i << " " << n;
    }
}

TEST(EngineFusionLenses, pixels_that_are_not_used_are_left_out)
{
    const ScratchFolder folder;
    const CameraPath path{StreetScene::drive(1)};
    put_pictures(folder, path, true);
    const auto whole = FusionFolder::open(folder.path(), {});
    ASSERT_TRUE(whole) << whole.error().message;
    std::filesystem::create_directory(folder / "used");
    std::vector<uint8_t> used(80 * 60, 255); // of half the size
    for (size_t i = 0; i < used.size(); ++i)
        used[i] = i % 80 < 40 ? 255 : 0;
    ASSERT_TRUE(write_png_gray8(folder / "used/000000.png", 80, 60, used));
    const auto half = FusionFolder::open(folder.path(), {});
    ASSERT_TRUE(half) << half.error().message;
    const auto all = whole->frames().load(0), left = half->frames().load(0);
    ASSERT_TRUE(all && left);
    for (size_t i = 0; i < all->depth.size(); ++i)
        ASSERT_EQ(left->depth[i], i % 160 < 80 ? all->depth[i] : 0) << i;
    ASSERT_TRUE(write_png_gray8(folder / "used/000000.png", 80, 30, std::vector<uint8_t>(80 * 30)));
    EXPECT_TRUE(says(FusionFolder::open(folder.path(), {}), "used/000000.png' is 80 x 30 pixels"));
}

TEST(EngineFusionLenses, spoilt_sweeps_are_refused_by_name)
{
    const auto refused = [](const char* file, std::string_view text, std::string_view expect) {
        const LidarDrive drive(true, false);
        drive.folder.put(file, text);
        EXPECT_TRUE(says(FusionFolder::open(drive.folder.path(), {}), expect)) << file;
    };
    refused("roof/sweeps.json", "[]", "sweeps.json': expected an object with format semrover.sweeps and sweeps");
    refused("roof/sweeps.json", R"({"format": "semrover.sweeps", "sweeps": []})", "no sweeps");
    refused("roof/sweeps.json", R"({"format": "semrover.sweeps", "sweeps": [{"time": 1}]})",
            "expected a sweep with its end");
    refused("roof/points/000001.npy", "x", "000001.npy'");
    const LidarDrive drive(true, false);
    std::filesystem::remove(drive.folder / "roof/points/000002.npy");
    EXPECT_TRUE(says(FusionFolder::open(drive.folder.path(), {}), "000002.npy' is missing: points are read from .npy"));
}

} // namespace engine_fusion_lenses_test
} // namespace semrover
