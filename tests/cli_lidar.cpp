// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
#include "engine/camera/rigid.h"
#include "engine/format/npy.h"
#include "engine/scene/scene_points.h"
#include "runtime/base/json.h"
#include "tests/support/json_text.h"
#include "tests/support/program.h"
#include "tests/support/scratch_folder.h"

#include <cmath>

namespace semrover {
namespace cli_lidar_test {

using Json = nlohmann::json;

const std::string kGrid = SEMROVER_SOURCE_DIR "/assets/scenes/street.truth.sgrid";

// two poses a tenth of a second apart, and a lidar that is quick to draw
struct Drive {
    ScratchFolder folder;

    Drive()
    {
        folder.put("d.tum", "0 8 0 1.7 -0.5 0.5 -0.5 0.5\n0.1 9.5 0.1 1.7 -0.5 0.5 -0.5 0.5\n");
        folder.put("l.json", R"({"columns":360,"rate":10,"range":[0.5,80],"elevations":[8,2,-1,-5,-12],)"
                             R"("azimuths":[0,3,-3,1,0],"times":[0,100,5,7,200],"every":[1,1,2,1,1]})");
        put_rig("");
    }
    void put_rig(const std::string& camera) const
    {
        folder.put("rig.json", R"({"sensors":[)" + camera +
                                   R"({"name":"top","lidar":"l.json","sensor_to_vehicle":{"translation":[0,0,0.3],)"
                                   R"("rotation":[0,0,0.1,0.995]}}]})");
    }
    ProgramResult render(const std::string& out, const std::string& more = "") const
    {
        return semrover_program("render " + kGrid + " --path " + (folder / "d.tum").string() + " --rig " +
                                (folder / "rig.json").string() + " --splat-radius auto -o " + (folder / out).string() +
                                " " + more);
    }
};

TEST(cli_lidar, sweeps_become_files_whose_bytes_depend_on_nothing_else)
{
    const Drive drive;
    ASSERT_EQ(drive.render("a", "--threads 1").code, 0);
    ASSERT_EQ(drive.render("b", "--threads 3").code, 0);
    for (const char* name : {"top/points/000000.npy", "top/points/000001.npy", "top/sweeps.json"}) {
        EXPECT_GT(contents(drive.folder / "a" / name).size(), 100u);
        EXPECT_EQ(contents(drive.folder / "a" / name), contents(drive.folder / "b" / name)) << name;
    }
    // what is missing is drawn again, to the same bytes
    std::filesystem::remove(drive.folder / "b" / "top" / "points" / "000001.npy");
    const ProgramResult again = drive.render("b", "--json");
    ASSERT_EQ(again.code, 0) << again.err;
    EXPECT_EQ(Json::parse(again.out).at("sweeps"), 2);
    EXPECT_EQ(contents(drive.folder / "a" / "top/points/000001.npy"),
              contents(drive.folder / "b" / "top/points/000001.npy"));
    // another format replaces what was there
    ASSERT_EQ(drive.render("b", "--lidar-format pcd -y").code, 0);
    EXPECT_FALSE(std::filesystem::exists(drive.folder / "b" / "top/points/000000.npy"));
    EXPECT_TRUE(contents(drive.folder / "b" / "top/points/000000.pcd").starts_with("# .PCD v0.7"));
}

TEST(cli_lidar, points_lie_on_the_scene_by_the_poses_beside_them)
{
    const Drive drive;
    ASSERT_EQ(drive.render("a").code, 0);
    const Json sweep = json_of(contents(drive.folder / "a" / "top/sweeps.json")).at("sweeps").at(1);
    EXPECT_EQ(sweep.at("time"), 100000);
    EXPECT_EQ(sweep.at("duration"), 100000);
    std::vector<double> numbers;
    for (const Json& row : sweep.at("end"))
        for (const double v : row)
            numbers.push_back(v);
    const Rigid end = rigid_from_matrix(numbers, "end").value();
    EXPECT_NEAR(translation_of(end)[0], 9.5, 1e-9);
    EXPECT_NEAR(translation_of(end)[2], 2.0, 1e-9);
    const std::string bytes = contents(drive.folder / "a" / "top/points/000001.npy");
    const NpyHeader header = parse_npy_header(bytes, "points").value();
    const auto* floats = reinterpret_cast<const float*>(bytes.data() + header.bytes);
    const ScenePoints scene = points_of(read_grid(kGrid).value());
    const auto away_from_scene = [&](const Point3& at) {
        double nearest = 1e9;
        for (const auto& p : scene.positions)
            nearest = std::min(nearest, std::hypot(p[0] - at[0], p[1] - at[1], p[2] - at[2]));
        return nearest;
    };
    size_t on_scene = 0, road = 0, flat = 0;
    for (size_t i = 0; i < header.shape[0]; ++i) {
        const float* p = floats + 8 * i;
        const Point3 at = transform(end, {p[0], p[1], p[2]});
        on_scene += away_from_scene(at) < 0.25; // points lie some 0.1 m apart
        road += std::abs(at[2]) < 0.03;         // the street is level there
        flat += std::abs(at[2]) < 0.01;
    }
    fmt::print("{} returns, {} on the scene, {} on the road, {} within 1 cm\n", header.shape[0], on_scene, road, flat);
    EXPECT_GT(header.shape[0], 300u);
    EXPECT_GE(on_scene, header.shape[0] * 95 / 100);
    EXPECT_GT(road, 25u);
    EXPECT_GE(flat, road * 9 / 10);
}

TEST(cli_lidar, a_rig_of_lidars_alone_has_no_pictures_and_one_of_both_has)
{
    const Drive drive;
    expect_error(drive.render("a", "--video " + (drive.folder / "v.mp4").string()), 2, "--video needs cameras");
    expect_error(semrover_program("convert " + (drive.folder / "d.tum").string() + " " +
                                  (drive.folder / "t.json").string() + " --rig " +
                                  (drive.folder / "rig.json").string()),
                 2, "convert needs cameras");
    drive.put_rig(
        R"({"name":"front","width":64,"height":48,"fov":90,"sensor_to_vehicle":{"rotation":[-0.5,0.5,-0.5,0.5]}},)");
    const ProgramResult both = drive.render("b", "--json");
    ASSERT_EQ(both.code, 0) << both.err;
    EXPECT_EQ(Json::parse(both.out).at("frames"), 2);
    EXPECT_EQ(Json::parse(both.out).at("sweeps"), 2);
    EXPECT_TRUE(std::filesystem::exists(drive.folder / "b" / "front/color/000001.png"));
    EXPECT_TRUE(std::filesystem::exists(drive.folder / "b" / "top/points/000001.npy"));
    EXPECT_FALSE(std::filesystem::exists(drive.folder / "b" / "top/color"));
}

} // namespace cli_lidar_test
} // namespace semrover
