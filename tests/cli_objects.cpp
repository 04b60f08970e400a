// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
#include "engine/conditioning/cell_objects.h"
#include "runtime/base/json.h"
#include "tests/support/json_text.h"
#include "tests/support/program.h"
#include "tests/support/scratch_folder.h"

#include <gtest/gtest.h>

namespace semrover {
namespace cli_objects_test {

const std::string kFast = " --quiet --steps 2 --region-size 48 --coverage-threshold 12 ";
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
        return generate_with(kGolden + model + "/model", output, more);
    }
    ProgramResult generate_with(const std::string& model, const std::string& output, const std::string& more = "") const
    {
        return semrover_program("generate " + path("in.sgrid") + " -m " + model + " -o " + path(output) + kFast + more);
    }
    void made_with(const std::string& model, const std::string& output, const std::string& more = "") const
    {
        const ProgramResult result = generate_with(model, output, more);
        ASSERT_EQ(result.code, 0) << result.err;
    }
    ProgramResult edit(const std::string& input, const std::string& output, const std::string& more) const
    {
        const bool generates = more.find("-m ") != std::string::npos;
        return semrover_program("edit " + path(input) + " -o " + path(output) + " --quiet " + more +
                                (generates ? kFast : ""));
    }
    // the golden model with colours that houses have
    std::string knowing_model() const
    {
        namespace fs = std::filesystem;
        fs::create_directories(folder_ / "model" / "voxfield_transformer");
        fs::copy(kGolden + "transformer_objects/model", folder_ / "model" / "voxfield_transformer",
                 fs::copy_options::recursive | fs::copy_options::overwrite_existing);
        folder_.put("model/model_index.json", R"({"defaults": {"objects": {"building": {"size": [11, 11, 16],
            "tints": ["#a02010", "#10a020", "#2010a0", "#a0a010", "#606060", "#f0f0f0"]}}}})");
        return path("model");
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

TEST_F(CliObjects, what_is_guessed_is_written_and_gives_the_same_when_it_is_given)
{
    const std::string model = knowing_model();
    made_with(model, "auto.sgrid");
    const auto guessed = read_objects(folder_ / "auto.objects.json");
    ASSERT_TRUE(guessed) << guessed.error().message;
    ASSERT_EQ(guessed->size(), 1u);
    EXPECT_EQ((*guessed)[0].label, 2);
    EXPECT_TRUE((*guessed)[0].tint);
    made_with(model, "given.sgrid", "--objects " + path("auto.objects.json"));
    const VoxelGrid first = *read_grid(path("auto.sgrid"));
    EXPECT_EQ(first.colors, read_grid(path("given.sgrid"))->colors);
    made_with(model, "none.sgrid", "--objects none");
    EXPECT_NE(first.colors, read_grid(path("none.sgrid"))->colors);
    EXPECT_FALSE(is_there(folder_ / "none.objects.json"));
    const std::string convert = "convert " + path("in.sgrid") + " " + path("guess.json");
    expect_error(semrover_program(convert), 2, "--model is missing");
    ASSERT_EQ(semrover_program(convert + " -m " + model).code, 0);
    EXPECT_EQ(contents(folder_ / "guess.json"), contents(folder_ / "auto.objects.json"));
    EXPECT_EQ(generate_with(model, "auto.sgrid").code, 0); // it is done
    expect_error(generate_with(model, "auto.sgrid", "--objects none"), 2, "exists");
}

TEST_F(CliObjects, inspect_counts_objects_and_says_where_those_of_a_grid_are)
{
    made_with(knowing_model(), "a.sgrid");
    const auto objects = json_of(semrover_program("inspect --json " + path("a.objects.json")).out);
    EXPECT_EQ(objects["count"], 1);
    EXPECT_EQ(objects["tinted"], 1);
    EXPECT_EQ(objects["parts"], 0);
    EXPECT_EQ(objects["classes"]["building"], 1);
    std::vector<SceneObject> with_window = *read_objects(folder_ / "a.objects.json");
    with_window.push_back(with_window[0]);
    with_window[1].id = 77;
    with_window[1].part = true;
    ASSERT_TRUE(write_objects(folder_ / "window.json", with_window));
    const auto more = json_of(semrover_program("inspect --json " + path("window.json")).out);
    EXPECT_EQ(more["count"], 2);
    EXPECT_EQ(more["parts"], 1);
    EXPECT_EQ(more["classes"]["building"], 1);
    EXPECT_EQ(json_of(semrover_program("inspect --json " + path("a.sgrid")).out)["objects"], path("a.objects.json"));
    EXPECT_FALSE(json_of(semrover_program("inspect --json " + path("in.sgrid")).out).contains("objects"));
    const auto model = json_of(semrover_program("inspect --json " + path("model")).out);
    EXPECT_EQ(model["defaults"]["objects"]["building"]["tints"], 6);
}

