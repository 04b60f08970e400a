// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
#include "engine/format/image.h"
#include "runtime/system/host_name.h"
#include "tests/support/refine_case.h"

#include <csignal>
#include <fstream>

namespace semrover {
namespace cli_refine_test {

class CliRefine : public RefineCase {};

TEST_F(CliRefine, a_run_writes_frames_and_latents_the_same_again_and_others_with_another_seed)
{
    const auto first = refined("a");
    EXPECT_EQ(first.size(), 2 * kFrames);
    EXPECT_EQ(read_image_size(folder_ / "a" / "frames" / "000002.png")->width, kWidth);
    EXPECT_TRUE(first == refined("b"));
    EXPECT_FALSE(first == refined("c", "--seed 8"));
    EXPECT_FALSE(first == refined("d", "--sampler dpm++2m"));
    EXPECT_FALSE(fs::exists(folder_ / "a" / "encoded"));
    const Json run = json_of(contents(folder_ / "a" / "run.json"));
    EXPECT_EQ(run["state"], "finished");
    EXPECT_EQ(run["settings"]["steps"], 3);
}

TEST_F(CliRefine, a_profile_has_all_parts_of_a_frame)
{
    ASSERT_EQ(refine("out", "--profile " + path("trace.json")).code, 0);
    const Json trace = json_of(contents(folder_ / "trace.json"));
    std::map<std::string, uint32_t> passes;
    for (const Json& event : trace["traceEvents"])
        if (event["ph"] == "X")
            ++passes[event["name"]];
    EXPECT_EQ(passes["picture_input"], kFrames); // encoded
    EXPECT_EQ(passes["step_update"], 3 * kFrames);
    EXPECT_EQ(passes["picture_bytes"], kFrames); // decoded
    EXPECT_EQ(passes["scale_latent"], 2 * kFrames);
}

TEST_F(CliRefine, a_run_whose_device_is_lost_goes_on_with_a_new_one)
{
    const auto whole = refined("whole");
    const ProgramResult lost = semrover_with_lost_devices(1, 14, arguments("lost"));
    EXPECT_EQ(lost.code, 0) << lost.err;
    EXPECT_TRUE(whole == results("lost"));
}

TEST_F(CliRefine, a_run_that_was_killed_goes_on_to_the_same_bytes)
{
    const auto whole = refined("whole");
    for (const size_t lines : {0, 1, 2, 3, 5}) {
        const std::string output = fmt::format("killed{}", lines);
        EXPECT_EQ(stop_after(output, lines, SIGKILL), 128 + SIGKILL) << lines;
        EXPECT_TRUE(whole == refined(output)) << "killed after " << lines << " pieces";
    }
}

TEST_F(CliRefine, a_finished_run_is_done_and_one_that_is_not_whole_any_more_is_refused)
{
    const auto whole = refined("out", "--video " + path("a.mp4"));
    const std::string run = contents(folder_ / "out/run.json"), video = contents(folder_ / "a.mp4");
    const Json first = json_of(run)["results"];
    EXPECT_EQ(report("out", "--video " + path("a.mp4")), first);
    EXPECT_EQ(contents(folder_ / "out/run.json"), run);
    EXPECT_EQ(contents(folder_ / "a.mp4"), video);
    EXPECT_TRUE(whole == results("out"));
    ASSERT_EQ(refine("out", "--side-by-side " + path("b.mp4")).code, 0); // one that was not asked for before
    EXPECT_GT(fs::file_size(folder_ / "b.mp4"), 500u);
    expect_error(refine("out", "--seed 9"), 2, "-y replaces it");
    fs::remove(folder_ / "out/frames/000001.png");
    expect_error(refine("out"), 2, "frames/000001.png is not as it was; -y replaces it");
    EXPECT_TRUE(whole == refined("out", "-y"));
}

TEST_F(CliRefine, frames_say_their_cameras)
{
    const std::string drive = put_drive({0, 0.5, 1});
    refined("one", drive + "--frames 1: ", "street.sgrid");
    const auto path_of_frames = read_transforms(folder_ / "one/transforms.json");
    ASSERT_TRUE(path_of_frames) << path_of_frames.error().message;
    const auto all = read_tum(folder_ / "path.tum", pinhole_from_fov(73, 56, 40));
    ASSERT_EQ(path_of_frames->frames.size(), 2u);
    for (size_t i = 0; i < 2; ++i) {
        EXPECT_EQ(path_of_frames->frames[i].time, all->frames[i + 1].time);
        EXPECT_EQ(path_of_frames->frames[i].intrinsics, all->frames[i + 1].intrinsics);
        for (size_t j = 0; j < 16; ++j)
            EXPECT_NEAR(path_of_frames->frames[i].pose.world_to_camera[j], all->frames[i + 1].pose.world_to_camera[j],
                        1e-12);
    }
    const Json file = json_of(contents(folder_ / "one/transforms.json"));
    EXPECT_EQ(file["depth_unit_scale_factor"], 0.001);
    EXPECT_EQ(file["frames"][0]["file_path"], "frames/000001.png");
    EXPECT_EQ(file["frames"][0]["depth_file_path"], "buffers/depth/000001.png");
    for (const Json& frame : file["frames"])
        for (const char* key : {"file_path", "depth_file_path", "label_file_path"})
            EXPECT_TRUE(fs::exists(folder_ / "one" / frame[key].get<std::string>())) << frame[key];
    // a ray that goes up and meets nothing is sky, one that goes down is not known
    const auto label = read_png_rgb8(folder_ / "one/buffers/label/000001.png");
    EXPECT_EQ(label->pixels[0], 10);
    // buffers that `render` wrote know their cameras, those of nobody do not
    ASSERT_EQ(semrover_program("render " + path("street.sgrid") + drive + "-q -o " + path("drawn")).code, 0);
    refined("two", "", "drawn");
    EXPECT_EQ(json_of(contents(folder_ / "two/transforms.json"))["frames"].size(), 3u);
    refined("three");
    EXPECT_FALSE(fs::exists(folder_ / "three/transforms.json"));
    fs::remove(folder_ / "drawn/color/000002.png");
    fs::remove(folder_ / "drawn/visible/000002.png");
    const ProgramResult part =
        semrover_program("refine " + path("drawn") + " -m " + path("model") + " -o " + path("part") + kSettings);
    EXPECT_EQ(part.code, 0) << part.err;
    EXPECT_NE(part.err.find("transforms.json' is not used: "), std::string::npos) << part.err;
}

TEST_F(CliRefine, an_interrupt_saves_what_is_done_and_exits_with_130)
{
    put_buffers(folder_ / "in", 12, kWidth, kHeight); // more pieces than may wait for their files
    EXPECT_EQ(stop_after("out", 2, SIGINT), 130);
    EXPECT_GE(journal_lines("out"), 2u);
    EXPECT_TRUE(refined("whole") == refined("out"));
}

TEST_F(CliRefine, damaged_pieces_are_done_again)
{
    const auto whole = refined("whole");
    ASSERT_EQ(stop_after("out", 4, SIGKILL), 128 + SIGKILL);
    std::ofstream(path("out/journal.jsonl"), std::ios::app) << R"({"piece":"frames/0000)"; // died while writing
    fs::resize_file(folder_ / "out" / "latents" / "000000.safetensors", 40);
    fs::remove(folder_ / "out" / "frames" / "000000.png");
    folder_.put("out/frames/.semrover-" + host_name() + "-2147483647-2.tmp", "half a picture");
    EXPECT_TRUE(whole == refined("out"));
}

TEST_F(CliRefine, a_chain_goes_on_at_a_frame_from_the_latent_of_another_run)
{
    const auto whole = refined("whole");
    const auto part = refined("part", "--frames 1:2 --from " + path("whole"));
    EXPECT_EQ(part.size(), 4u);
    for (const auto& [name, bytes] : part)
        EXPECT_TRUE(bytes == whole.at(name)) << name;
    const auto fresh = refined("fresh", "--frames 1:"); // a first frame
    EXPECT_EQ(fresh.size(), 4u);
    EXPECT_FALSE(fresh.at("frames/000001.png") == whole.at("frames/000001.png"));
    const auto head = refined("head", "--frames :0");
    EXPECT_EQ(head.size(), 2u);
    EXPECT_TRUE(head.at("frames/000000.png") == whole.at("frames/000000.png"));
}

TEST_F(CliRefine, cameras_are_chains_that_do_not_know_of_each_other)
{
    put_buffers(folder_ / "rig" / "front", 2, kWidth, kHeight);
    put_buffers(folder_ / "rig" / "left", 2, 40, 32, 1); // of another size
    const Json together = report("out", "", "rig");
    EXPECT_EQ(together["frames"], 4);
    EXPECT_EQ(together["planned_device_bytes"], together["peak_device_bytes"]);
    for (const std::string name : {"front", "left"}) {
        fs::create_directories(folder_ / ("only_" + name));
        fs::copy(folder_ / "rig" / name, folder_ / ("only_" + name) / name, fs::copy_options::recursive);
        ASSERT_EQ(refine("out_" + name, "", "only_" + name).code, 0);
        EXPECT_TRUE(results("out", name) == results("out_" + name, name)) << name;
    }
    ASSERT_EQ(stop_after("killed", 5, SIGKILL, "", "rig"), 128 + SIGKILL);
    ASSERT_EQ(refine("killed", "", "rig").code, 0);
    for (const char* name : {"front", "left"})
        EXPECT_TRUE(results("out", name) == results("killed", name)) << name;
}

TEST_F(CliRefine, less_memory_means_stages_and_the_same_bytes)
{
    const auto whole = refined("whole");
    const Json plan = json_of(semrover_program(arguments("none") + "--dry-run --json").out);
    EXPECT_FALSE(fs::exists(folder_ / "none"));
    EXPECT_EQ(plan["policy"], "resident");
    const uint64_t resident = plan["policies"]["resident"], staged = plan["policies"]["staged"];
    ASSERT_LT(staged, resident);
    for (const auto& [limit, policy] :
         {std::pair{resident, "resident"}, {resident - 1, "staged"}, {staged, "staged"}}) {
        const std::string output = fmt::format("limit{}", limit);
        const Json run = report(output, fmt::format("--max-vram {}", limit));
        EXPECT_EQ(run["policy"], policy);
        EXPECT_EQ(run["planned_device_bytes"], run["peak_device_bytes"]);
        EXPECT_EQ(run["planned_device_bytes"], limit == resident ? resident : staged);
        EXPECT_TRUE(whole == results(output)) << policy;
    }
    const ProgramResult refused = refine("less", fmt::format("--max-vram {}", staged - 1));
    EXPECT_EQ(refused.code, 5);
    for (const uint64_t number : {resident, staged, staged - 1})
        EXPECT_NE(refused.err.find(std::to_string(number)), std::string::npos) << refused.err;
    const std::string limit = fmt::format("--max-vram {} ", staged);
    for (const size_t lines : {1, 4, 7}) { // while encoding, denoising, decoding
        const std::string output = fmt::format("staged{}", lines);
        EXPECT_EQ(stop_after(output, lines, SIGKILL, limit), 128 + SIGKILL);
        const Json run = report(output, lines == 4 ? "" : limit); // another policy goes on as well
        EXPECT_EQ(run["planned_device_bytes"], run["peak_device_bytes"]);
        EXPECT_TRUE(whole == results(output)) << lines;
    }
}

TEST_F(CliRefine, the_planned_memory_is_the_memory_that_was_used)
{
    for (const char* more : {"", "--cfg-scale 1", "--cfg-scale 4", "--precision fp32", "--frames 0:0"}) {
        const Json run = report("out", fmt::format("-y {}", more));
        EXPECT_EQ(run["planned_device_bytes"], run["peak_device_bytes"]) << more;
    }
    const ProgramResult told =
        semrover_program("refine " + path("in") + " -m " + path("model") + " -o " + path("told") + kSettings);
    EXPECT_EQ(told.code, 0) << told.err;
    EXPECT_NE(told.out.find("planned device memory "), std::string::npos) << told.out;
    EXPECT_NE(told.out.find("peak device memory "), std::string::npos) << told.out;
}

} // namespace cli_refine_test
} // namespace semrover
