// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// drives in the layouts of other programs (tools/export), without a device
#include "engine/format/npy.h"
#include "engine/format/number_image.h"
#include "tests/support/drive_folder.h"
#include "tests/support/nuscenes_schema.h"
#include "tests/support/scratch_folder.h"
#include "tools/dataset/object_boxes.h"
#include "tools/dataset/pack_shards.h"
#include "tools/export/exporters.h"
#include "tools/trajectory/camera_path.h"

#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <sstream>

namespace semrover {
namespace engine_export_test {

namespace fs = std::filesystem;

constexpr size_t kMoments = 13; // 1.2 s

// two drives, of which the second one is a shard set
class Export : public testing::Test {
  protected:
    Export()
    {
        DriveFolder first;
        first.lidar = true;
        first.write(folder_ / "one", kMoments);
        DriveFolder second;
        second.jpeg = true;
        second.meters_a_moment = 0;
        second.write(folder_ / "second", kMoments);
        EXPECT_TRUE(pack_shards(folder_ / "second", folder_ / "two"));
    }
    ExportReport run(Exporter exporter, const std::string& out, size_t drives = 2, ExportOptions options = {}) const
    {
        std::vector<DriveInput> inputs;
        for (const char* name : {"one", "two"}) {
            auto drive = open_drive(folder_ / name);
            EXPECT_TRUE(drive) << drive.error().message;
            if (inputs.size() < drives)
                inputs.push_back(std::move(*drive));
        }
        fs::create_directories(folder_ / out);
        auto report = exporter(inputs, folder_ / out, options);
        EXPECT_TRUE(report) << report.error().message;
        return report ? std::move(*report) : ExportReport{};
    }
    std::map<std::string, std::string> files(const std::string& out) const
    {
        std::map<std::string, std::string> all;
        const auto paths = list_tree(folder_ / out);
        EXPECT_TRUE(paths);
        for (const Path& path : *paths)
            all[path.lexically_relative(folder_ / out).string()] = contents(path);
        return all;
    }

