// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
#include "engine/conditioning/cell_objects.h"
#include "engine/format/image.h"
#include "engine/mesh/mesh_files.h"
#include "engine/scene/actors.h"
#include "runtime/base/json.h"
#include "tests/support/json_text.h"
#include "tests/support/program.h"
#include "tools/trajectory/camera_path.h"

#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <numeric>

namespace semrover {
namespace cli_streets_test {

namespace fs = std::filesystem;

ProgramResult streets(const Path& out, const std::string& more)
{
    return semrover_program("streets -q --length 40 --spacing 100 -o " + out.string() + " " + more);
}

TEST(CliStreets, a_street_comes_with_mesh_grids_drive_and_pictures_that_agree)
{
    const ScratchFolder folder;
    const Path out = folder / "street";
    const ProgramResult result = streets(out, "--seed 5 --images --samples 1 --ambient-rays 1 -W 48 -H 32 --json");
    ASSERT_EQ(result.code, 0) << result.err;
    EXPECT_EQ(folder.entries(), 1u); // nothing temporary
    const Json about = json_of(result.out);
    EXPECT_EQ(about["seed"], 5);
    EXPECT_EQ(about["frames"], 1);
    EXPECT_EQ(about["classes"]["sky"]["faces"], 0);
    EXPECT_GT(about["classes"]["building"]["faces"], 1000);
    EXPECT_GT(about["objects"]["building"], 3);
    EXPECT_EQ(json_of(contents(out / "street.json")), about);
    EXPECT_GT(fs::file_size(out / "mesh.glb"), 1000000u);
    const auto semantic = read_grid(out / "semantic.sgrid"), truth = read_grid(out / "truth.sgrid");
    ASSERT_TRUE(semantic && truth);
    EXPECT_EQ(semantic->cells, truth->cells);
    EXPECT_EQ(semantic->labels, truth->labels);
    EXPECT_FALSE(semantic->has_points());
    EXPECT_EQ(truth->points.size(), truth->cells.size() * 60);
    EXPECT_GT(std::ranges::count(truth->labels, 19), 10); // thin lines are not lost
    const auto objects = read_objects(out / "objects.json");
    ASSERT_TRUE(objects) << objects.error().message;
    const std::vector<int32_t> owners = *objects_of_cells(*truth, *objects);
    size_t cars = 0, owned = 0;
    for (size_t v = 0; v < owners.size(); ++v)
        if (truth->labels[v] == 13) {
            ++cars;
            owned += owners[v] != kNoObject;
            EXPECT_TRUE(owners[v] == kNoObject || (*objects)[size_t(owners[v])].tint);
        }
    EXPECT_GT(cars, 50u);
    EXPECT_EQ(owned, cars);
    const auto path = read_transforms(out / "transforms.json"),
               tum = read_tum(out / "drive.tum", pinhole_from_fov(73, 48, 32));
    ASSERT_TRUE(path) << path.error().message;
    ASSERT_TRUE(tum) << tum.error().message;
    EXPECT_EQ(path->frames[0].intrinsics.width, 48u);
    for (const char* drive : {"", "shifted"}) {
        const Path at = out / drive;
        ASSERT_TRUE(read_transforms(at / "transforms.json"));
        const auto color = read_png_rgb8(at / "color/000000.png");
        const auto depth = read_png_gray16(at / "depth/000000.png");
        const auto label = read_png_rgb8(at / "label/000000.png"), visible = read_png_rgb8(at / "visible/000000.png");
        const auto instance = read_png_gray16(at / "instance/000000.png");
        ASSERT_TRUE(color && depth && label && visible && instance && read_png_rgb8(at / "normal/000000.png"));
        EXPECT_EQ(color->width, 48u);
        size_t road = 0, things = 0;
        for (size_t i = 0; i < depth->pixels.size(); ++i) {
            EXPECT_EQ(visible->pixels[3 * i] == 0, label->pixels[3 * i] == 10);
            EXPECT_TRUE(visible->pixels[3 * i] || depth->pixels[i] == 0);
            if (const uint16_t thing = instance->pixels[i]) {
                EXPECT_EQ((*objects)[thing - 1u].label, label->pixels[3 * i]);
                ++things;
            }
            road += label->pixels[3 * i] == 0;
        }
        EXPECT_GT(road, 100u);
        EXPECT_GT(things, depth->pixels.size() / 2);
    }
}

// A pixel's point lies in the box of the thing that the picture of instances names, where the thing is at the time.
TEST(CliStreets, pictures_show_traffic_where_actors_json_has_it)
{
    const ScratchFolder folder;
    const std::string common = "--seed 1 --length 90 --spacing 10 --images --samples 1 --ambient-rays 1 -W 160 -H 110 ";
    const Path out = folder / "street";
    const ProgramResult made =
        semrover_program("streets -q -o " + out.string() + " " + common + "--no-grids --traffic");
    ASSERT_EQ(made.code, 0) << made.err;
    const auto actors = read_actors(out / "actors.json");
    const auto objects = read_objects(out / "objects.json");
    const auto path = read_transforms(out / "transforms.json");
    ASSERT_TRUE(actors && objects && path);
    size_t moving = 0, standing = 0;
    for (size_t i = 0; i < path->frames.size(); ++i) {
        const std::string name = fmt::format("{:06}.png", i);
        const auto depth = read_png_gray16(out / "depth" / name), instance = read_png_gray16(out / "instance" / name);
        ASSERT_TRUE(depth && instance);
        const CameraFrame& frame = path->frames[i];
        const Intrinsics& k = frame.intrinsics;
        for (size_t p = 0; p < depth->pixels.size(); ++p) {
            if (instance->pixels[p] == 0 || depth->pixels[p] == 0)
                continue;
            const double z = depth->pixels[p] * 1e-3;
            const Point3 seen =
                transform(frame.pose.camera_to_world(), {(double(p % k.width) + 0.5 - k.cx) / k.fx * z,
                                                         (double(p / k.width) + 0.5 - k.cy) / k.fy * z, z});
            const SceneObject& object = (*objects)[instance->pixels[p] - 1u];
            const auto actor = std::ranges::find(*actors, object.id, &Actor::id);
            const bool moves = actor != actors->end();
            if (!moves && object.label != 13 && object.label != 9) // of houses and trees parts stand out
                continue;
            const auto pose = moves ? pose_at(*actor, std::llround(frame.time * 1e6)) : box_to_world(object);
            ASSERT_TRUE(pose);
            const Point3 at = transform(inverse(*pose), seen);
            for (size_t a = 0; a < 3; ++a)
                ASSERT_LE(std::abs(at[a]), object.size[a] / 2 + 0.01) << "frame " << i << " pixel " << p;
            ++(moves ? moving : standing);
        }
    }
    EXPECT_GT(moving, 100u);
    EXPECT_GT(standing, 1000u);
}

// A house that is plaster towards the street and brick behind is told as plaster, where nothing behind is in the grid.
TEST(CliStreets, objects_have_the_colours_of_what_is_seen)
{
    const ScratchFolder folder;
    const ProgramResult result = streets(folder / "street", "--seed 5 --seen");
    ASSERT_EQ(result.code, 0) << result.err;
    const auto objects = read_objects(folder / "street/objects.json");
    const auto truth = read_grid(folder / "street/truth.sgrid");
    ASSERT_TRUE(objects && truth);
    std::vector<SceneObject> seen = *objects;
    for (SceneObject& object : seen)
        object.tint.reset();
    ASSERT_TRUE(tint_objects(seen, *truth));
    size_t tinted = 0;
    for (size_t o = 0; o < seen.size(); ++o) {
        ASSERT_EQ(bool(seen[o].tint), bool((*objects)[o].tint)) << o;
        for (size_t c = 0; seen[o].tint && c < 3; ++c)
            EXPECT_NEAR((*seen[o].tint)[c], (*(*objects)[o].tint)[c], 0.001) << o;
        tinted += bool(seen[o].tint);
    }
    EXPECT_GT(tinted, 10u);
    EXPECT_LT(tinted, seen.size()); // some things are out of sight
}

double mean_level(const Path& picture)
{
    const auto image = read_png_rgb8(picture);
    EXPECT_TRUE(image);
    return image ? std::accumulate(image->pixels.begin(), image->pixels.end(), 0.0) / double(image->pixels.size()) : 0;
}

TEST(CliStreets, the_sun_stands_where_it_is_asked_to)
{
    const ScratchFolder folder;
    const std::string common = "--seed 5 --no-grids --images --samples 1 --ambient-rays 1 -W 48 -H 32 --sun-elevation ";
    const std::vector<std::string> skies = {"60 --sun-azimuth 180", "4 --sun-azimuth 180", "60 --sun-azimuth 0",
                                            "60 --sun-azimuth 180 --clouds 1"};
    std::vector<double> levels;
    for (const std::string& sky : skies) {
        const Path out = folder / std::to_string(levels.size());
        const ProgramResult result = streets(out, common + sky);
        ASSERT_EQ(result.code, 0) << result.err;
        levels.push_back(mean_level(out / "color/000000.png"));
    }
    EXPECT_GT(levels[0], levels[1] * 1.1);  // a low sun is weak and throws shade on the road
    EXPECT_GT(levels[0], levels[2] * 1.01); // from behind it lights what the camera sees
    EXPECT_NE(levels[0], levels[3]);
    EXPECT_EQ(streets(folder / "x", "--sun-elevation 95").code, 2);
    EXPECT_EQ(streets(folder / "x", "--clouds 1.5").code, 2);
}

TEST(CliStreets, cells_may_be_so_large_that_no_lane_wins_one)
{
    const ScratchFolder folder;
    const ProgramResult made = streets(folder / "x", "--voxel-size 2");
    EXPECT_EQ(made.code, 0) << made.err;
    EXPECT_TRUE(fs::exists(folder / "x/semantic.sgrid"));
}

TEST(CliStreets, a_drive_that_cannot_be_is_refused)
{
    const ScratchFolder folder;
    expect_error(semrover_program("streets --length 50 --first 51 -o " + (folder / "x").string()), 2,
                 "--first: 51 m is behind the end of the street, which is 50 m long");
    expect_error(semrover_program("streets --length 20000 --spacing 0.01 -o " + (folder / "x").string()), 2,
                 "--spacing: 0.01 m makes 1999400 frames of this street, at most 100000 are possible");
}

TEST(CliStreets, the_same_seed_gives_the_same_files)
{
    const ScratchFolder folder;
    for (const char* name : {"a", "b"})
        ASSERT_EQ(streets(folder / name, "--seed 2").code, 0);
    for (const char* file :
         {"mesh.glb", "truth.sgrid", "semantic.sgrid", "drive.tum", "transforms.json", "street.json", "objects.json"})
        EXPECT_TRUE(contents(folder / "a" / file) == contents(folder / "b" / file)) << file;
}

TEST(CliStreets, traffic_changes_neither_grids_nor_what_stands)
{
    const ScratchFolder folder;
    ASSERT_EQ(streets(folder / "a", "--seed 2").code, 0);
    ASSERT_EQ(streets(folder / "b", "--seed 2 --traffic").code, 0);
    for (const char* file : {"mesh.glb", "truth.sgrid", "semantic.sgrid", "drive.tum", "objects.json"})
        EXPECT_TRUE(contents(folder / "a" / file) == contents(folder / "b" / file)) << file;
    EXPECT_FALSE(fs::exists(folder / "a/actors.json"));
    const auto actors = read_actors(folder / "b/actors.json");
    ASSERT_TRUE(actors) << actors.error().message;
    EXPECT_EQ(json_of(contents(folder / "b/street.json"))["actors"], actors->size());
    expect_error(
        semrover_program("streets --length 20000 --spacing 10 --no-grids --traffic -o " + (folder / "x").string()), 2,
        "--traffic: what moves in this street has");
}

TEST(CliStreets, what_exists_is_replaced_only_when_asked_and_other_files_stay)
{
    const ScratchFolder folder;
    const Path out = folder / "street";
    fs::create_directory(out);
    folder.put("street/notes.txt", "mine");
    const ProgramResult refused = streets(out, "--no-grids");
    EXPECT_EQ(refused.code, 2);
    EXPECT_NE(refused.err.find("-y replaces"), std::string::npos) << refused.err;
    EXPECT_FALSE(fs::exists(out / "mesh.glb"));
    ASSERT_EQ(streets(out, "--no-grids -y").code, 0);
    EXPECT_TRUE(fs::exists(out / "mesh.glb"));
    EXPECT_FALSE(fs::exists(out / "truth.sgrid"));
    EXPECT_EQ(contents(out / "notes.txt"), "mine");
    EXPECT_EQ(folder.entries(), 1u);
}

TEST(CliStreets, what_cannot_be_is_refused_and_leaves_nothing)
{
    const ScratchFolder folder;
    EXPECT_EQ(streets(folder / "x", "--voxel-size 0").code, 2);
    EXPECT_EQ(semrover_program("streets --length 5 -o " + (folder / "x").string()).code, 2);
    EXPECT_EQ(semrover_program("streets").code, 2);
    const ProgramResult missing = streets(folder / "no/such/folder", "");
    EXPECT_EQ(missing.code, 3);
    EXPECT_NE(missing.err.find("cannot create a folder in"), std::string::npos) << missing.err;
    const ProgramResult file = streets(folder.put("file", "x"), "-y");
    EXPECT_EQ(file.code, 3);
    EXPECT_NE(file.err.find("is a file"), std::string::npos) << file.err;
    EXPECT_EQ(folder.entries(), 1u);
}

} // namespace cli_streets_test
} // namespace semrover
