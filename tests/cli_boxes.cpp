// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
// render --boxes, and what lies beside a drive's pictures
#include "engine/annotation/box_lines.h"
#include "engine/conditioning/scene_objects.h"
#include "engine/format/image.h"
#include "runtime/base/json.h"
#include "tests/support/json_text.h"
#include "tests/support/nuscenes_schema.h"
#include "tests/support/program.h"
#include "tests/support/renderer_folders.h"

#include <algorithm>
#include <gtest/gtest.h>
#include <set>

namespace semrover {
namespace cli_boxes_test {

namespace fs = std::filesystem;

ProgramResult run(const std::string& arguments)
{
    ProgramResult result = semrover_program(arguments);
    EXPECT_EQ(result.code, 0) << arguments << "\n" << result.err;
    return result;
}

// two cameras through a street whose objects are guessed
class Boxes : public testing::Test {
  protected:
    Boxes()
    {
        folder_.put("rig.json", R"({"sensors":[
            {"name":"front","width":160,"height":96,"fov":90,
             "sensor_to_vehicle":{"translation":[0.3,0,0],"rotation":[-0.5,0.5,-0.5,0.5]}},
            {"name":"wide","model":"fisheye","width":128,"height":128,"fov":190,
             "sensor_to_vehicle":{"translation":[0,0,0.1],"rotation":[-0.5,0.5,-0.5,0.5]}}]})");
        folder_.put("path.tum",
                    "0 2 0 1.6 -0.5 0.5 -0.5 0.5\n0.5 3 0 1.6 -0.5 0.5 -0.5 0.5\n1 4 0 1.6 -0.5 0.5 -0.5 0.5\n");
        const std::string scene = SEMROVER_SOURCE_DIR "/assets/scenes/street.truth.sgrid";
        run(fmt::format("convert -q {} {} -m " SEMROVER_SOURCE_DIR "/assets/model", scene, at("guessed.objects.json")));
        render_ = fmt::format("render -q {} --path {} --rig {} --splat-radius auto --objects {} --boxes -o ", scene,
                              at("path.tum"), at("rig.json"), at("guessed.objects.json"));
    }
    std::string at(std::string_view name) const { return (folder_ / name).string(); }

    ScratchFolder folder_;
    std::string render_;
};

uint64_t visible_pixels(const Path& boxes)
{
    const auto lines = read_box_lines(boxes);
    EXPECT_TRUE(lines) << lines.error().message;
    uint64_t pixels = 0;
    for (const SeenPicture& line : *lines)
        for (const SeenObject& object : line.objects)
            pixels += object.pixels;
    return pixels;
}

TEST_F(Boxes, are_smaller_with_less_of_the_screen_filter)
{
    run(render_ + at("default"));
    run(render_ + at("default") + " --screen-filter 0.5"); // it is the default: the same drawing
    EXPECT_EQ(semrover_program(render_ + at("default") + " --screen-filter 0.05").code, 2);
    run(render_ + at("sharp") + " --screen-filter 0.05");
    EXPECT_LT(visible_pixels(folder_ / "sharp/boxes.jsonl"), visible_pixels(folder_ / "default/boxes.jsonl"));
}

TEST_F(Boxes, are_those_of_the_visible_pixels_of_instance_pictures)
{
    run(render_ + at("drive"));
    const auto lines = read_box_lines(folder_ / "drive/boxes.jsonl");
    ASSERT_TRUE(lines) << lines.error().message;
    ASSERT_EQ(lines->size(), 6u);
    EXPECT_EQ((*lines)[3].picture.camera, "wide");
    EXPECT_EQ((*lines)[3].picture.number, 1u);
    EXPECT_EQ((*lines)[3].picture.time, 500000);
    std::set<uint32_t> ids;
    const auto objects = read_objects(folder_ / "drive/objects.json");
    ASSERT_TRUE(objects);
    for (const SceneObject& o : *objects)
        ids.insert(o.id);
    size_t seen = 0;
    for (const SeenPicture& line : *lines) {
        const Path camera = folder_ / "drive" / line.picture.camera;
        const auto picture = read_png_gray16(camera / fmt::format("instance/{:06}.png", line.picture.number));
        const auto visible = read_png_rgb8(camera / fmt::format("visible/{:06}.png", line.picture.number));
        ASSERT_TRUE(picture && visible);
        std::map<uint32_t, std::pair<PictureBox, uint32_t>> found; // by id
        for (uint32_t y = 0; y < picture->height; ++y)
            for (uint32_t x = 0; x < picture->width; ++x) {
                const size_t i = size_t(y) * picture->width + x;
                if (const uint16_t number = visible->pixels[3 * i] ? picture->pixels[i] : 0) {
                    const PictureBox pixel{double(x), double(y), x + 1.0, y + 1.0};
                    auto& [box, count] = found.try_emplace(number - 1u, pixel, 0).first->second;
                    box = {std::min(box.left, pixel.left), std::min(box.top, pixel.top),
                           std::max(box.right, pixel.right), std::max(box.bottom, pixel.bottom)};
                    ++count;
                }
            }
        ASSERT_EQ(line.objects.size(), found.size());
        for (const SeenObject& o : line.objects) {
            EXPECT_TRUE(ids.contains(o.id));
            EXPECT_EQ(o.visible, found[o.id].first);
            EXPECT_EQ(o.pixels, found[o.id].second);
            EXPECT_LE(o.amodal.left, o.amodal.right);
            ++seen;
        }
    }
    EXPECT_GT(seen, 40u);
}

