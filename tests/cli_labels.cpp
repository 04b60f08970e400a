// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
#include "engine/scene/grid.h"
#include "engine/scene/palette.h"
#include "tests/support/json_text.h"
#include "tests/support/program.h"

#include <algorithm>

namespace semrover {
namespace cli_labels_test {

TEST(cli_labels, all_classes_are_listed_with_number_and_colour)
{
    const ProgramResult text = semrover_program("labels");
    EXPECT_EQ(text.code, 0) << text.err;
    EXPECT_EQ(std::count(text.out.begin(), text.out.end(), '\n'), 20);
    EXPECT_NE(text.out.find("  7  traffic sign  #dcdc00\n"), std::string::npos) << text.out;
    const nlohmann::json json = json_of(semrover_program("labels --json").out);
    ASSERT_EQ(json["labels"].size(), kClassCount);
    for (size_t i = 0; i < kClassCount; ++i) {
        EXPECT_EQ(json["labels"][i]["number"], i);
        EXPECT_EQ(json["labels"][i]["name"], kPalette[i].name);
    }
    EXPECT_EQ(json["labels"][8]["color"], "#6b8e23");
}

TEST(cli_labels, the_palette_of_magicavoxel_has_a_voxel_of_each_class)
{
    const ScratchFolder folder;
    const std::string vox = (folder / "labels.vox").string(), grid = (folder / "back.sgrid").string();
    ASSERT_EQ(semrover_program("labels --vox " + vox).code, 0);
    expect_error(semrover_program("labels --vox " + vox), 2, "exists; -y replaces it");
    const ProgramResult read = semrover_program("convert " + vox + " " + grid);
    ASSERT_EQ(read.code, 0) << read.err;
    const auto back = read_grid(grid);
    ASSERT_TRUE(back);
    ASSERT_EQ(back->cells.size(), kClassCount);
    for (size_t i = 0; i < kClassCount; ++i) {
        EXPECT_EQ(back->cells[i], (Cell{int32_t(i), 0, 0}));
        EXPECT_EQ(back->labels[i], i);
    }
}

TEST(cli_labels, a_name_may_be_written_with_underscores_everywhere)
{
    const ScratchFolder folder;
    const std::string mesh = folder.put("m.obj", "v 0 0 0\nv 4 0 0\nv 4 4 0\nf 1 2 3\n").string();
    const std::string grid = (folder / "m.sgrid").string();
    for (const char* name : {"traffic_sign", "'traffic sign'", "Traffic-Sign", "7"}) {
        const std::string of = std::string(" ") + name + " ";
        ASSERT_EQ(semrover_program("voxelize " + mesh + " -q -y -o " + grid + " --default-label" + of).code, 0) << name;
        EXPECT_EQ(read_grid(grid)->labels[0], 7);
        const std::string painted = (folder / "p.sgrid").string();
        EXPECT_EQ(semrover_program("edit " + grid + " -y -o " + painted + " --paint road_lane --class" + of).code, 0);
        EXPECT_EQ(read_grid(painted)->labels[0], 19);
    }
    expect_error(semrover_program("voxelize " + mesh + " -o " + grid + " -y --default-label sign"), 2,
                 "--default-label: unknown class 'sign', expected one of road, ");
}

} // namespace cli_labels_test
} // namespace semrover
