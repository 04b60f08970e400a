// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
#include "engine/format/image.h"
#include "runtime/system/host_name.h"
#include "tests/support/child_program.h"
#include "tests/support/jpeg_file.h"
#include "tests/support/json_text.h"
#include "tests/support/program.h"
#include "tests/support/renderer_folders.h"
#include "tools/trajectory/camera_path.h"

#include <algorithm>
#include <cmath>
#include <csignal>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>

namespace semrover {
namespace cli_refine_test {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr uint32_t kWidth = 56, kHeight = 40, kFrames = 3;
constexpr const char* kSettings = " --steps 3 ";

class CliRefine : public testing::Test {
  protected:
    CliRefine()
    {
        put_renderer_model(folder_ / "model");
        put_buffers(folder_ / "in", kFrames, kWidth, kHeight);
    }

    std::string path(std::string_view name) const { return (folder_ / name).string(); }
    std::string arguments(std::string_view output, std::string_view input = "in") const
    {
        return "refine " + path(input) + " -m " + path("model") + " -o " + path(output) + " --quiet" + kSettings;
    }
    // a grid, street.sgrid, and the options of a drive along it by these metres
    std::string put_drive(std::initializer_list<double> places) const
    {
        EXPECT_TRUE(write_grid(folder_ / "street.sgrid", street()));
        std::string poses;
        for (const double x : places)
            poses += fmt::format("{0} {0} 3.6 1.6 -0.5 0.5 -0.5 0.5\n", x);
        folder_.put("path.tum", poses);
        return " --path " + path("path.tum") + " -W 56 -H 40 ";
    }
    ProgramResult refine(std::string_view output, const std::string& more = "", std::string_view input = "in") const
    {
        return semrover_program(arguments(output, input) + more);
    }
    Json report(std::string_view output, const std::string& more = "", std::string_view input = "in") const
    {
        const ProgramResult result = refine(output, more + " --json", input);
        EXPECT_EQ(result.code, 0) << result.err;
        return Json::parse(result.out, nullptr, false);
    }
    // bytes of every frame and latent under `output`, by name
    std::map<std::string, std::string> results(std::string_view output, std::string_view camera = "") const
    {
        std::map<std::string, std::string> files;
        for (const char* kind : {"frames", "latents"})
            for (const auto& entry : fs::directory_iterator(folder_ / output / kind / camera))
                files[std::string(kind) + "/" + entry.path().filename().string()] = contents(entry.path());
        return files;
    }
    std::map<std::string, std::string> refined(std::string_view output, const std::string& more = "",
                                               std::string_view input = "in") const
    {
        const ProgramResult result = refine(output, more, input);
        EXPECT_EQ(result.code, 0) << result.err;
        return results(output);
    }
    size_t journal_lines(std::string_view output) const
    {
        return size_t(std::ranges::count(contents(folder_ / output / "journal.jsonl"), '\n'));
    }
    // starts a run, waits until `lines` pieces are saved and sends it `signal`; its exit status
    int stop_after(std::string_view output, size_t lines, int signal, const std::string& more = "",
                   std::string_view input = "in") const
    {
        ChildProgram child(arguments(output, input) + more);
        while (journal_lines(output) < lines && child.running())
            usleep(500);
        return child.stop(signal);
    }