TEST_F(Boxes, are_the_same_after_pictures_were_lost_and_drawn_again)
{
    run(render_ + at("drive"));
    const std::string before = contents(folder_ / "drive/boxes.jsonl");
    fs::remove(folder_ / "drive/wide/color/000001.png");
    fs::remove(folder_ / "drive/boxes.jsonl");
    run(render_ + at("drive"));
    EXPECT_EQ(contents(folder_ / "drive/boxes.jsonl"), before);
    fs::remove(folder_ / "drive/boxes.jsonl");
    run(render_ + at("drive")); // draws nothing
    EXPECT_EQ(contents(folder_ / "drive/boxes.jsonl"), before);
    // a folder with objects of its own is left alone
    fs::create_directories(folder_ / "scene");
    folder_.put("scene/objects.json", "{}");
    expect_error(semrover_program(render_ + at("scene")), 2, "objects.json' exists; -y");
    EXPECT_EQ(contents(folder_ / "scene/objects.json"), "{}");
}

TEST_F(Boxes, go_with_a_drive_into_a_shard_set_and_other_layouts)
{
    run(render_ + at("drive"));
    run("dataset pack -q " + at("drive") + " -o " + at("set"));
    run("dataset export -q " + at("drive") + " --to kitti -o " + at("kitti_of_folder"));
    run("dataset export -q " + at("set") + " --to kitti -o " + at("kitti_of_set"));
    EXPECT_EQ(contents(folder_ / "kitti_of_folder/training/label_2/000002.txt"),
              contents(folder_ / "kitti_of_set/training/label_2/000002.txt"));
    expect_error(semrover_program("dataset export " + at("set") + " --to nuscenes -o " + at("nu")), 3,
                 "camera 'wide' has the lens fisheye");
    EXPECT_FALSE(fs::exists(folder_ / "nu"));
    expect_error(semrover_program("dataset export " + at("set") + " " + at("set") + " --to colmap -o " + at("co")), 2,
                 "--to colmap is of one drive");
    folder_.put("one.json", R"({"sensors":[{"name":"front","width":160,"height":96,"fov":90,
        "sensor_to_vehicle":{"translation":[0.3,0,0],"rotation":[-0.5,0.5,-0.5,0.5]}}]})");
    std::string front = render_;
    front.replace(front.find("rig.json"), 8, "one.json");
    run(front + at("front"));
    const Json report = json_of(run("dataset export --json " + at("front") + " --to nuscenes -o " + at("nu")).out);
    EXPECT_EQ(report["pictures"], 3);
    EXPECT_EQ(NuscenesSchema::faults(folder_ / "nu", "v1.0-trainval"), std::vector<std::string>());
}

TEST_F(Boxes, go_with_refined_frames)
{
    put_renderer_model(folder_ / "model");
    run(render_ + at("drive"));
    const std::string boxes = contents(folder_ / "drive/boxes.jsonl");
    const std::string calibration = contents(folder_ / "drive/calibration.json");
    run(fmt::format("refine -q {} -m {} --steps 2 -o {}", at("drive"), at("model"), at("refined")));
    EXPECT_EQ(contents(folder_ / "refined/boxes.jsonl"), boxes);
    EXPECT_EQ(contents(folder_ / "refined/calibration.json"), calibration);
    std::string refine = render_;
    refine.replace(0, 9, fmt::format("refine -q -m {} --steps 2 ", at("model")));
    run(refine + at("at_once"));
    EXPECT_EQ(contents(folder_ / "at_once/timestamps.jsonl"), contents(folder_ / "drive/timestamps.jsonl"));
    EXPECT_EQ(read_box_lines(folder_ / "at_once/boxes.jsonl")->size(), 6u);
    run("dataset export -q " + at("at_once") + " --to kitti -o " + at("kitti")); // takes the frames
    EXPECT_TRUE(fs::exists(folder_ / "kitti/training/image_2/000002.png"));
}

} // namespace cli_boxes_test
} // namespace semrover
