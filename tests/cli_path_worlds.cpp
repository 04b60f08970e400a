// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
// trajectories and grids of data sets whose frames differ, in the data sets' own layouts: what is drawn has the depth
// that rays through the voxels have
#include "engine/format/image.h"
#include "tests/support/program.h"
#include "tests/support/zip_bytes.h"
#include "tools/trajectory/camera_path.h"

#include <gtest/gtest.h>

namespace semrover {
namespace cli_path_worlds_test {

namespace fs = std::filesystem;

// a volume as a data set has it: a row of houses to the left and right, a wall ahead, and one house that only one side
// has, so that no mirror image looks the same
struct Voxels {
    std::array<size_t, 3> size;
    double edge;
    Point3 origin; // of the first voxel's corner, in the volume's frame
    std::vector<uint8_t> labels{};

    Voxels(std::array<size_t, 3> s, double e, Point3 o) : size(s), edge(e), origin(o), labels(s[0] * s[1] * s[2]) {}

    void fill(Point3 low, Point3 high, uint8_t label)
    {
        for (size_t i = 0; i < labels.size(); ++i) {
            const Point3 p = centre(i);
            bool in = true;
            for (size_t a = 0; a < 3; ++a)
                in = in && p[a] > low[a] && p[a] < high[a];
            if (in)
                labels[i] = label;
        }
    }
    Point3 centre(size_t i) const
    {
        const size_t at[] = {i / (size[1] * size[2]), i / size[2] % size[1], i % size[2]};
        Point3 p;
        for (size_t a = 0; a < 3; ++a)
            p[a] = origin[a] + edge * (double(at[a]) + 0.5);
        return p;
    }
    uint8_t at(const Point3& p) const
    {
        size_t index = 0;
        for (size_t a = 0; a < 3; ++a) {
            const double i = std::floor((p[a] - origin[a]) / edge);
            if (!(i >= 0 && i < double(size[a])))
                return 0;
            index = index * size[a] + size_t(i);
        }
        return labels[index];
    }
};

void build_street(Voxels& v, double ground, uint8_t road, uint8_t house)
{
    v.fill(
        {
            0,
            -4,
            ground - v.edge,
        },
        {36, 4, ground}, road);
    v.fill({0, 6, ground}, {36, 8, ground + 4}, house);
    v.fill({10, -9, ground}, {16, -6, ground + 3}, house);
    v.fill({30, -9, ground}, {32, 6, ground + 5}, house);
}

// camera to the volume's frame, OpenCV axes: at `place`, looking along +x, turned to the left
Rigid looking(const Point3& place, double left)
{
    const double c = std::cos(left), s = std::sin(left);
    return {s, 0, c, place[0], -c, 0, s, place[1], 0, -1, 0, place[2], 0, 0, 0, 1};
}

// metres along the axis to the first voxel that a pixel sees; 0: none. By small steps through the volume
double ray_depth(const Voxels& v, const Rigid& camera, const Intrinsics& k, uint32_t x, uint32_t y)
{
    const double a = (x + 0.5 - k.cx) / k.fx, b = (y + 0.5 - k.cy) / k.fy;
    for (double t = 0.3; t < 60; t += 0.02)
        if (v.at(transform(camera, {a * t, b * t, t})))
            return t;
    return 0;
}

// share of the pixels in which something is or should be that show the depth which their rays have, to a voxel. Of
// every eighth pixel: splats are as wide as a pixel at least, which makes edges fat
double agreement(const Path& picture, const Voxels& v, const Rigid& camera, const Intrinsics& k)
{
    const auto depth = read_png_gray16(picture);
    EXPECT_TRUE(depth) << picture;
    if (!depth || depth->width != k.width || depth->height != k.height)
        return 0;
    size_t right = 0, asked = 0;
    for (uint32_t y = 0; y < k.height; y += 8)
        for (uint32_t x = 0; x < k.width; x += 8) {
            const double expected = ray_depth(v, camera, k, x, y), found = depth->pixels[y * k.width + x] / 1000.0;
            asked += expected > 0 || found > 0;
            right += expected > 0 && found > 0 && std::abs(found - expected) <= v.edge;
        }
    EXPECT_GT(asked, size_t(k.width) * k.height / 64 / 3) << "the test's own camera looks past the scene";
    return double(right) / double(asked);
}

void expect_agreement(const Path& picture, const Voxels& v, const Rigid& camera, const Intrinsics& k)
{
    EXPECT_GT(agreement(picture, v, camera, k), 0.8) << picture;                   // 0.82 to 0.9 were measured
    const Rigid elsewhere = {1, 0, 0, 0.5, 0, 1, 0, -0.5, 0, 0, 1, 1, 0, 0, 0, 1}; // to the right, up and ahead
    EXPECT_LT(agreement(picture, v, compose(camera, elsewhere), k), 0.5) << picture;
}

std::string row(const Rigid& m, size_t numbers)
{
    return fmt::format("{:.12g}\n", fmt::join(std::span(m).first(numbers), " "));
}

// 0.2 m voxels of SemanticKITTI: x forward, y left, z up from the lidar
Voxels kitti_volume()
{
    Voxels v({256, 256, 32}, 0.2, {0, -25.6, -2});
    build_street(v, -1.6, 40, 50);
    return v;
}
std::string label_bytes(const Voxels& v)
{
    std::string bytes;
    for (const uint8_t label : v.labels)
        bytes += {char(label), '\0'};
    return bytes;
}

const Rigid kTr = {0, -1, 0, 0.01, 0, 0, -1, -0.08, 1, 0, 0, -0.27, 0, 0, 0, 1}; // lidar to camera

// of a drive's first camera in the poses' world: the identity, but for errors
const Rigid kFirstPose = {0.8, 0, 0.6, 0.1, 0, 1, 0, 0.2, -0.6, 0, 0.8, 0.3, 0, 0, 0, 1};

// the cameras of a drive in the frame of its lidar at frame 0
std::vector<Rigid> lidar_drive()
{
    std::vector<Rigid> cameras;
    for (int i = 0; i < 3; ++i)
        cameras.push_back(looking({0.27 + 0.8 * i, 0.01 * i, -0.08}, 0.05 * i));
    cameras[0] = inverse(kTr);
    return cameras;
}

TEST(CliPathWorlds, semantickitti_with_the_poses_of_odometry)
{
    const ScratchFolder folder;
    for (const char* name : {"sequences/00/voxels", "poses"})
        fs::create_directories(folder / name);
    const Voxels volume = kitti_volume();
    const Path grid = folder.put("sequences/00/voxels/000000.label", label_bytes(volume));
    std::string poses;
    for (const Rigid& camera : lidar_drive()) // P_i = P_0 Tr C_i, and P_0 is no identity in every sequence
        poses += row(compose(kFirstPose, compose(kTr, camera)), 12);
    const Path path = folder.put("poses/00.txt", poses);
    const Path calib =
        folder.put("sequences/00/calib.txt", "P0: 240 0 191.5 0 0 240 127.5 0 0 0 1 0\nTr: " + row(kTr, 12));
    const std::string render =
        fmt::format("render {} --voxel-size 0.2 --path {} -W 384 -H 256 --semantic ", grid.string(), path.string());
    const ProgramResult result =
        semrover_program(render + "--calib " + calib.string() + " -o " + (folder / "frames").string());
    ASSERT_EQ(result.code, 0) << result.err;
    EXPECT_EQ(result.err.find("see nothing"), std::string::npos) << result.err;
    const Intrinsics k{240, 240, 192, 128, 384, 256};
    for (size_t i = 0; i < 3; ++i)
        expect_agreement(folder / fmt::format("frames/depth/00000{}.png", i), volume, lidar_drive()[i], k);

    // the volume of frame 1: its lidar is where Tr^-1 P_1 says
    const Rigid lidar = compose(lidar_drive()[1], kTr);
    ASSERT_EQ(
        semrover_program(render + "--relative-to 1 --calib " + calib.string() + " -o " + (folder / "one").string())
            .code,
        0);
    expect_agreement(folder / "one/depth/000001.png", volume, inverse(kTr), k);
    expect_agreement(folder / "one/depth/000002.png", volume, compose(inverse(lidar), lidar_drive()[2]), k);

    // and without: no frame sees anything, which is said and is an error
    const ProgramResult blind = semrover_program(render + "-o " + (folder / "blind").string());
    EXPECT_EQ(blind.code, 3);
    EXPECT_NE(blind.err.find("3 of 3 frames see nothing"), std::string::npos) << blind.err;
    EXPECT_NE(blind.err.find("it lies in x 0 to 36"), std::string::npos) << blind.err;
    const ProgramResult wanted = semrover_program(render + "--allow-empty -o " + (folder / "empty").string());
    EXPECT_EQ(wanted.code, 0);
    EXPECT_NE(wanted.err.find("warning: 3 of 3 frames see nothing"), std::string::npos) << wanted.err;
    const ProgramResult meet = semrover_program("inspect " + path.string() + " " + grid.string());
    EXPECT_EQ(meet.code, 0) << meet.err;
    EXPECT_NE(meet.out.find("--calib CALIB.TXT"), std::string::npos) << meet.out;
    const ProgramResult met =
        semrover_program("inspect --json " + grid.string() + " --path " + path.string() + " --calib " + calib.string());
    EXPECT_NE(met.out.find(R"("meet":"yes")"), std::string::npos) << met.out;
}

TEST(CliPathWorlds, kitti_360_with_its_calibration_as_the_world)
{
    const ScratchFolder folder;
    const Voxels volume = kitti_volume();
    const Path grid = folder.put("000250.label", label_bytes(volume));
    const Rigid map = looking({1000, 2000, 115}, 0.7); // of the first camera of the drive in the map's world
    std::string poses;
    for (size_t i = 0; i < 3; ++i)
        poses += fmt::format("{} {}", 250 + 5 * i, row(compose(map, compose(kTr, lidar_drive()[i])), 16));
    const Path path = folder.put("cam0_to_world.txt", "1 " + row(looking({990, 2000, 115}, 0), 16) + poses);
    const Path velo = folder.put("calib_cam_to_velo.txt", row(inverse(kTr), 12));
    const ProgramResult result = semrover_program(fmt::format(
        "render {} --voxel-size 0.2 --path {} --relative-to 250 --world {} -W 384 -H 256 --fov-x 77 --semantic -o {}",
        grid.string(), path.string(), velo.string(), (folder / "frames").string()));
    ASSERT_EQ(result.code, 0) << result.err;
    const Intrinsics k = pinhole_from_fov(77, 384, 256);
    for (size_t i = 0; i < 3; ++i) // frame 1 is the file's first
        expect_agreement(folder / fmt::format("frames/depth/00000{}.png", i + 1), volume, lidar_drive()[i], k);
}

std::string npy(const std::vector<uint8_t>& values, const char* shape)
{
    std::string header = fmt::format("{{'descr': '|u1', 'fortran_order': False, 'shape': {}, }}", shape);
    header += std::string(63 - (10 + header.size()) % 64, ' ') + "\n";
    std::string bytes = "\x93NUMPY\x01";
    bytes += {'\0', char(header.size() & 255), char(header.size() >> 8)};
    return bytes + header + std::string(values.begin(), values.end());
}

TEST(CliPathWorlds, occ3d_with_the_ego_poses_of_nuscenes_through_a_rig)
{
    const ScratchFolder folder;
    for (const char* name : {"gts/scene-0001/abc", "v1.0-mini"})
        fs::create_directories(folder / name);
    Voxels volume({200, 200, 16}, 0.4, {-40, -40, -1});
    build_street(volume, 0, 11, 15);
    std::vector<uint8_t> semantics = volume.labels;
    std::ranges::replace(semantics, uint8_t(0), uint8_t(17)); // free
    const std::vector<uint8_t> seen(semantics.size(), 1);
    const Path grid =
        folder.put("gts/scene-0001/abc/labels.npz", zip_bytes({{"semantics.npy", npy(semantics, "(200, 200, 16)")},
                                                               {"mask_lidar.npy", npy(seen, "(200, 200, 16)")},
                                                               {"mask_camera.npy", npy(seen, "(200, 200, 16)")}}));
    // vehicles in the map: yaw 0.4, then half a metre ahead and a little to the left each time; in no order
    const auto ego = [](int i) {
        const double yaw = 0.4 + 0.02 * i;
        return Rigid{std::cos(yaw),
                     -std::sin(yaw),
                     0,
                     600 + 0.5 * i,
                     std::sin(yaw),
                     std::cos(yaw),
                     0,
                     1647 + 0.2 * i,
                     0,
                     0,
                     1,
                     0,
                     0,
                     0,
                     0,
                     1};
    };
    std::string poses;
    for (const int i : {2, 0, 1}) {
        const Quaternion q = quaternion_of(ego(i));
        poses += fmt::format(
            "{}{{\"token\":\"t{}\",\"timestamp\":{},\"rotation\":[{},{},{},{}],\"translation\":[{},{},0]}}",
            poses.empty() ? "[" : ",", i, 1532402927600000 + 500000 * i, q[3], q[0], q[1], q[2], ego(i)[3], ego(i)[7]);
    }
    const Path path = folder.put("v1.0-mini/ego_pose.json", poses + "]");
    const Path rig =
        folder.put("rig.json", R"({"path_axes":"vehicle","sensors":[{"name":"front","width":384,"height":256,
        "fx":240,"fy":240,"cx":192,"cy":128,"sensor_to_vehicle":[0,0,1,1.7, -1,0,0,0.1, 0,-1,0,1.5, 0,0,0,1]}]})");
    const std::string render =
        fmt::format("render {} --voxel-size 0.2 --path {} --semantic ", grid.string(), path.string());
    const ProgramResult result = semrover_program(
        fmt::format("{}--relative-to 1 --rig {} -o {}", render, rig.string(), (folder / "frames").string()));
    ASSERT_EQ(result.code, 0) << result.err;
    EXPECT_EQ(result.err.find("read as a camera"), std::string::npos) << result.err; // the rig says where it sits
    const Rigid sensor = {0, 0, 1, 1.7, -1, 0, 0, 0.1, 0, -1, 0, 1.5, 0, 0, 0, 1};
    for (int i = 0; i < 3; ++i)
        expect_agreement(folder / fmt::format("frames/front/depth/00000{}.png", i), volume,
                         compose(compose(inverse(ego(1)), ego(i)), sensor), {240, 240, 192, 128, 384, 256});
    // without a rig: a camera at the vehicle's origin that looks forward, and that is said. The road is at its height
    const ProgramResult bare = semrover_program(fmt::format(
        "{}--relative-to 1 --origin 0,0,1.5 -W 384 -H 256 --fov-x 80 -o {}", render, (folder / "bare").string()));
    EXPECT_EQ(bare.code, 0) << bare.err; // note: a grid in another program's format takes --origin for itself
    EXPECT_NE(bare.err.find("poses of a vehicle (x forward, y left, z up), read as a camera"), std::string::npos);
    ASSERT_EQ(semrover_program(fmt::format("{}--relative-to 1 --path-origin 0,0,1.5 -W 384 -H 256 --fov-x 80 -o {}",
                                           render, (folder / "bare").string() + " -y"))
                  .code,
              0);
    expect_agreement(folder / "bare/depth/000001.png", volume, looking({0, 0, 1.5}, 0), pinhole_from_fov(80, 384, 256));
}

