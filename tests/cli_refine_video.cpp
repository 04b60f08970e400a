// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
// `refine` with a renderer of videos
#include "runtime/base/json.h"
#include "tests/support/child_program.h"
#include "tests/support/json_text.h"
#include "tests/support/program.h"
#include "tests/support/renderer_folders.h"

#include <algorithm>
#include <csignal>

namespace semrover {
namespace cli_refine_video_test {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using Files = std::map<std::string, std::string>; // bytes by name

constexpr uint32_t kWidth = 56, kHeight = 40, kFrames = 7;
constexpr const char* kSettings = " --steps 2 ";
// windows of four frames: 0 to 3, 2 to 5, 3 to 6
constexpr const char* kIndex =
    R"({"defaults": {"renderer": {"window_frames": 4, "window_overlap": 2, "decode_frames": 3}}})";

class CliRefineVideo : public testing::Test {
  protected:
    CliRefineVideo()
    {
        put_video_model(folder_ / "model");
        folder_.put("model/model_index.json", kIndex);
        put_buffers(folder_ / "in", kFrames, kWidth, kHeight);
    }

    std::string path(std::string_view name) const { return (folder_ / name).string(); }
    std::string arguments(std::string_view output, std::string_view input = "in") const
    {
        return "refine " + path(input) + " -m " + path("model") + " -o " + path(output) + " --quiet";
    }
    ProgramResult refine(std::string_view output, const std::string& more = "", std::string_view input = "in") const
    {
        return semrover_program(arguments(output, input) + kSettings + more);
    }
    Json report(std::string_view output, const std::string& more = "", std::string_view input = "in") const
    {
        const ProgramResult result = refine(output, more + " --json", input);
        EXPECT_EQ(result.code, 0) << result.err;
        return Json::parse(result.out, nullptr, false);
    }
    Files results(std::string_view output, std::string_view camera = "") const
    {
        Files files;
        for (const char* kind : {"frames", "latents"})
            for (const auto& entry : fs::directory_iterator(folder_ / output / kind / camera))
                files[std::string(kind) + "/" + entry.path().filename().string()] = contents(entry.path());
        return files;
    }
    Files refined(std::string_view output, const std::string& more = "", std::string_view input = "in") const
    {
        const ProgramResult result = refine(output, more, input);
        EXPECT_EQ(result.code, 0) << result.err;
        return results(output);
    }
    // starts a run, waits until `lines` pieces are saved and kills it
    void kill_after(std::string_view output, size_t lines, const std::string& more = "",
                    std::string_view input = "in") const
    {
        ChildProgram child(arguments(output, input) + kSettings + more);
        const auto journal = [&] { return contents(folder_ / output / "journal.jsonl"); };
        while (size_t(std::ranges::count(journal(), '\n')) < lines && child.running())
            usleep(500);
        EXPECT_EQ(child.stop(SIGKILL), 128 + SIGKILL) << lines;
    }