    ScratchFolder folder_;
};

std::vector<double> numbers_in(const std::string& text)
{
    std::istringstream stream(text);
    std::vector<double> numbers;
    for (double v; stream >> v;)
        numbers.push_back(v);
    return numbers;
}

Rigid matrix_in(const std::string& text)
{
    Rigid m{};
    const std::vector<double> values = numbers_in(text);
    EXPECT_EQ(values.size(), 16u);
    std::ranges::copy(values, m.begin());
    return m;
}

TEST_F(Export, makes_the_same_bytes_each_time)
{
    for (const NamedExporter& exporter : kExporters) {
        const size_t drives = exporter.several ? 2 : 1;
        run(exporter.run, std::string("a/") + exporter.name, drives);
        run(exporter.run, std::string("b/") + exporter.name, drives);
    }
    EXPECT_GT(files("a").size(), 200u);
    EXPECT_TRUE(files("a") == files("b"));
}

TEST_F(Export, nuscenes_is_as_its_schema_says)
{
    const ExportReport report = run(export_nuscenes, "nu", 2, {.val = 1});
    EXPECT_EQ(report.pictures, 2 * 2 * kMoments);
    EXPECT_EQ(NuscenesSchema::faults(folder_ / "nu", "v1.0-trainval"), std::vector<std::string>());
    const Path tables = folder_ / "nu" / "v1.0-trainval";
    const Json scenes = NuscenesSchema::table(tables, "scene");
    ASSERT_EQ(scenes.size(), 2u);
    EXPECT_EQ(scenes[0]["name"], "scene-0001");                    // of train
    EXPECT_EQ(scenes[1]["name"], "scene-0003");                    // of val
    EXPECT_EQ(scenes[0]["nbr_samples"], 3);                        // at 0, 0.5 and 1 s
    EXPECT_EQ(NuscenesSchema::table(tables, "sensor").size(), 3u); // with the lidar of the first drive
    EXPECT_EQ(report.left_out, (std::map<std::string, size_t>{{"building", 6}}));
}

// what the checker would say of tables that are broken in one place
TEST_F(Export, nuscenes_checker_finds_what_is_wrong)
{
    run(export_nuscenes, "nu", 1);
    const Path tables = folder_ / "nu" / "v1.0-trainval";
    const auto broken = [&](const std::string& table, const std::function<void(Json&)>& change) {
        const std::string before = contents(tables / (table + ".json"));
        Json json = Json::parse(before);
        change(json);
        EXPECT_TRUE(write_file_atomically(tables / (table + ".json"), json.dump()));
        const auto faults = NuscenesSchema::faults(folder_ / "nu", "v1.0-trainval");
        EXPECT_TRUE(write_file_atomically(tables / (table + ".json"), before));
        return faults.empty() ? std::string("nothing") : faults[0];
    };
    const auto has = [](const std::string& found, const char* what) {
        return found.find(what) != std::string::npos ? testing::AssertionSuccess()
                                                     : testing::AssertionFailure() << found;
    };
    EXPECT_TRUE(has(broken("sample", [](Json& t) { t[1]["prev"] = ""; }), "is another"));
    EXPECT_TRUE(has(broken("sample", [](Json& t) { t[1]["timestamp"] = 0; }), "later"));
    EXPECT_TRUE(has(broken("sample_data", [](Json& t) { t[0]["ego_pose_token"] = "x"; }), "leads nowhere"));
    EXPECT_TRUE(has(broken("sample_data", [](Json& t) { t[0]["width"] = 5; }), "another size"));
    EXPECT_TRUE(has(broken("ego_pose", [](Json& t) { t[0]["rotation"] = {1, 1, 0, 0}; }), "rotation is"));
    EXPECT_TRUE(has(broken("instance", [](Json& t) { t[0]["nbr_annotations"] = 7; }), "not as it says"));
    EXPECT_TRUE(has(broken("map", [](Json& t) { t.clear(); }), "no map"));
    EXPECT_TRUE(has(broken("map", [](Json& t) { t[0]["filename"] = "maps/x.png"; }), "no gray picture"));
    EXPECT_TRUE(has(broken("scene", [](Json& t) { t[0]["nbr_samples"] = 1; }), "another last one"));
}

// the global frame -> vehicle -> camera -> picture, with numbers of the tables alone
TEST_F(Export, nuscenes_boxes_lie_on_the_things_that_pictures_show)
{
    run(export_nuscenes, "nu", 1);
    const Path tables = folder_ / "nu" / "v1.0-trainval";
    std::map<std::string, Json> poses, calibrations;
    for (const Json& p : NuscenesSchema::table(tables, "ego_pose"))
        poses[p["token"]] = p;
    for (const Json& c : NuscenesSchema::table(tables, "calibrated_sensor"))
        calibrations[c["token"]] = c;
    const auto rigid = [](const Json& r) {
        const Json &t = r["translation"], &q = r["rotation"];
        return rigid_from_quaternion({t[0], t[1], t[2]}, {q[1], q[2], q[3], q[0]}, "").value();
    };
    size_t compared = 0;
    for (const Json& data : NuscenesSchema::table(tables, "sample_data")) {
        const Json& calibrated = calibrations[data["calibrated_sensor_token"]];
        const Json& k = calibrated["camera_intrinsic"];
        if (k.empty()) // the lidar's
            continue;
        const Rigid to_camera = inverse(compose(rigid(poses[data["ego_pose_token"]]), rigid(calibrated)));
        const auto picture = read_image_rgb8(folder_ / "nu" / data["filename"].get<std::string>());
        ASSERT_TRUE(picture);
        for (const Json& a : NuscenesSchema::table(tables, "sample_annotation")) {
            if (a["sample_token"] != data["sample_token"] || !data["is_key_frame"].get<bool>())
                continue;
            const Point3 at = transform(to_camera, {a["translation"][0], a["translation"][1], a["translation"][2]});
            const double x = double(k[0][0]) * at[0] / at[2] + double(k[0][2]);
            const double y = double(k[1][1]) * at[1] / at[2] + double(k[1][2]);
            if (at[2] < 1 || x < 1 || y < 1 || x > picture->width - 1 || y > picture->height - 1)
                continue;
            // a car's or a person's colour is where its middle is, but for what JPEG does
            const uint8_t* color = &picture->pixels[3 * (size_t(y) * picture->width + size_t(x))];
            const auto near = [&](uint8_t label) {
                int most = 0;
                for (size_t c = 0; c < 3; ++c)
                    most = std::max(most, std::abs(int(color[c]) - int(kPalette[label].color[c])));
                return most < 60;
            };
            EXPECT_TRUE(near(13) || near(11)) << int(color[0]) << " " << int(color[1]) << " " << int(color[2]);
            ++compared;
        }
    }
    EXPECT_GE(compared, 8u);
    // the mask has road under the vehicle's way, and none where nothing was seen
    const Json map = NuscenesSchema::table(tables, "map")[0];
    const auto mask = read_png_rgb8(folder_ / "nu" / map["filename"].get<std::string>());
    ASSERT_TRUE(mask);
    EXPECT_EQ(mask->width, 1300u);              // -60 to 70 m
    const auto seen = [&](double x, double y) { // of the drive's world
        return mask
            ->pixels[3 * (size_t(mask->height - 1 - std::floor((y + 70) * 10)) * mask->width + size_t((x + 60) * 10))];
    };
    EXPECT_EQ(seen(8, -0.5), 255);
    EXPECT_EQ(seen(-20, -0.5), 0);
}

TEST_F(Export, kitti_labels_come_back_through_its_reader_and_lie_on_the_picture)
{
    const ExportReport report = run(export_kitti, "kitti", 2, {.val = 1});
    EXPECT_EQ(report.pictures, 2 * kMoments); // one camera
    const Path training = folder_ / "kitti" / "training";
    EXPECT_EQ(std::ranges::count(contents(folder_ / "kitti/ImageSets/train.txt"), '\n'), std::ptrdiff_t(kMoments));
    EXPECT_EQ(contents(folder_ / "kitti/ImageSets/val.txt").substr(0, 7), "000013\n");
    const DriveFolder drive;
    const CameraPath path = drive.path(kMoments);
    for (const size_t moment : {0, 5}) {
        const std::string name = fmt::format("{:06}", moment);
        const CameraFrame& frame = path.frames[2 * moment];
        const std::string text = contents(training / "label_2" / (name + ".txt"));
        const std::string calib = contents(training / "calib" / (name + ".txt"));
        const size_t p2 = calib.find("P2: "), tr = calib.find("Tr_velo_to_cam: ");
        const std::vector<double> p = numbers_in(calib.substr(p2 + 4, calib.find('\n', p2) - p2 - 4));
        ASSERT_EQ(p.size(), 12u);
        std::istringstream lines(text);
        size_t count = 0;
        for (std::string line; std::getline(lines, line); ++count) {
            const std::string type = line.substr(0, line.find(' '));
            const std::vector<double> v = numbers_in(line.substr(type.size()));
            ASSERT_EQ(v.size(), 14u) << line;
            // corners as the devkit makes them of h w l x y z ry
            PictureBox box{1e9, 1e9, -1e9, -1e9};
            for (unsigned corner = 0; corner < 8; ++corner) {
                const double x = (corner & 1 ? 0.5 : -0.5) * v[9], y = corner & 2 ? 0 : -v[7];
                const double z = (corner & 4 ? 0.5 : -0.5) * v[8], c = std::cos(v[13]), s = std::sin(v[13]);
                const double at[] = {c * x + s * z + v[10], y + v[11], -s * x + c * z + v[12]};
                if (at[2] < 0.2)
                    continue;
                const double u = (p[0] * at[0] + p[2] * at[2]) / at[2], w = (p[5] * at[1] + p[6] * at[2]) / at[2];
                box = {std::min(box.left, u), std::min(box.top, w), std::max(box.right, u), std::max(box.bottom, w)};
            }
            EXPECT_NEAR(std::clamp(box.left, 0.0, 159.0), v[3], 0.03) << line;
            EXPECT_NEAR(std::clamp(box.top, 0.0, 95.0), v[4], 0.03) << line;
            EXPECT_NEAR(std::clamp(box.right, 0.0, 159.0), v[5], 0.03) << line;
            EXPECT_NEAR(std::clamp(box.bottom, 0.0, 95.0), v[6], 0.03) << line;
            EXPECT_NEAR(std::remainder(v[13] - std::atan2(v[10], v[12]) - v[2], 2 * std::numbers::pi), 0, 1e-3);
        }
        EXPECT_GE(count, 2u) << text;
        // our own reader of KITTI's boxes, and the path into the vehicle's axes that the calibration says
        const std::vector<double> t = numbers_in(calib.substr(tr + 16, calib.find('\n', tr) - tr - 16));
        const Rigid velo_to_cam = rigid_from_matrix(t, "Tr").value();
        const Rigid vehicle_to_world =
            compose(compose(frame.pose.camera_to_world(), velo_to_cam), inverse(DriveFolder::lidar_mount()));
        EXPECT_NEAR(translation_of(vehicle_to_world)[0], 0.4 * double(moment), 1e-9);
        EXPECT_NEAR(translation_of(vehicle_to_world)[1], -0.5, 1e-9);
        EXPECT_NEAR(translation_of(vehicle_to_world)[2], 0, 1e-9);
    }
    const auto odometry = read_camera_path(folder_ / "kitti/sequences/00/poses.txt", {pinhole_from_fov(80, 160, 96)});
    ASSERT_TRUE(odometry) << odometry.error().message;
    ASSERT_EQ(odometry->frames.size(), kMoments);
    for (size_t i = 0; i < kMoments; ++i) {
        EXPECT_NEAR(odometry->frames[i].time, path.frames[2 * i].time, 1e-9);
        EXPECT_NEAR(odometry->frames[i].intrinsics.cx, 80, 1e-9);
        for (size_t j = 0; j < 12; ++j)
            EXPECT_NEAR(odometry->frames[i].pose.world_to_camera[j], path.frames[2 * i].pose.world_to_camera[j], 1e-9);
    }
}

// points on pictures: what depth says of road pixels lies in the plane of the road
TEST_F(Export, drivestudio_poses_and_lenses_put_pixels_where_they_are)
{
    const ExportReport report = run(export_drivestudio, "ds", 2);
    EXPECT_EQ(report.warnings, std::vector<std::string>());
    const Path scene = folder_ / "ds" / "000";
    const Rigid opencv_to_flu = {0, 0, 1, 0, -1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 0, 1}; // OPENCV2DATASET of its loader
    double most = 0;
    size_t pixels = 0;
    for (const size_t t : {0, 7})
        for (const int c : {0, 1}) {
            const Rigid ego = matrix_in(contents(scene / "ego_pose" / fmt::format("{:03}.txt", t)));
            const Rigid cam =
                compose(matrix_in(contents(scene / "extrinsics" / fmt::format("{}.txt", c))), opencv_to_flu);
            const std::vector<double> k = numbers_in(contents(scene / "intrinsics" / fmt::format("{}.txt", c)));
            ASSERT_EQ(k.size(), 9u);
            const Path from = folder_ / "one" / (c ? "front_left" : "front");
            const auto depth = read_png_gray16(from / fmt::format("depth/{:06}.png", t));
            const auto label = read_label_image(from / fmt::format("label/{:06}.png", t));
            const auto sky = read_png_rgb8(scene / "sky_masks" / fmt::format("{:03}_{}.png", t, c));
            ASSERT_TRUE(depth && label && sky);
            for (uint32_t y = 0; y < depth->height; ++y)
                for (uint32_t x = 0; x < depth->width; ++x) {
                    const size_t i = size_t(y) * depth->width + x;
                    EXPECT_EQ(sky->pixels[3 * i], label->numbers[i] == 10 ? 255 : 0);
                    if (label->numbers[i] != 0 || depth->pixels[i] == 0 || depth->pixels[i] > 20000)
                        continue;
                    const double z = depth->pixels[i] * 0.001;
                    const Point3 at =
                        transform(compose(ego, cam), {(x + 0.5 - k[2]) / k[0] * z, (y + 0.5 - k[3]) / k[1] * z, z});
                    most = std::max(most, std::abs(at[2]));
                    ++pixels;
                }
        }
    EXPECT_GT(pixels, 5000u);
    EXPECT_LT(most, 5e-4); // half a millimetre of depth
    const Json info = read_json(scene / "instances" / "instances_info.json").value();
    ASSERT_EQ(info.size(), 3u); // two cars, a person
    EXPECT_EQ(info["1"]["id"], "7");
    EXPECT_EQ(info["1"]["class_name"], "Vehicle");
    const auto masks = [&](const char* kind, const char* scene_name) {
        size_t set = 0;
        const auto paths = list_files(folder_ / "ds" / scene_name / "dynamic_masks" / kind);
        EXPECT_TRUE(paths);
        for (const Path& file : *paths) {
            const ImageRgb8 mask = read_png_rgb8(file).value();
            set += size_t(std::ranges::count(mask.pixels, 255)) / 3;
        }
        return set;
    };
    EXPECT_GT(masks("vehicle", "000"), 1000u);
    EXPECT_EQ(masks("vehicle", "000"), masks("all", "000"));
    EXPECT_EQ(masks("human", "000"), 0u);
    EXPECT_EQ(masks("all", "001"), 0u); // nothing moves there
}

// files of an archive, by the rules of ustar
std::map<std::string, std::string> members_of(const Path& path)
{
    const std::string bytes = contents(path);
    std::map<std::string, std::string> members;
    for (size_t at = 0; at + 512 <= bytes.size() && bytes[at];) {
        const size_t size = std::stoul(bytes.substr(at + 124, 11), nullptr, 8);
        members[bytes.c_str() + at] = bytes.substr(at + 512, size);
        at += 512 + (size + 511) / 512 * 512;
    }
    return members;
}

TEST_F(Export, infinicube_has_a_clip_in_archives_by_attribute)
{
    run(export_infinicube, "ic", 2);
    const CameraPath path = DriveFolder().path(kMoments);
    const auto poses = members_of(folder_ / "ic/pose/one.tar");
    ASSERT_EQ(poses.size(), 2 * kMoments);
    const std::string& npy = poses.at("one.000004.pose.front_left.npy");
    const NpyHeader header = parse_npy_header(npy, "").value();
    EXPECT_EQ(header.dtype, DType::f64);
    EXPECT_EQ(header.shape, (std::vector<uint64_t>{4, 4}));
    Rigid pose;
    std::memcpy(pose.data(), npy.data() + header.bytes, sizeof pose);
    for (size_t i = 0; i < 16; ++i)
        EXPECT_NEAR(pose[i], path.frames[9].pose.camera_to_world()[i], 1e-12);
    EXPECT_EQ(members_of(folder_ / "ic/intrinsic/one.tar").size(), 2u);
    const auto moving = members_of(folder_ / "ic/dynamic_object_info/one.tar");
    const Json first = Json::parse(moving.at("one.000000.dynamic_object_info.json"));
    ASSERT_TRUE(first.contains("7"));
    EXPECT_EQ(first["7"]["object_is_moving"], true);
    EXPECT_EQ(first["7"]["object_id_int"], 10000);
    EXPECT_EQ(first["7"]["object_lwh"], Json::array({4, 1.7, 1.5}));
    const auto standing = members_of(folder_ / "ic/static_object_info/one.tar");
    EXPECT_EQ(Json::parse(standing.at("one.000012.static_object_info.json")).size(), 2u);
    // numbers of pictures are those of the objects
    const auto instances = members_of(folder_ / "ic/instance_buffer_front/one.tar");
    const std::string& png = instances.at("one.000000.instance_buffer.front.png");
    const auto numbers = decode_png_numbers(std::as_bytes(std::span(png)), "").value().values;
    EXPECT_GT(std::ranges::count(numbers, 10000), 100);
    EXPECT_GT(std::ranges::count(numbers, 1), 50);
    const auto depths = members_of(folder_ / "ic/voxel_depth_100_front/one.tar");
    const auto depth =
        decode_png_numbers(std::as_bytes(std::span(depths.at("one.000000.voxel_depth_100.front.png"))), "");
    const auto ours = read_png_gray16(folder_ / "one/front/depth/000000.png");
    for (size_t i = 0; i < ours->pixels.size(); ++i)
        EXPECT_LE(std::abs(depth->values[i] * 10 - int(ours->pixels[i])), 10);
    EXPECT_TRUE(fs::exists(folder_ / "ic/image_front_left/two.tar"));
}

TEST_F(Export, folders_to_train_from_name_the_pictures_that_are_there)
{
    const CameraPath path = DriveFolder().path(kMoments);
    run(export_transforms, "tr", 1);
    const auto transforms = read_transforms(folder_ / "tr/transforms.json");
    ASSERT_TRUE(transforms) << transforms.error().message;
    const Json json = read_json(folder_ / "tr/transforms.json").value();
    for (const Json& frame : json["frames"])
        for (const char* key : {"file_path", "depth_file_path", "label_file_path"})
            EXPECT_TRUE(fs::exists(folder_ / "tr" / frame[key].get<std::string>()));
    std::vector<DriveInput> second;
    second.push_back(open_drive(folder_ / "two").value());
    fs::create_directories(folder_ / "co");
    ASSERT_TRUE(export_colmap(second, folder_ / "co", {}));
    const auto colmap = read_colmap(folder_ / "co/sparse/0");
    ASSERT_TRUE(colmap) << colmap.error().message;
    ASSERT_EQ(colmap->frames.size(), path.frames.size());
    for (const CameraPath* back : {&*transforms, &*colmap})
        for (size_t i = 0; i < path.frames.size(); ++i) {
            EXPECT_EQ(back->frames[i].camera, path.frames[i].camera);
            EXPECT_EQ(back->frames[i].intrinsics, path.frames[i].intrinsics);
            for (size_t j = 0; j < 12; ++j)
                EXPECT_NEAR(back->frames[i].pose.world_to_camera[j], path.frames[i].pose.world_to_camera[j], 1e-9);
        }
    for (const CameraFrame& frame : colmap->frames) {
        EXPECT_TRUE(frame.picture.ends_with(".jpg")) << frame.picture; // as its bytes are
        EXPECT_TRUE(fs::exists(folder_ / "co/images" / frame.picture));
    }
}

// points of scans: in the boxes of what they are of, in every layout's own axes
TEST_F(Export, puts_a_lidars_points_where_things_are)
{
    const DriveFolder drive;
    run(export_nuscenes, "nu", 1);
    run(export_kitti, "kitti", 1);
    run(export_drivestudio, "ds", 1);
    const auto floats = [](const Path& path, size_t columns) {
        const std::string bytes = contents(path);
        EXPECT_EQ(bytes.size() % (4 * columns), 0u) << path;
        std::vector<float> values(bytes.size() / 4);
        std::memcpy(values.data(), bytes.data(), bytes.size());
        return values;
    };
    // the devkit's way: of a key frame, with numbers of the tables alone
    const Path tables = folder_ / "nu" / "v1.0-trainval";
    size_t in_boxes = 0;
    for (const Json& a : NuscenesSchema::table(tables, "sample_annotation"))
        in_boxes += a["num_lidar_pts"].get<size_t>();
    size_t of_objects = 0;
    for (const size_t moment : {0, 5, 10}) {
        const auto ours = read_scan(folder_ / "one/top/points" / fmt::format("{:06}.npy", moment)).value();
        for (const ScanPoint& p : ours)
            of_objects += p[7] == 4 || p[7] == 8 || p[7] == 13; // two cars and a person
        const auto theirs = floats(folder_ / "nu/samples/LIDAR_TOP" /
                                       fmt::format("scene-0001__LIDAR_TOP__{:016}.pcd.bin", 2000000 + moment * 100000),
                                   5);
        ASSERT_EQ(theirs.size(), 5 * ours.size());
        EXPECT_EQ(theirs[3], 127.5f);
    }
    EXPECT_GT(in_boxes, 20u);
    EXPECT_NEAR(double(in_boxes), double(of_objects), 0.1 * double(of_objects)); // on a box' face: either side
    // KITTI: through the calibration to the picture
    const std::string calib = contents(folder_ / "kitti/training/calib/000003.txt");
    const auto line = [&](const char* key) {
        const size_t at = calib.find(key) + std::string(key).size();
        return numbers_in(calib.substr(at, calib.find('\n', at) - at));
    };
    const std::vector<double> p = line("P2: "), tr = line("Tr_velo_to_cam: ");
    const Rigid to_camera = rigid_from_matrix(tr, "Tr").value();
    const auto depth = read_png_gray16(folder_ / "one/front/depth/000003.png");
    const auto velodyne = floats(folder_ / "kitti/training/velodyne/000003.bin", 4);
    const auto ego = matrix_in(contents(folder_ / "ds/000/ego_pose/003.txt"));
    const auto studio = floats(folder_ / "ds/000/lidar/003.bin", 14);
    ASSERT_EQ(studio.size() / 14, velodyne.size() / 4);
    size_t compared = 0, near = 0;
    for (size_t i = 0; i < velodyne.size() / 4; ++i) {
        const Point3 at = transform(to_camera, {velodyne[4 * i], velodyne[4 * i + 1], velodyne[4 * i + 2]});
        const Point3 world = transform(ego, {studio[14 * i + 3], studio[14 * i + 4], studio[14 * i + 5]});
        EXPECT_GT(world[2], -1e-3); // nothing lies below the road
        const double x = (p[0] * at[0] + p[2] * at[2]) / at[2] + 0.5, y = (p[5] * at[1] + p[6] * at[2]) / at[2] + 0.5;
        if (at[2] < 1 || x < 1 || y < 1 || x > 158 || y > 94)
            continue;
        ++compared;
        const double seen = depth->pixels[size_t(y) * 160 + size_t(x)] * 0.001;
        near += std::abs(seen - at[2]) < 0.05 * at[2];
    }
    EXPECT_GT(compared, 200u);
    EXPECT_GT(double(near), 0.9 * double(compared)); // others lie where the camera does not see
}

TEST_F(Export, refuses_what_a_layout_has_no_place_for)
{
    const auto refusal = [&](Exporter exporter, const ExportOptions& options) {
        std::vector<DriveInput> drives;
        drives.push_back(open_drive(folder_ / "one").value());
        drives[0].record.sensors[1].intrinsics.model = CameraModel::fisheye;
        fs::create_directories(folder_ / "no");
        const auto report = exporter(drives, folder_ / "no", options);
        return report ? std::string("nothing") : report.error().message;
    };
    for (const Exporter exporter : {export_nuscenes, export_infinicube})
        EXPECT_NE(refusal(exporter, {}).find("camera 'front_left' has the lens fisheye"), std::string::npos);
    EXPECT_NE(refusal(export_kitti, {.camera = "front_left"}).find("fisheye"), std::string::npos);
    EXPECT_NE(refusal(export_kitti, {.camera = "back"}).find("has no `camera` 'back'"), std::string::npos);
    EXPECT_EQ(refusal(export_kitti, {}), "nothing"); // of the front
    // boxes of other pictures
    folder_.put("one/boxes.jsonl", contents(folder_ / "one/boxes.jsonl").substr(0, 0));
    EXPECT_NE(open_drive(folder_ / "one").error().message.find("no line of picture 0 of camera 'front'"),
              std::string::npos);
}

} // namespace engine_export_test
} // namespace semrover
