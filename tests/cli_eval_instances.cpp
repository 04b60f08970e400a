// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
#include "engine/format/flow_picture.h"
#include "engine/format/image.h"
#include "engine/format/transforms.h"
#include "engine/scene/actors.h"
#include "runtime/base/json.h"
#include "tests/support/json_text.h"
#include "tests/support/program.h"

#include <gtest/gtest.h>

namespace semrover {
namespace cli_eval_instances_test {

constexpr uint32_t kWidth = 24, kHeight = 16, kPixels = kWidth * kHeight;

template <typename Value>
void put(const Path& path, Value value_at) // of column and row
{
    std::filesystem::create_directories(path.parent_path());
    std::vector<uint16_t> pixels;
    for (uint32_t i = 0; i < kPixels; ++i)
        pixels.push_back(uint16_t(value_at(i % kWidth, i / kWidth)));
    ASSERT_TRUE(write_png_gray16(path, kWidth, kHeight, pixels));
}

// a folder as `render` or `streets` writes it: a wall 5 m away, of thing 3 to the left of column 12, of 7 from there on
void put_wall(const Path& folder, const char* name)
{
    const std::string file = std::string(name) + ".png";
    put(folder / "depth" / file, [](uint32_t, uint32_t) { return 5000; });
    put(folder / "instance" / file, [](uint32_t x, uint32_t) { return x < 12 ? 3 : 7; });
    put(folder / "label" / file, [](uint32_t x, uint32_t) { return x < 12 ? 2 : 13; });
}

ProgramResult eval_instances(const Path& frames, const Path& truth, const std::string& more)
{
    return semrover_program("eval instances " + frames.string() + " " + truth.string() + " " + more);
}

TEST(CliEvalInstances, pixels_of_one_surface_are_counted_by_class)
{
    const ScratchFolder folder;
    for (const char* name : {"000000", "000001"})
        put_wall(folder / "true", name);
    put_wall(folder / "made", "000000");
    // of row 0 nothing, of row 1 something 11 cm nearer, of row 2 something 9 cm nearer (5 cm and 1 %)
    put(folder / "made/depth/000000.png", [](uint32_t, uint32_t y) {
        return y == 0 ? 0 : y == 1 ? 4890 : y == 2 ? 4910 : 5000;
    });
    put(folder / "made/instance/000000.png", [](uint32_t x, uint32_t) { return x < 10 ? 3 : x == 20 ? 0 : 7; });
    const ProgramResult result = eval_instances(folder / "made", folder / "true", "--json");
    ASSERT_EQ(result.code, 0) << result.err;
    const Json report = json_of(result.out);
    const uint64_t rows = kHeight - 2;
    EXPECT_EQ(report["pixels"], kPixels);
    EXPECT_EQ(report["one_surface"], rows * kWidth);
    EXPECT_EQ(report["equal"], rows * (kWidth - 3));
    EXPECT_EQ(report["labels"]["building"]["equal"], rows * 10);
    EXPECT_EQ(report["labels"]["building"]["one_surface"], rows * 12);
    EXPECT_NEAR(double(report["labels"]["car"]["share"]), 11 / 12.0, 1e-12);
    EXPECT_EQ(report["labels"].size(), 2u);
    EXPECT_EQ(report["mistaken"], json_of(R"([{"true": 3, "shown": 7, "pixels": 28},
                                              {"true": 7, "shown": 0, "pixels": 14}])"));
    EXPECT_EQ(report["frames"][0]["name"], "000000");
    EXPECT_FALSE(report.contains("flow"));
    const Json strict = json_of(eval_instances(folder / "made", folder / "true", "--json --tolerance 0.01").out);
    EXPECT_EQ(strict["one_surface"], (rows - 1) * kWidth);
    const ProgramResult table = eval_instances(folder / "made", folder / "true", "");
    EXPECT_NE(table.out.find("car"), std::string::npos) << table.out;
}

void put_flow(const Path& path, float left, float right, float off)
{
    std::filesystem::create_directories(path.parent_path());
    std::vector<float> flow;
    for (uint32_t i = 0; i < kPixels; ++i) {
        const bool moves = i % kWidth >= 12;
        flow.insert(flow.end(), {moves ? right : left + (i == kWidth * 5 + 9 ? off : 0), i / kWidth == 15 ? 1e10f : 0});
    }
    const auto file = encode_flow(FlowFormat::png, kWidth, kHeight, flow, kPngLevel);
    ASSERT_TRUE(file);
    ASSERT_TRUE(write_file_atomically(path, *file));
}

// The camera steps to its right, and thing 7 as far again: what stands moves to the left, thing 7 to the right.
TEST(CliEvalInstances, flow_is_compared_with_what_poses_and_actors_say)
{
    const ScratchFolder folder;
    for (const char* of : {"true", "made"})
        for (const char* name : {"000000", "000001"})
            put_wall(folder / of, name);
    const double step = 0.25, focal = 20, pixels = focal * step / 5; // one
    CameraPath path;
    for (int i : {0, 1}) {
        CameraFrame frame{.time = i * 0.5, .camera = "", .pose = {kIdentity}, .intrinsics = {}};
        frame.intrinsics = {.fx = focal, .fy = focal, .cx = 12, .cy = 8, .width = kWidth, .height = kHeight};
        frame.pose.world_to_camera[3] = -i * step;
        path.frames.push_back(frame);
    }
    ASSERT_TRUE(write_transforms(folder / "true/transforms.json", path));
    Actor actor{.id = 6,
                .label = 13,
                .size = {1, 1, 1},
                .from = ObjectOfScene{},
                .poses = {{0, kIdentity}, {1000000, kIdentity}}};
    actor.poses[0].to_world[7] = 2; // anywhere
    actor.poses[1].to_world = actor.poses[0].to_world;
    actor.poses[1].to_world[3] = 4 * step;
    ASSERT_TRUE(write_actors(folder / "actors.json", std::vector{actor}));
    put_flow(folder / "made/flow/000000.png", -float(pixels), float(pixels), 3);
    const std::string actors = " --actors " + (folder / "actors.json").string();
    const ProgramResult result = eval_instances(folder / "made", folder / "true", "--json --flow" + actors);
    ASSERT_EQ(result.code, 0) << result.err;
    const Json flow = json_of(result.out)["flow"];
    EXPECT_EQ(flow["seen"], (kWidth - 2) * kHeight); // a column leaves the picture on each side
    EXPECT_EQ(flow["standing"]["pixels"], 11 * 15);  // where the flow is known
    EXPECT_EQ(flow["moving"]["pixels"], 11 * 15);
    EXPECT_NEAR(double(flow["standing"]["median"]), 0, 1e-6);
    EXPECT_NEAR(double(flow["standing"]["worst"]), 3, 1e-6);
    EXPECT_NEAR(double(flow["moving"]["worst"]), 0, 1e-6);
    // without actors everything stands, and the flow of thing 7 is wrong by as much as it moved
    const Json standing = json_of(eval_instances(folder / "made", folder / "true", "--json --flow").out)["flow"];
    EXPECT_EQ(standing["moving"]["pixels"], 0);
    EXPECT_NEAR(double(standing["standing"]["p95"]), 2 * pixels, 1e-6);
    // an actor that is gone has no flow
    actor.poses[1] = {400000, actor.poses[0].to_world};
    ASSERT_TRUE(write_actors(folder / "actors.json", std::vector{actor}));
    const Json gone = json_of(eval_instances(folder / "made", folder / "true", "--json --flow" + actors).out)["flow"];
    EXPECT_EQ(gone["moving"]["pixels"], 0);
    EXPECT_EQ(gone["standing"]["pixels"], 11 * 15);
    EXPECT_NE(eval_instances(folder / "made", folder / "true", "--flow" + actors).out.find("standing"),
              std::string::npos);
}

TEST(CliEvalInstances, what_does_not_belong_together_is_refused)
{
    const ScratchFolder folder;
    put_wall(folder / "true", "000000");
    put_wall(folder / "made", "000001");
    expect_error(eval_instances(folder / "made", folder / "true", ""), 3, "has no picture '000001'");
    put_wall(folder / "true", "000001");
    ASSERT_TRUE(write_png_gray16(folder / "made/instance/000001.png", 2, 2, std::vector<uint16_t>(4)));
    expect_error(eval_instances(folder / "made", folder / "true", ""), 3, "is 2 x 2 pixels, expected 24 x 16");
    ASSERT_TRUE(write_png_gray8(folder / "made/instance/000001.png", 2, 2, std::vector<uint8_t>(4)));
    expect_error(eval_instances(folder / "made", folder / "true", ""), 3, "expected a PNG of 16-bit gray");
    EXPECT_EQ(eval_instances(folder / "made", folder / "true", "--actors a.json").code, 2);
}

} // namespace cli_eval_instances_test
} // namespace semrover
