// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
#include "engine/conditioning/scene_objects.h"
#include "tests/support/json_text.h"
#include "tests/support/program.h"

#include "runtime/base/json.h"

namespace semrover {
namespace cli_object_boxes_test {

const std::string kLabels = "Car 0 0 0 1 2 3 4 1.6 1.8 4.2 -2.5 1.7 20 -1.5707963\n"
                            "DontCare -1 -1 -10 5 6 7 8 -1 -1 -1 -1000 -1000 -1000 -10\n";
const std::string kCarla = R"([{"type_id": "vehicle.audi.tt", "color": "0,255,51", "location": [10, 3, 0.8],
    "extent": [2.2, 0.9, 0.75], "rotation": [0, 90, 0]}])";

class CliObjectBoxes : public testing::Test {
  protected:
    ProgramResult convert(const std::string& in, const std::string& text, const std::string& more = "",
                          const std::string& out = "out.json") const
    {
        return semrover_program("convert " + folder_.put(in, text).string() + " " + path(out) + " " + more);
    }
    std::vector<SceneObject> made() const
    {
        const auto objects = read_objects(path("out.json"));
        EXPECT_TRUE(objects) << objects.error().message;
        return objects.value_or(std::vector<SceneObject>());
    }
    std::string path(const std::string& name) const { return (folder_ / name).string(); }

    ScratchFolder folder_;
};

TEST_F(CliObjectBoxes, labels_of_kitti_become_a_file_of_objects)
{
    const ProgramResult result = convert("000007.txt", kLabels, "--json --origin 100,0,1.73");
    ASSERT_EQ(result.code, 0) << result.err;
    const auto json = json_of(result.out);
    EXPECT_EQ(json["from"], "kitti-boxes");
    EXPECT_EQ(json["objects"], 1);
    EXPECT_EQ(json["classes"]["car"], 1);
    EXPECT_EQ(json["dropped"], 1);
    ASSERT_EQ(made().size(), 1u);
    EXPECT_EQ(made()[0].center, (std::array<double, 3>{120, 2.5, 0.83}));
    EXPECT_EQ(made()[0].size, (std::array<double, 3>{4.2, 1.8, 1.6}));
    EXPECT_EQ(made()[0].heading, 0);
    expect_error(convert("000007.txt", kLabels), 2, "out.json' exists; -y replaces it");
    const ProgramResult again = convert("000007.txt", kLabels, "-y");
    EXPECT_EQ(again.code, 0);
    EXPECT_EQ(again.out, "kitti-boxes to objects: 1 objects, 1 left out\n");
    EXPECT_NE(again.err.find("warning: 1 objects of label 8 (DontCare) are left out"), std::string::npos);
    EXPECT_EQ(made()[0].center, (std::array<double, 3>{20, 2.5, -0.9}));
}

TEST_F(CliObjectBoxes, carla_needs_a_word_because_its_files_are_our_own)
{
    const ProgramResult result = convert("boxes.json", kCarla, "--from carla-boxes");
    ASSERT_EQ(result.code, 0) << result.err;
    ASSERT_EQ(made().size(), 1u);
    EXPECT_EQ(made()[0].center, (std::array<double, 3>{10, -3, 0.8}));
    EXPECT_EQ(made()[0].heading, -1.5708);
    EXPECT_EQ(made()[0].tint, (std::array<double, 3>{0, 1, 0.2}));
    EXPECT_NE(convert("boxes.json", kCarla, "-y").code, 0);
}

TEST_F(CliObjectBoxes, what_cannot_be_made_is_refused_and_nothing_is_written)
{
    expect_error(convert("l.txt", kLabels + "Car 1\n"), 3, "l.txt' line 3: expected 15 words of a label");
    expect_error(convert("l.txt", kLabels, "--frame 3"), 2, "--frame is for labels of tracking");
    expect_error(convert("l.txt", kLabels, "--sample 3"), 2, "--sample has no meaning for kitti-boxes");
    expect_error(convert("l.txt", kLabels, "--calib " + path("none.txt")), 3, "none.txt");
    expect_error(convert("l.txt", kLabels, "--to vox"), 2, "--to has no meaning for boxes");
    expect_error(convert("l.txt", kLabels, "--origin 1"), 2, "--origin takes X,Y,Z");
    expect_error(convert("l.txt", kLabels, "", "out.sgrid"), 2, "in a file that ends with .json");
    expect_error(convert("l.txt", kLabels, "--from boxes"), 2, "formats are kitti-boxes, nuscenes-boxes, waymo-boxes");
    expect_error(convert("l.json", "[]", "--from waymo-boxes --calib x"), 2, "--calib has no meaning for waymo-boxes");
    expect_error(convert("p.tum", "0 0 0 0 0 0 0 1\n", "--calib x"), 3, "No such file");
    EXPECT_EQ(convert("l.txt", kLabels, "--dry-run").code, 0);
    EXPECT_FALSE(is_there(path("out.json")));
    EXPECT_FALSE(is_there(path("out.sgrid")));
}

} // namespace cli_object_boxes_test
} // namespace semrover