TEST_F(CliObjects, a_tint_changes_the_cells_of_its_object_and_no_others)
{
    const std::string model = knowing_model();
    made_with(model, "a.sgrid");
    const ProgramResult result =
        edit("a.sgrid", "b.sgrid", "--tint '#0040ff' --class building --box 0,6,0:5,8,3 -m " + model);
    ASSERT_EQ(result.code, 0) << result.err;
    const VoxelGrid before = *read_grid(path("a.sgrid")), after = *read_grid(path("b.sgrid"));
    ASSERT_EQ(before.cells, after.cells);
    size_t changed = 0;
    for (size_t v = 0; v < before.cells.size(); ++v) {
        const auto of = [&](const VoxelGrid& g) { return std::vector(&g.colors[v * 60], &g.colors[v * 60] + 60); };
        if (before.labels[v] == 2)
            changed += of(before) != of(after);
        else
            EXPECT_EQ(of(before), of(after));
    }
    EXPECT_EQ(changed, 60u) << "every voxel of the one house, though a part of it was selected";
    EXPECT_EQ(tint_text(*(*read_objects(folder_ / "b.objects.json"))[0].tint), "#0040ff");
    EXPECT_NE(tint_text(*(*read_objects(folder_ / "a.objects.json"))[0].tint), "#0040ff");
    ASSERT_EQ(
        semrover_program("edit " + path("b.sgrid") + " --undo " + path("b.sgrid.undo") + " -o " + path("c.sgrid")).code,
        0);
    EXPECT_EQ(contents(folder_ / "a.sgrid"), contents(folder_ / "c.sgrid"));
}

TEST_F(CliObjects, a_tint_without_an_object_or_a_model_that_hears_it_is_refused)
{
    const std::string tint = "--tint '#0040ff' --class building ";
    made_with(knowing_model(), "a.sgrid");
    expect_error(edit("a.sgrid", "b.sgrid", tint + "-m " + kGolden + "sampling_ddpm/model"), 3, "knows labels alone");
    expect_error(edit("a.sgrid", "b.sgrid", "--tint '#0040ff' --class road"), 3, "belong to no object");
    expect_error(edit("a.sgrid", "b.sgrid", "--tint blue --class building"), 2, "#rrggbb");
    expect_error(edit("a.sgrid", "b.sgrid", "--tint '#0040ff'"), 2, "say which voxels");
    std::filesystem::remove(folder_ / "a.objects.json");
    expect_error(edit("a.sgrid", "b.sgrid", tint), 3, "a.objects.json' is missing");
    EXPECT_FALSE(is_there(folder_ / "b.sgrid"));
}

TEST_F(CliObjects, a_script_tints_too_and_without_a_model_the_cells_wait)
{
    made_with(knowing_model(), "a.sgrid");
    folder_.put("s.json", R"([{"op": "tint", "color": "#0040ff", "class": "building"}])");
    const ProgramResult result = edit("a.sgrid", "b.sgrid", "--script " + path("s.json"));
    ASSERT_EQ(result.code, 0) << result.err;
    const VoxelGrid after = *read_grid(path("b.sgrid"));
    for (size_t v = 0; v < after.cells.size(); ++v)
        EXPECT_EQ(after.generated[v], after.labels[v] != 2);
    folder_.put("s.json", R"([{"op": "paint", "label": "road", "color": "#0040ff", "class": "building"}])");
    expect_error(edit("a.sgrid", "d.sgrid", "--script " + path("s.json")), 2, "nothing else, has a color");
}

} // namespace cli_objects_test
} // namespace semrover
