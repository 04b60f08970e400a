// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
#include "engine/format/image.h"
#include "tests/support/jpeg_file.h"
#include "tests/support/refine_case.h"

#include <cmath>
#include <csignal>

namespace semrover {
namespace cli_refine_frames_test {

class CliRefineFrames : public RefineCase {};

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
TEST_F(CliRefineFrames, weights_of_8_bits_take_half_the_memory_and_give_nearly_the_same_frames)
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

TEST_F(CliRefineFrames, frames_can_be_jpegs_and_videos)
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

TEST_F(CliRefineFrames, buffers_may_have_jpegs_of_one_kind_and_any_threads_write_the_same)
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

TEST_F(CliRefineFrames, straight_from_a_grid_is_render_and_refine)
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

TEST_F(CliRefineFrames, splats_are_as_wide_as_the_model_says_unless_the_option_says_otherwise)
{
    const std::string drive = put_drive({0});
    const auto narrow = refined("narrow", drive, "street.sgrid");
    const auto wide = refined("wide", drive + "--splat-radius auto", "street.sgrid");
    EXPECT_FALSE(narrow == wide);
    folder_.put("model/model_index.json", R"({"defaults": {"renderer": {"splat_radius": "auto"}}})");
    EXPECT_TRUE(wide == refined("said", drive, "street.sgrid"));
    EXPECT_TRUE(narrow == refined("overruled", drive + "--splat-radius 0.04", "street.sgrid"));
}

TEST_F(CliRefineFrames, noise_stays_on_surfaces_where_the_model_or_the_option_says_so)
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

TEST_F(CliRefineFrames, depth_is_in_the_unit_that_lies_beside_it)
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

TEST_F(CliRefineFrames, finished_frames_take_a_share_of_the_one_before_and_latents_do_not)
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

TEST_F(CliRefineFrames, buffers_of_a_grid_have_the_depth_that_is_asked_for)
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

} // namespace cli_refine_frames_test
} // namespace semrover