TEST(CliPathWorlds, a_drive_in_utm_comes_by_its_origin)
{
    const ScratchFolder folder;
    const std::string grid = SEMROVER_SOURCE_DIR "/assets/scenes/street.semantic.sgrid";
    const Path local = folder.put("local.tum", "0 1 0 1.7 -0.5 0.5 -0.5 0.5\n"),
               utm = folder.put("utm.tum", "0 458075 5429380 164.7 -0.5 0.5 -0.5 0.5\n");
    const std::string lens = " -W 64 -H 48 --fov-x 60 ";
    const auto render = [&](const Path& path, const char* out, const std::string& more) {
        return semrover_program("render " + grid + " --semantic --path " + path.string() + lens + more + " -o " +
                                (folder / out).string());
    };
    const ProgramResult blind = render(utm, "blind", "");
    EXPECT_EQ(blind.code, 3);
    EXPECT_NE(blind.err.find("cameras in x 458075 to 458075, y 5429380 to 5429380, z 164.7 to 164.7 m"),
              std::string::npos)
        << blind.err;
    EXPECT_NE(semrover_program("inspect " + utm.string() + " " + grid).out.find("--path-origin=-458075,-5429380,-165"),
              std::string::npos);
    ASSERT_EQ(render(local, "a", "").code, 0);
    ASSERT_EQ(render(utm, "b", "--origin=-458074,-5429380,-163").code, 0);
    ASSERT_EQ(render(utm, "c", "--world=1,0,0,-458074,0,1,0,-5429380,0,0,1,-163").code, 0);
    const Path matrix = folder.put("world.json", "[[1,0,0,-458074],[0,1,0,-5429380],[0,0,1,-163],[0,0,0,1]]");
    ASSERT_EQ(render(utm, "d", "--world " + matrix.string()).code, 0);
    for (const char* out : {"b", "c", "d"})
        EXPECT_EQ(contents(folder / out / "depth/000000.png"), contents(folder / "a/depth/000000.png")) << out;
    // the same options of a path alone
    const Path out = folder / "moved.tum";
    ASSERT_EQ(semrover_program("convert " + utm.string() + " " + out.string() + " --origin=-458074,-5429380,-163").code,
              0);
    const auto moved = read_tum(out, pinhole_from_fov(60, 8, 8));
    ASSERT_TRUE(moved);
    const Point3 place = translation_of(moved->frames[0].pose.camera_to_world());
    for (size_t axis = 0; axis < 3; ++axis)
        EXPECT_NEAR(place[axis], (Point3{1, 0, 1.7})[axis], 1e-9);
    expect_error(render(utm, "x", "--world 2,0,0,0,0,2,0,0,0,0,2,0"), 3, "expected a rotation without scale or mirror");
    expect_error(render(utm, "x", "--world 1,0,0,0"), 3, "expected a 4x4 or 3x4 matrix, found 4 numbers");
    expect_error(render(utm, "x", "--relative-to 1"), 3,
                 "no frame 1, expected one of 1 frames, counted from 0: 0 to 0");
    expect_error(render(utm, "x", "--relative-to last"), 2, "--relative-to takes first or the number of a frame");
}

TEST(CliPathWorlds, every_command_that_reads_a_path_takes_the_same_options)
{
    for (const char* command :
         {"render", "refine", "convert", "generate", "inspect", "page", "fuse", "eval surface", "eval flicker"}) {
        const ProgramResult help = semrover_program(std::string(command) + " --help");
        EXPECT_EQ(help.code, 0);
        for (const char* option : {"--relative-to", "--calib", "--world", "--path-origin", "--origin"})
            EXPECT_NE(help.out.find(option), std::string::npos) << command << " " << option;
    }
    expect_error(semrover_program("inspect " SEMROVER_SOURCE_DIR "/assets/scenes/street.semantic.sgrid --fov-x 60"), 2,
                 "--fov-x has no meaning for a file that is no trajectory");
    expect_error(semrover_program("render x.sgrid --top -o x --relative-to first"), 2, "are of a trajectory: --path");
}

} // namespace cli_path_worlds_test
} // namespace semrover