    ScratchFolder folder_;
};

TEST_F(CliRefineVideo, a_run_writes_frames_and_latents_the_same_again_and_others_with_other_settings)
{
    const Files first = refined("a");
    EXPECT_EQ(first.size(), 2 * kFrames);
    EXPECT_EQ(read_image_size(folder_ / "a" / "frames" / "000006.png")->width, kWidth);
    EXPECT_TRUE(first == refined("b"));
    for (const char* more : {"--seed 8", "--cfg-scale 5", "--cfg-first 2", "--window-overlap 1", "--window 5"})
        EXPECT_FALSE(first == refined("other", std::string("-y ") + more)) << more;
    // latents are decoded in other parts, and not made anew
    const Files together = refined("together", "--decode-frames 4");
    EXPECT_TRUE(first.at("latents/000005.safetensors") == together.at("latents/000005.safetensors"));
    EXPECT_FALSE(first.at("frames/000005.png") == together.at("frames/000005.png"));
    const Json run = json_of(contents(folder_ / "a" / "run.json"));
    EXPECT_EQ(run["state"], "finished");
    EXPECT_EQ(run["settings"]["window_frames"], 4);
    EXPECT_EQ(run["settings"]["window_overlap"], 2);
    EXPECT_EQ(run["settings"]["first_guidance_scale"], 1.0);
    EXPECT_EQ(run["settings"]["sampler"], "euler");
}

TEST_F(CliRefineVideo, a_run_that_was_killed_goes_on_to_the_same_bytes)
{
    const Files whole = refined("whole");
    for (const size_t lines : {0, 2, 4, 5, 7, 9, 12}) { // within windows and at their ends
        const std::string output = fmt::format("killed{}", lines);
        kill_after(output, lines);
        EXPECT_TRUE(whole == refined(output)) << "killed after " << lines << " pieces";
    }
}

TEST_F(CliRefineVideo, less_memory_means_stages_and_the_same_bytes)
{
    const Files whole = refined("whole");
    const Json plan = json_of(semrover_program(arguments("none") + kSettings + "--dry-run --json").out);
    EXPECT_FALSE(fs::exists(folder_ / "none"));
    EXPECT_EQ(plan["window_frames"], 4);
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
    EXPECT_EQ(refine("less", fmt::format("--max-vram {}", staged - 1)).code, 5);
    const std::string limit = fmt::format("--max-vram {} ", staged);
    for (const size_t lines : {3, 9, 12, 15, 19}) { // while encoding, denoising, decoding
        const std::string output = fmt::format("staged{}", lines);
        kill_after(output, lines, limit);
        const Json run = report(output, lines % 2 ? limit : ""); // another policy goes on as well
        EXPECT_EQ(run["planned_device_bytes"], run["peak_device_bytes"]);
        EXPECT_TRUE(whole == results(output)) << lines;
    }
}

TEST_F(CliRefineVideo, the_planned_memory_is_the_memory_that_was_used)
{
    for (const char* more : {"", "--cfg-scale 1", "--precision fp32", "--frames 0:0", "--decode-frames 1"}) {
        const Json run = report("out", fmt::format("-y {}", more));
        EXPECT_EQ(run["planned_device_bytes"], run["peak_device_bytes"]) << more;
    }
}

TEST_F(CliRefineVideo, a_part_goes_on_from_the_latents_of_another_run)
{
    const Files whole = refined("whole");
    const Files part = refined("part", "--frames 4: --from " + path("whole")); // where a window makes its first frame
    EXPECT_EQ(part.size(), 6u);
    for (const auto& [name, bytes] : part)
        EXPECT_TRUE(bytes == whole.at(name)) << name;
    EXPECT_FALSE(refined("fresh", "--frames 4:").at("frames/000004.png") == whole.at("frames/000004.png"));
    const ProgramResult none = refine("none", "--window-overlap 0 --frames 4: --from " + path("whole"));
    EXPECT_EQ(none.code, 2);
    EXPECT_NE(none.err.find("--from needs windows that overlap"), std::string::npos) << none.err;
    EXPECT_EQ(refined("alone", "--window-overlap 0").size(), 2 * kFrames);
}

TEST_F(CliRefineVideo, cameras_are_chains_that_do_not_know_of_each_other)
{
    put_buffers(folder_ / "rig" / "front", 5, kWidth, kHeight);
    put_buffers(folder_ / "rig" / "left", 3, 40, 32, 1); // of another size, and too short for a whole window
    const Json together = report("out", "", "rig");
    EXPECT_EQ(together["frames"], 8);
    EXPECT_EQ(together["planned_device_bytes"], together["peak_device_bytes"]);
    for (const std::string name : {"front", "left"}) {
        fs::create_directories(folder_ / ("only_" + name));
        fs::copy(folder_ / "rig" / name, folder_ / ("only_" + name) / name, fs::copy_options::recursive);
        ASSERT_EQ(refine("out_" + name, "", "only_" + name).code, 0);
        EXPECT_TRUE(results("out", name) == results("out_" + name, name)) << name;
    }
    kill_after("killed", 8, "", "rig");
    ASSERT_EQ(refine("killed", "", "rig").code, 0);
    for (const char* name : {"front", "left"})
        EXPECT_TRUE(results("out", name) == results("killed", name)) << name;
}

TEST_F(CliRefineVideo, straight_from_a_grid_is_render_and_refine_with_noise_that_stays_on_surfaces)
{
    ASSERT_TRUE(write_grid(folder_ / "street.sgrid", street()));
    std::string poses;
    for (uint32_t f = 0; f < 5; ++f)
        poses += fmt::format("{} {} 3.6 1.6 -0.5 0.5 -0.5 0.5\n", f, 0.5 * f);
    folder_.put("path.tum", poses);
    const std::string drive = " --path " + path("path.tum") + " -W 56 -H 40 ";
    const ProgramResult rendered =
        semrover_program("render " + path("street.sgrid") + drive + "--quiet -o " + path("buffers"));
    ASSERT_EQ(rendered.code, 0) << rendered.err;
    const Files two = refined("two", "", "buffers");
    const Json one = report("one", drive, "street.sgrid");
    EXPECT_TRUE(two == results("one"));
    EXPECT_EQ(one["planned_device_bytes"], one["peak_device_bytes"]);
    kill_after("killed", 2, drive, "street.sgrid");
    EXPECT_TRUE(two == refined("killed", drive, "street.sgrid"));
    const Files warped = refined("warped", drive + "--frame-noise warped", "street.sgrid");
    EXPECT_FALSE(two == warped);
    EXPECT_TRUE(warped == refined("again", drive + "--frame-noise warped", "buffers"));
    const Files last = refined("last", drive + "--frame-noise warped --frames 4: --from " + path("warped"), "buffers");
    EXPECT_TRUE(last.at("latents/000004.safetensors") == warped.at("latents/000004.safetensors"));
}

TEST_F(CliRefineVideo, the_model_says_how_drives_are_cut)
{
    const auto plan = [&](const std::string& more = "") {
        const ProgramResult r = semrover_program(arguments("none") + " --dry-run --json " + more);
        EXPECT_EQ(r.code, 0) << r.err;
        return json_of(r.out);
    };
    EXPECT_EQ(plan("--window 2")["window_overlap"], 1); // less than it says
    fs::remove(folder_ / "model" / "model_index.json");
    EXPECT_EQ(plan()["window_frames"], 6); // num_frames of its UNet
    EXPECT_EQ(plan()["window_overlap"], 2);
    EXPECT_EQ(plan()["steps"], 25);
    folder_.put("model/model_index.json", R"({"defaults": {"renderer": {"window_frames": 5, "window_overlap": 3,
        "decode_frames": 2, "num_inference_steps": 3, "added_time_ids": [5, 1, 0]}}})");
    EXPECT_EQ(plan()["window_frames"], 5);
    EXPECT_EQ(plan()["window_overlap"], 3);
    EXPECT_EQ(plan()["decode_frames"], 2);
    EXPECT_EQ(plan()["steps"], 3);
    const auto refuses = [&](const std::string& renderer, std::string_view what) {
        folder_.put("model/model_index.json", R"({"defaults": {"renderer": )" + renderer + "}}");
        const ProgramResult r = semrover_program(arguments("none") + " --dry-run");
        EXPECT_EQ(r.code, 3);
        EXPECT_NE(r.err.find(what), std::string::npos) << r.err;
    };
    refuses(R"({"window_frames": 65})", "window_frames is 65");
    refuses(R"({"window_overlap": 6})", "window_overlap is 6");
    refuses(R"({"added_time_ids": [1, 2]})", "3 numbers, as the UNet takes them");
}