    ScratchFolder folder_;
};

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

// dB between two pictures
double psnr(const Path& a, const Path& b)
{
    const auto one = read_png_rgb8(a), other = read_png_rgb8(b);
    EXPECT_TRUE(one && other && one->pixels.size() == other->pixels.size());
    double squares = 0;
    for (size_t i = 0; i < one->pixels.size(); ++i)
        squares += std::pow(double(one->pixels[i]) - other->pixels[i], 2);
    return 10 * std::log10(255.0 * 255.0 * double(one->pixels.size()) / squares);
}

// of the default model (docs/numerics.md §6.3)
TEST_F(CliRefine, weights_of_8_bits_take_half_the_memory_and_give_nearly_the_same_frames)
{
    const std::string model = SEMROVER_SOURCE_DIR "/assets/model", scene = SEMROVER_SOURCE_DIR "/assets/scenes/street";
    const ProgramResult converted = semrover_program("convert -q " + model + " " + path("q8") + " --weights q8_0");
    ASSERT_EQ(converted.code, 0) << converted.err;
    Json weights[2];
    uint64_t peak[2];
    for (const auto& [i, which] : {std::pair{0, model}, {1, path("q8")}}) {
        const Json inspected = json_of(semrover_program("inspect --json " + which).out);
        weights[i] = inspected["components"]["renderer"]["weights"];
        const ProgramResult run = semrover_program(
            fmt::format("refine {0}.truth.sgrid --path {0}.tum -m {1} -o {2}{3} -W 112 -H 80 --frames 0:1 --steps 4 "
                        "--quiet --json",
                        scene, which, path("out"), i));
        ASSERT_EQ(run.code, 0) << run.err;
        peak[i] = json_of(run.out)["peak_device_bytes"];
        EXPECT_EQ(json_of(run.out)["planned_device_bytes"], peak[i]);
    }
    EXPECT_EQ(weights[0]["parameters"], weights[1]["parameters"]);
    EXPECT_LT(weights[1]["bytes"].get<uint64_t>(), weights[0]["bytes"].get<uint64_t>() * 6 / 10);
    EXPECT_LT(peak[1] + weights[0]["bytes"].get<uint64_t>() * 4 / 10, peak[0]);
    for (const char* frame : {"frames/000000.png", "frames/000001.png"})
        EXPECT_GT(psnr(folder_ / "out0" / frame, folder_ / "out1" / frame), 48) << frame; // 56.0 and 54.0 dB
}

TEST_F(CliRefine, frames_can_be_jpegs_and_videos)
{
    const ProgramResult result =
        refine("out", "--format jpeg --quality 80 --video " + path("out.mp4") + " --side-by-side " + path("side.mp4"));
    ASSERT_EQ(result.code, 0) << result.err;
    const auto frame = read_jpeg_rgb8(folder_ / "out" / "frames" / "000001.jpg");
    ASSERT_TRUE(frame) << frame.error().message;
    EXPECT_EQ(frame->height, kHeight);
    EXPECT_GT(fs::file_size(folder_ / "out.mp4"), 500u);
    EXPECT_GT(fs::file_size(folder_ / "side.mp4"), fs::file_size(folder_ / "out.mp4"));
}

TEST_F(CliRefine, buffers_may_have_jpegs_of_one_kind_and_any_threads_write_the_same)
{
    for (uint32_t i = 0; i < kFrames; ++i) {
        const Path png = folder_ / fmt::format("in/color/{:06}.png", i);
        const auto color = read_png_rgb8(png);
        ASSERT_TRUE(color);
        ASSERT_TRUE(
            write_jpeg_rgb8(folder_ / fmt::format("in/color/{:06}.jpg", i), kWidth, kHeight, color->pixels, 90));
        if (i != 1)
            fs::remove(png);
    }
    expect_error(refine("out"), 3, "000001.jpg' are one picture in two formats");
    fs::remove(folder_ / "in/color/000001.png");
    const auto whole = refined("one", " --threads 1");
    EXPECT_EQ(whole.size(), 2u * kFrames);
    EXPECT_TRUE(refined("eight", " --threads 8") == whole);
    EXPECT_EQ(contents(folder_ / "eight/journal.jsonl"), contents(folder_ / "one/journal.jsonl"));
    const auto stored = refined("stored", " --png-level 0");
    EXPECT_GT(stored.at("frames/000001.png").size(), whole.at("frames/000001.png").size());
    EXPECT_EQ(stored.at("latents/000001.safetensors"), whole.at("latents/000001.safetensors"));
    EXPECT_TRUE(report("waits").contains("file_wait_seconds"));
}

TEST_F(CliRefine, straight_from_a_grid_is_render_and_refine)
{
    ASSERT_TRUE(write_grid(folder_ / "street.sgrid", street()));
    folder_.put("path.tum", "0 0 3.6 1.6 -0.5 0.5 -0.5 0.5\n1 1 3.6 1.6 -0.5 0.5 -0.5 0.5\n");
    const std::string drive = " --path " + path("path.tum") + " -W 56 -H 40 ";
    const ProgramResult rendered =
        semrover_program("render " + path("street.sgrid") + drive + "--quiet -o " + path("buffers"));
    ASSERT_EQ(rendered.code, 0) << rendered.err;
    const auto two_commands = refined("two", "", "buffers");
    const Json one = report("one", drive, "street.sgrid");
    EXPECT_TRUE(two_commands == results("one"));
    EXPECT_EQ(one["planned_device_bytes"], one["peak_device_bytes"]);
    EXPECT_TRUE(fs::exists(folder_ / "one" / "buffers" / "depth" / "000001.png"));
    for (const size_t lines : {0, 1, 2}) {
        const std::string output = fmt::format("killed{}", lines);
        EXPECT_EQ(stop_after(output, lines, SIGKILL, drive, "street.sgrid"), 128 + SIGKILL);
        const ProgramResult resumed = refine(output, drive, "street.sgrid");
        EXPECT_EQ(resumed.code, 0) << resumed.err;
        EXPECT_TRUE(two_commands == results(output)) << lines;
    }
    // the folder against its path
    EXPECT_EQ(refine("checked", drive, "buffers").code, 0);
    const ProgramResult other = refine("other", " --path " + path("path.tum") + " -W 64 -H 40 ", "buffers");
    EXPECT_EQ(other.code, 3);
    EXPECT_NE(other.err.find("64 x 40 pixels in the path"), std::string::npos) << other.err;
}

TEST_F(CliRefine, splats_are_as_wide_as_the_model_says_unless_the_option_says_otherwise)
{
    const std::string drive = put_drive({0});
    const auto narrow = refined("narrow", drive, "street.sgrid");
    const auto wide = refined("wide", drive + "--splat-radius auto", "street.sgrid");
    EXPECT_FALSE(narrow == wide);
    folder_.put("model/model_index.json", R"({"defaults": {"renderer": {"splat_radius": "auto"}}})");
    EXPECT_TRUE(wide == refined("said", drive, "street.sgrid"));
    EXPECT_TRUE(narrow == refined("overruled", drive + "--splat-radius 0.04", "street.sgrid"));
}

TEST_F(CliRefine, noise_stays_on_surfaces_where_the_model_or_the_option_says_so)
{
    const std::string drive = put_drive({0, 0.5, 1}), warped = "--frame-noise warped ";
    const auto fresh = refined("fresh", drive, "street.sgrid");
    const auto whole = refined("whole", drive + warped, "street.sgrid");
    EXPECT_TRUE(fresh.at("latents/000000.safetensors") == whole.at("latents/000000.safetensors"));
    EXPECT_FALSE(fresh.at("latents/000001.safetensors") == whole.at("latents/000001.safetensors"));
    EXPECT_EQ(json_of(contents(folder_ / "whole" / "run.json"))["settings"]["frame_noise"], "warped");
    // from buffers, from a frame on, and after a kill it is the same
    const std::string buffers = "whole/buffers";
    EXPECT_TRUE(whole == refined("again", drive + warped, buffers));
    const auto last = refined("last", drive + warped + "--frames 2: --from " + path("whole"), buffers);
    EXPECT_TRUE(last.at("latents/000002.safetensors") == whole.at("latents/000002.safetensors"));
    ASSERT_EQ(stop_after("killed", 3, SIGKILL, drive + warped, buffers), 128 + SIGKILL);
    EXPECT_TRUE(whole == refined("killed", drive + warped, buffers));
    // a model that asks for it, with cameras and without
    folder_.put("model/model_index.json", R"({"defaults": {"renderer": {"frame_noise": "warped"}}})");
    EXPECT_TRUE(whole == refined("said", drive, buffers));
    EXPECT_TRUE(fresh == refined("overruled", drive + "--frame-noise fresh", buffers));
    const ProgramResult without =
        semrover_program("refine " + path(buffers) + " -m " + path("model") + " -o " + path("without") + kSettings);
    EXPECT_EQ(without.code, 0);
    EXPECT_NE(without.err.find("without --path it is not known which surfaces frames share"), std::string::npos)
        << without.err;
    EXPECT_TRUE(fresh == results("without"));
}

TEST_F(CliRefine, depth_is_in_the_unit_that_lies_beside_it)
{
    const std::string drive = put_drive({0, 0.2, 0.4}), motion = drive + "--frame-noise warped --frame-history 0.6 ";
    const auto draw = [&](const std::string& depth) {
        const ProgramResult result = semrover_program("render " + path("street.sgrid") + drive + "--quiet -o " +
                                                      path(depth) + " --depth " + depth);
        EXPECT_EQ(result.code, 0) << result.err;
    };
    for (const char* depth : {"cm", "npy"})
        draw(depth);
    // the same depths in millimetres
    fs::copy(folder_ / "cm", folder_ / "mm", fs::copy_options::recursive);
    std::string cameras = contents(folder_ / "mm/transforms.json");
    const std::string key = "\"depth_unit_scale_factor\": 0.0";
    ASSERT_NE(cameras.find(key + "1"), std::string::npos);
    folder_.put("mm/transforms.json", cameras.replace(cameras.find(key), key.size(), key + "0"));
    for (uint32_t f = 0; f < 3; ++f) {
        const Path picture = folder_ / fmt::format("mm/depth/{:06}.png", f);
        auto depth = read_png_gray16(picture);
        ASSERT_TRUE(depth) << depth.error().message;
        for (uint16_t& d : depth->pixels)
            d = uint16_t(10 * d);
        ASSERT_TRUE(write_png_gray16(picture, depth->width, depth->height, depth->pixels));
    }
    const auto millimetres = refined("of_mm", motion, "mm"), centimetres = refined("of_cm", motion, "cm");
    EXPECT_TRUE(millimetres.at("latents/000002.safetensors") == centimetres.at("latents/000002.safetensors"));
    EXPECT_EQ(refined("of_npy", motion, "npy").size(), millimetres.size());
    EXPECT_EQ(json_of(contents(folder_ / "of_cm/run.json"))["settings"]["input"]["cameras"][0]["depth_unit"], 0.01);
    // read in the wrong unit it would be another
    fs::copy(folder_ / "mm/transforms.json", folder_ / "cm/transforms.json", fs::copy_options::overwrite_existing);
    EXPECT_FALSE(refined("wrong", motion, "cm").at("latents/000002.safetensors") ==
                 centimetres.at("latents/000002.safetensors"));
    fs::copy(folder_ / "npy/depth/000001.npy", folder_ / "mm/depth/000001.npy");
    expect_error(refine("twice", motion, "mm"), 3, "000001.npy' are one picture in two formats");
}

TEST_F(CliRefine, finished_frames_take_a_share_of_the_one_before_and_latents_do_not)
{
    const std::string drive = put_drive({0, 0.2, 0.4}), history = "--frame-history 0.6 ";
    const auto without = refined("without", drive, "street.sgrid");
    const auto whole = refined("whole", drive + history, "street.sgrid");
    for (const auto& [name, bytes] : whole) {
        const bool same = name.starts_with("latents") || name == "frames/000000.png";
        EXPECT_EQ(bytes == without.at(name), same) << name;
    }
    // from buffers, from a frame on, one network at a time, and after a kill it is the same
    const std::string buffers = "whole/buffers";
    const Json planned = report("planned", drive + history + "--dry-run", buffers);
    const std::string least = fmt::format("--max-vram {} ", planned["policies"]["staged"].get<uint64_t>());
    EXPECT_TRUE(whole == refined("again", drive + history, buffers));
    EXPECT_TRUE(whole == refined("staged", drive + history + least, buffers));
    const auto last = refined("last", drive + history + "--frames 2: --from " + path("whole"), buffers);
    EXPECT_TRUE(last.at("frames/000002.png") == whole.at("frames/000002.png"));
    for (const char* format : {"png", "jpeg"}) {
        const std::string options = drive + history + "--format " + format + " ",
                          name = std::string("killed_") + format;
        const auto expected = refined(std::string("whole_") + format, options, buffers);
        ASSERT_EQ(stop_after(name, 5, SIGKILL, options, buffers), 128 + SIGKILL);
        EXPECT_TRUE(expected == refined(name, options, buffers)) << format;
        const std::string drawn = name + "_drawn"; // with two frames finished
        ASSERT_EQ(stop_after(drawn, 4, SIGKILL, options, "street.sgrid"), 128 + SIGKILL);
        EXPECT_TRUE(expected == refined(drawn, options, "street.sgrid")) << format;
    }
    // a model that asks for it, with cameras and without
    folder_.put("model/model_index.json", R"({"defaults": {"renderer": {"frame_history": 0.6}}})");
    EXPECT_TRUE(whole == refined("said", drive, buffers));
    EXPECT_TRUE(without == refined("overruled", drive + "--frame-history 0", buffers));
    const ProgramResult blind =
        semrover_program("refine " + path(buffers) + " -m " + path("model") + " -o " + path("blind") + kSettings);
    EXPECT_EQ(blind.code, 0);
    EXPECT_NE(blind.err.find("without --path it is not known which surfaces"), std::string::npos) << blind.err;
    EXPECT_TRUE(without == results("blind"));
    const ProgramResult asked = refine("asked", "--frame-history 0.5", buffers);
    EXPECT_EQ(asked.code, 2);
    EXPECT_NE(asked.err.find("--frame-history needs the cameras"), std::string::npos) << asked.err;
}

// ---- bad input: one line, the exit code, nothing left behind

class CliRefineRefuses : public CliRefine {
  protected:
    void expect_refusal(const std::string& line, int code, std::string_view text)
    {
        const size_t entries = folder_.entries();
        const ProgramResult result = semrover_program(line);
        EXPECT_EQ(result.code, code) << line << "\n" << result.err;
        EXPECT_TRUE(result.err.starts_with("semrover: error: ")) << result.err;
        EXPECT_NE(result.err.find(text), std::string::npos) << "expected \"" << text << "\", found: " << result.err;
        EXPECT_EQ(std::ranges::count(result.err, '\n'), 1) << result.err;
        EXPECT_EQ(folder_.entries(), entries) << line << ": something was left behind";
    }
    void fill_vae_tensor(std::string_view name, float value)
    {
        const fs::path weights = folder_ / "model" / "vae" / "diffusion_pytorch_model.safetensors";
        const auto file = Safetensors::open(weights);
        std::vector<TensorData> tensors;
        std::vector<float> filled;
        for (const TensorInfo& t : file->tensors()) {
            tensors.push_back({t.name, t.dtype, t.shape, file->bytes(t)});
            if (t.name == name) {
                filled.assign(t.elements(), value);
                tensors.back() = {t.name, DType::f32, t.shape, std::as_bytes(std::span(filled))};
            }
        }
        ASSERT_FALSE(filled.empty());
        ASSERT_TRUE(write_safetensors(folder_ / "changed", tensors));
        fs::rename(folder_ / "changed", weights);
    }
};

TEST_F(CliRefineRefuses, buffers_that_are_not_whole)
{
    put_buffers(folder_ / "gap", 3, kWidth, kHeight);
    fs::remove(folder_ / "gap" / "color" / "000001.png");
    expect_refusal(arguments("out", "gap"), 3, "000001.png' is missing");
    put_buffers(folder_ / "blind", 2, kWidth, kHeight);
    fs::remove(folder_ / "blind" / "visible" / "000001.png");
    expect_refusal(arguments("out", "blind"), 3, "has no '");
    put_buffers(folder_ / "mixed", 2, kWidth, kHeight);
    put_buffers(folder_ / "wider", 2, 64, kHeight);
    fs::copy(folder_ / "wider" / "color" / "000001.png", folder_ / "mixed" / "color" / "000001.png",
             fs::copy_options::overwrite_existing);
    expect_refusal(arguments("out", "mixed"), 3, "is 64 x 40 pixels, the first frame of its camera is 56 x 40");
    expect_refusal(arguments("out") + "-W 64 -H 40", 3, "-W and -H say 64 x 40");
    fs::create_directory(folder_ / "empty");
    expect_refusal(arguments("out", "empty"), 3, "has no color/");
    expect_refusal(arguments("out", "nowhere"), 3, "nowhere");
    std::ofstream(path("in/color/000000.png")) << "no picture";
    expect_refusal(arguments("out"), 3, "expected a PNG file");
}

TEST_F(CliRefineRefuses, models_that_cannot_render)
{
    fs::remove_all(folder_ / "model" / "vae");
    expect_refusal(arguments("out"), 3, "vae");
    expect_refusal("refine " + path("in") + " -o " + path("out") + " -m " + path("nowhere"), 3, "nowhere");
}

TEST_F(CliRefineRefuses, weights_that_half_precision_cannot_hold)
{
    fill_vae_tensor("decoder.conv_out.weight", 70000);
    expect_refusal(arguments("out"), 3,
                   "tensor 'decoder.conv_out.weight' holds 70000, which F16 cannot hold: use --precision fp32");
}

TEST_F(CliRefineRefuses, results_that_are_not_numbers)
{
    // finite weights whose products are not: the decoder's last layer
    fill_vae_tensor("decoder.conv_norm_out.weight", 65000);
    const ProgramResult result = refine("out", "--frames 1:1");
    EXPECT_EQ(result.code, 70);
    EXPECT_NE(result.err.find("frame 1: the decoded frame holds "), std::string::npos) << result.err;
    EXPECT_FALSE(fs::exists(folder_ / "out" / "frames"));
}

TEST_F(CliRefineRefuses, latents_that_are_not_numbers)
{
    refined("whole", "--frames 0:0");
    const std::string line = arguments("out") + "--frames 1:2 --from " + path("whole");
    std::vector<float> latent(7 * 5 * 4, 0.5f);
    latent[17] = std::numeric_limits<float>::quiet_NaN();
    const TensorData nan{"latent", DType::f32, {5, 7, 4}, std::as_bytes(std::span(latent))};
    ASSERT_TRUE(write_safetensors(path("whole/latents/000000.safetensors"), {&nan, 1}));
    expect_refusal(line, 3, "NaN or infinity at element 17");
    const TensorData turned{"latent", DType::f32, {7, 5, 4}, std::as_bytes(std::span(latent))};
    ASSERT_TRUE(write_safetensors(path("whole/latents/000000.safetensors"), {&turned, 1}));
    expect_refusal(line, 3, "expected a latent F32 [5, 7, 4]");
    fs::remove(folder_ / "whole" / "latents" / "000000.safetensors");
    expect_refusal(line, 3, "000000.safetensors");
}

TEST_F(CliRefineRefuses, outputs_devices_and_options_that_cannot_be)
{
    const std::string line = arguments("out");
    expect_refusal("refine " + path("in") + " -m " + path("model"), 2, "-o/--output is required");
    expect_refusal(line + "--frame-noise warped", 2, "--path");
    expect_refusal(line + "--frames 2:1", 2, "--frames 2:1");
    expect_refusal(line + "--frames 0:3", 2, "--frames 0:3 is not within 0:2");
    expect_refusal(line + "--frames two", 2, "FIRST:LAST");
    expect_refusal(line + "--sampler heun", 2, "heun");
    expect_refusal("refine " + path("in") + " -m " + path("model") + " -o " + path("out") + " --steps 0", 2, "--steps");
    expect_refusal(line + "--cfg-scale=-1", 2, "--cfg-scale");
    expect_refusal(line + "--max-vram 100KiB", 5, "--max-vram");
    expect_refusal(line + "--max-vram 0.0001", 5, "--max-vram allows 100000"); // GB
    expect_refusal(line + "--max-vram lots", 2, "6GiB");
    EXPECT_EQ(semrover_program(line + "--dry-run --max-vram 2.2").code, 0);
    expect_refusal(line + "--device unobtainium", 4, "unobtainium");
    expect_refusal(line + "--quality 0", 2, "quality");
    ASSERT_TRUE(write_grid(folder_ / "street.sgrid", street()));
    expect_refusal(arguments("out", "street.sgrid"), 2, "--path is required");
    refined("done");
    expect_refusal(arguments("done") + "--seed 9", 2, "-y replaces it");
    ASSERT_EQ(stop_after("stopped", 1, SIGKILL), 128 + SIGKILL);
    expect_refusal(arguments("stopped") + "--seed 9", 3, "other settings");
    EXPECT_TRUE(refined("stopped", "--seed 9 -y") == refined("other", "--seed 9"));
}

TEST_F(CliRefine, buffers_of_a_grid_have_the_depth_that_is_asked_for)
{
    const std::string drive = put_drive({0.5, 1.1});
    refined("mm", drive, "street.sgrid");
    refined("cm", drive + " --depth cm", "street.sgrid");
    const auto mm = read_png_gray16(folder_ / "mm/buffers/depth/000001.png");
    const auto cm = read_png_gray16(folder_ / "cm/buffers/depth/000001.png");
    ASSERT_TRUE(mm && cm);
    size_t seen = 0;
    for (size_t i = 0; i < mm->pixels.size(); ++i)
        if (mm->pixels[i] && mm->pixels[i] != 65535) {
            ++seen;
            EXPECT_NEAR(cm->pixels[i], mm->pixels[i] / 10.0, 0.56);
        }
    EXPECT_GT(seen, 100u);
    const Json cameras = Json::parse(contents(folder_ / "cm/transforms.json"), nullptr, false);
    EXPECT_EQ(cameras["depth_unit_scale_factor"], 0.01);
    expect_error(refine("folder", " --depth cm"), 2, "--depth has a meaning for a grid");
}

} // namespace cli_refine_test
} // namespace semrover
