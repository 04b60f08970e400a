// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/scene/cell_objects.h"
#include "tests/program.h"
#include "tests/scratch_folder.h"

#include <gtest/gtest.h>

namespace semrover {
namespace cli_objects_test {

const std::string kGolden = SEMROVER_SOURCE_DIR "/tests/golden/";

// a road of 12 x 20 and a facade beside it
VoxelGrid street()
{
    VoxelGrid grid;
    grid.voxel_size = 0.6f;
    for (int32_t i = 0; i < 20; ++i)
        for (int32_t j = 0; j < 12; ++j)
            for (int32_t k = 0; k < (j == 11 ? 4 : 1); ++k) {
                grid.cells.push_back({i, j, k});
                grid.labels.push_back(k ? 2 : 0);
            }
    return grid;
}

std::string house(const std::string& more)
{
    return R"({"format": "semrover.objects", "version": 1, "objects": [{"id": 1, "class": "building",
        "center": [6, 10, 3], "size": [7, 12, 7], "heading": -1.57)" +
           more + "}]}";
}

class CliObjects : public testing::Test {
  protected:
    CliObjects() { EXPECT_TRUE(write_grid(folder_ / "in.sgrid", street())); }

    ProgramResult generate(const std::string& output, const std::string& more,
                           const std::string& model = "transformer_objects") const
    {
        return semrover_program("generate " + path("in.sgrid") + " -m " + kGolden + model + "/model -o " +
                                path(output) + " --quiet --steps 2 --region-size 48 --coverage-threshold 12 " + more);
    }
    VoxelGrid made(const std::string& output, const std::string& more = "") const
    {
        const ProgramResult result = generate(output, more);
        EXPECT_EQ(result.code, 0) << result.err;
        return *read_grid(path(output));
    }
    std::string path(const std::string& name) const { return (folder_ / name).string(); }

    ScratchFolder folder_;
};

TEST_F(CliObjects, a_box_and_a_colour_change_what_is_generated)
{
    folder_.put("none.json", R"({"format": "semrover.objects", "version": 1, "objects": []})");
    folder_.put("house.json", house(""));
    folder_.put("red.json", house(", \"tint\": \"#a02010\""));
    const VoxelGrid plain = made("plain.sgrid"), none = made("none.sgrid", "--objects " + path("none.json"));
    EXPECT_EQ(plain.colors, none.colors);
    EXPECT_EQ(plain.colors, made("word.sgrid", "--objects none").colors);
    const VoxelGrid house = made("house.sgrid", "--objects " + path("house.json"));
    EXPECT_NE(house.colors, plain.colors);
    EXPECT_NE(made("red.sgrid", "--objects " + path("red.json")).colors, house.colors);
}

TEST_F(CliObjects, another_colour_does_not_continue_a_run)
{
    folder_.put("o.json", house(", \"tint\": \"#a02010\""));
    made("out.sgrid", "--objects " + path("o.json"));
    std::filesystem::remove(path("out.sgrid"));
    folder_.put("o.json", house(", \"tint\": \"#a02011\""));
    EXPECT_NE(generate("out.sgrid", "--objects " + path("o.json")).code, 0);
}

TEST_F(CliObjects, a_model_that_knows_labels_alone_and_a_broken_file_are_refused)
{
    folder_.put("o.json", house(""));
    expect_error(generate("out.sgrid", "--objects " + path("o.json"), "sampling_ddpm"), 3, "knows labels alone");
    folder_.put("o.json", house(", \"tint\": 7"));
    expect_error(generate("out.sgrid", "--objects " + path("o.json")), 3, "object 1: tint");
    expect_error(generate("out.sgrid", "--objects " + path("missing.json")), 3, "missing.json");
    EXPECT_FALSE(is_there(folder_ / "out.sgrid"));
}

} // namespace cli_objects_test
} // namespace semrover