TEST_F(CliRefineVideo, what_cannot_be_is_refused_in_a_line)
{
    const auto refuses = [&](const std::string& more, int code, std::string_view what) {
        const size_t entries = folder_.entries();
        const ProgramResult r = semrover_program(arguments("out") + " " + more);
        EXPECT_EQ(r.code, code) << more;
        EXPECT_NE(r.err.find(what), std::string::npos) << r.err;
        EXPECT_EQ(std::ranges::count(r.err, '\n'), 1) << r.err;
        EXPECT_EQ(folder_.entries(), entries) << more;
    };
    refuses("--window 65", 2, "--window: expected an integer from 1 to 64");
    refuses("--window 3 --window-overlap 3", 2, "windows of 3 frames cannot overlap by 3");
    refuses("--decode-frames 0", 2, "--decode-frames: expected an integer from 1 to 64");
    refuses("--previous-noise 0.3", 2, "puts no noise on the frame before");
    refuses("--sampler ddim", 3, "timestep_type is \"continuous\", which the euler sampler alone gives");
    refuses("--cfg-first=-1", 2, "--cfg-first: expected a number from 0 to 1000");
    put_renderer_model(folder_ / "frames_model");
    const ProgramResult frames =
        semrover_program("refine " + path("in") + " -m " + path("frames_model") + " -o " + path("out") + " --window 4");
    EXPECT_EQ(frames.code, 2);
    EXPECT_NE(frames.err.find("makes frames one by one"), std::string::npos) << frames.err;
}

} // namespace cli_refine_video_test
} // namespace semrover
