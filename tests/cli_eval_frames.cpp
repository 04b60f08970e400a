// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
#include "engine/format/image.h"
#include "engine/format/npy.h"
#include "runtime/base/json.h"
#include "tests/support/jpeg_file.h"
#include "tests/support/json_text.h"
#include "tests/support/lpips_reference.h"
#include "tests/support/png_file.h"
#include "tests/support/program.h"
#include "tools/trajectory/camera_path.h"

#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>

namespace semrover {
namespace cli_eval_frames_test {

constexpr uint32_t kWidth = 24, kHeight = 16;

ProgramResult eval(const std::string& arguments)
{
    return semrover_program("eval " + arguments);
}

struct Pictures {
    ScratchFolder folder;

    std::string operator/(std::string_view name) const { return (folder / name).string(); }
    // `left` up to column 12, `right` from there on
    void put(std::string_view name, uint8_t left, uint8_t right, uint32_t width = kWidth, bool gray = false) const
    {
        const Path path = folder / name;
        std::filesystem::create_directories(path.parent_path());
        std::vector<uint8_t> pixels;
        for (uint32_t i = 0; i < width * kHeight; ++i)
            pixels.insert(pixels.end(), gray ? 1 : 3, i % width < 12 ? left : right);
        EXPECT_TRUE(gray                         ? write_png_gray8(path, width, kHeight, pixels)
                    : path.extension() == ".jpg" ? write_jpeg_rgb8(path, width, kHeight, pixels, 95)
                                                 : write_png_rgb8(path, width, kHeight, pixels));
    }
    void put_depth(std::string_view name, uint16_t value, uint32_t width = kWidth) const
    {
        put_depths(name, value, value, width);
    }
    void put_depths(std::string_view name, uint16_t left, uint16_t right, uint32_t width = kWidth) const
    {
        const Path path = folder / name;
        std::filesystem::create_directories(path.parent_path());
        std::vector<uint16_t> pixels(size_t(width) * kHeight);
        for (size_t i = 0; i < pixels.size(); ++i)
            pixels[i] = i % width < 12 ? left : right;
        EXPECT_TRUE(write_png_gray16(path, width, kHeight, pixels));
    }
    void put_random(std::string_view name, uint32_t width, uint32_t height, uint32_t seed) const
    {
        const Path path = folder / name;
        std::filesystem::create_directories(path.parent_path());
        std::mt19937 random(seed);
        std::vector<uint8_t> pixels(size_t(width) * height * 3);
        for (uint8_t& v : pixels)
            v = uint8_t(random());
        EXPECT_TRUE(write_png_rgb8(path, width, height, pixels));
    }
};

TEST(CliEvalFrames, psnr_and_ssim_by_hand)
{
    const Pictures p;
    p.put("made/frames/000000.png", 110, 100); // as `refine` leaves them
    p.put("made/frames/000001.png", 100, 100);
    p.put("made/latents/000000.png", 1, 2);
    p.put("true/color/000000.png", 100, 100); // as `streets` does
    p.put("true/color/000001.png", 100, 100);
    p.put("true/normal/000000.png", 5, 5);
    p.put("true/shifted/color/000000.png", 5, 5);
    for (const char* name : {"000000", "000001", "000002"}) {
        p.put(fmt::format("true/visible/{}.png", name), 0, 255, kWidth, true);
        p.put(fmt::format("true/label/{}.png", name), 2, 255, kWidth, true);
    }
    const std::string folders = (p / "made") + " " + (p / "true");
    const ProgramResult result =
        eval("frames --json -q " + folders + " --visible " + (p / "true") + " --labels " + (p / "true/label"));
    ASSERT_EQ(result.code, 0) << result.err;
    const Json report = json_of(result.out);
    EXPECT_NEAR(report["psnr"].get<double>(), 10 * std::log10(65025. / 25), 1e-9); // a quarter of all pixels by 10
    EXPECT_NEAR(report["mean_psnr"].get<double>(), 10 * std::log10(65025. / 50), 1e-9);
    EXPECT_EQ(report["equal_frames"], 1);
    EXPECT_EQ(report["pixels"], 2 * kWidth * kHeight);
    EXPECT_TRUE(report["visible"]["psnr"].is_null()); // equal
    EXPECT_NEAR(report["hidden"]["psnr"].get<double>(), 10 * std::log10(65025. / 50), 1e-9);
    EXPECT_EQ(report["labels"]["building"], report["hidden"]);
    EXPECT_EQ(report["labels"]["none"], report["visible"]);
    ASSERT_EQ(report["frames"].size(), 2u);
    EXPECT_EQ(report["frames"][0]["name"], "000000");
    EXPECT_LT(report["frames"][0]["ssim"], 0.999);
    EXPECT_NEAR(report["frames"][1]["ssim"].get<double>(), 1, 1e-12);
    EXPECT_TRUE(report["frames"][1]["psnr"].is_null());
    const ProgramResult table = eval("frames -q " + folders);
    ASSERT_EQ(table.code, 0) << table.err;
    EXPECT_TRUE(table.out.starts_with("2 frames, PSNR 31.141 dB in the mean of 1 frames, 1 equal\n")) << table.out;
}

TEST(CliEvalFrames, figures_by_distance)
{
    const Pictures p;
    p.put("made/frames/000000.png", 110, 100);
    p.put("true/color/000000.png", 100, 120);
    p.put_depths("true/depth/000000.png", 5000, 30000);  // millimetres
    p.put("true/label/000000.png", 2, 13, kWidth, true); // building, car
    const std::string call = "frames -q " + (p / "made") + " " + (p / "true") + " --depth " + (p / "true");
    const Json report = json_of(eval(call + " --json --labels " + (p / "true")).out);
    ASSERT_EQ(report["distances"].size(), 4u);
    const Json &near = report["distances"][0], &far = report["distances"][3];
    EXPECT_EQ(near["to"], 6);
    EXPECT_NEAR(near["psnr"].get<double>(), 10 * std::log10(65025. / 100), 1e-9);
    EXPECT_NEAR(near["sharpness"].get<double>(), 0.5, 1e-9); // steps of 10 and of 20 between the halves
    EXPECT_NEAR(far["psnr"].get<double>(), 10 * std::log10(65025. / 400), 1e-9);
    EXPECT_TRUE(far["to"].is_null());
    EXPECT_EQ(far["labels"]["car"]["pixels"], far["pixels"]);
    EXPECT_EQ(report["distances"][1]["pixels"], 0);
    EXPECT_TRUE(report["distances"][1]["sharpness"].is_null());
    const ProgramResult table = eval(call);
    EXPECT_NE(table.out.find("0 to 6 m"), std::string::npos) << table.out;
    p.folder.put("true/transforms.json", R"({"depth_unit_scale_factor": 0.002})"); // beside depth/, whichever is named
    for (const char* folder : {"true", "true/depth"}) {
        const std::string said = "frames -q --json " + (p / "made") + " " + (p / "true") + " --depth " + (p / folder);
        const Json far_ones = json_of(eval(said).out)["distances"];
        EXPECT_EQ(far_ones[0]["pixels"], 0) << folder;
        EXPECT_EQ(far_ones[1]["pixels"], near["pixels"]) << folder;
    }
    p.put_depth("small/000000.png", 5000, 25);
    expect_error(eval("frames -q " + (p / "made") + " " + (p / "true") + " --depth " + (p / "small")), 3,
                 "000000.png' is 25 x 16 pixels, expected 24 x 16");
}

TEST(CliEvalFrames, labels_are_numbers_of_any_kind_of_picture)
{
    const Pictures p;
    p.put("made/000000.png", 110, 100);
    p.put("true/000000.png", 100, 100);
    const auto figures = [&](const std::string& more = "") {
        return eval("frames --json -q " + (p / "made") + " " + (p / "true") + " --labels " + (p / "label") + more);
    };
    const auto put = [&](int bits, int kind, uint16_t left, uint16_t right, const std::string& palette = "") {
        PngFile file{kWidth, kHeight, bits, kind, {}, palette};
        for (uint32_t i = 0; i < kWidth * kHeight; ++i) {
            const uint16_t number = i % kWidth < 12 ? left : right;
            if (bits == 16)
                file.rows += char(number >> 8);
            file.rows += char(number & 255);
        }
        std::filesystem::create_directories(p.folder / "label");
        p.folder.put("label/000000.png", file.bytes());
    };
    put(8, PngFile::kGray, 2, 13);
    const Json expect = json_of(figures().out)["labels"];
    EXPECT_EQ(expect.size(), 2u);
    EXPECT_NEAR(expect["building"]["psnr"].get<double>(), 10 * std::log10(65025. / 100), 1e-9);
    EXPECT_TRUE(expect["car"]["psnr"].is_null());
    put(16, PngFile::kGray, 2, 13);
    EXPECT_EQ(json_of(figures().out)["labels"], expect);
    put(8, PngFile::kPalette, 2, 13, std::string(3 * 20, '\x66'));
    EXPECT_EQ(json_of(figures().out)["labels"], expect);
    put(16, PngFile::kGray, 11, 26);
    expect_error(figures(), 3, "unknown labels: 26 (192 pixels); --map says what they are; found are 11 person");
    EXPECT_EQ(json_of(figures(" --map cityscapes").out)["labels"], expect);
    std::filesystem::remove(p.folder / "label/000000.png");
    NpyArray array{DType::i16, {kHeight, kWidth}, {}};
    for (uint32_t i = 0; i < kWidth * kHeight; ++i)
        array.data.insert(array.data.end(), {std::byte(i % kWidth < 12 ? 2 : 13), std::byte(0)});
    const std::vector<std::byte> file = encode_npy(array);
    p.folder.put("label/000000.npy", {reinterpret_cast<const char*>(file.data()), file.size()});
    EXPECT_EQ(json_of(figures().out)["labels"], expect);
    std::filesystem::remove(p.folder / "label/000000.npy");
    p.put("label/000000.png", 2, 13); // gray as three channels
    EXPECT_EQ(json_of(figures().out)["labels"], expect);
    ASSERT_TRUE(write_png_rgb8(p.folder / "label/000000.png", 1, 1, std::vector<uint8_t>{128, 64, 128}));
    expect_error(figures(), 3, "a picture in colour, expected class numbers");
}

TEST(CliEvalFrames, cameras_are_matched_across_the_layouts_of_refine_and_render)
{
    const Pictures p;
    p.put("made/frames/front/000000.jpg", 90, 90);
    p.put("made/frames/left/000000.jpg", 90, 90);
    p.put("true/front/color/000000.png", 100, 100);
    p.put("true/left/color/000000.png", 90, 90);
    p.put("true/left/label/000000.png", 1, 1, kWidth, true);
    const ProgramResult result = eval("frames --json -q " + (p / "made") + " " + (p / "true"));
    ASSERT_EQ(result.code, 0) << result.err;
    const Json report = json_of(result.out);
    EXPECT_EQ(report["frames"][0]["name"], "front/000000");
    EXPECT_NEAR(report["frames"][0]["psnr"].get<double>(), 20 * std::log10(25.5), 0.5);
    EXPECT_EQ(report["frames"][1]["name"], "left/000000");
}

TEST(CliEvalFrames, what_cannot_be_compared_is_one_clear_line)
{
    const Pictures p;
    p.put("a/000000.png", 1, 2);
    p.put("b/000000.png", 1, 2, kWidth + 1);
    const std::string a = p / "a", b = p / "b";
    expect_error(eval("frames -q " + a + " " + b), 3, "000000.png' is 25 x 16 pixels, expected 24 x 16");
    expect_error(eval("frames -q " + a + " " + (p / "none")), 3, "none': expected a folder, this is none");
    std::filesystem::create_directory(p.folder / "empty");
    expect_error(eval("frames -q " + (p / "empty") + " " + b), 3, "no PNG or JPEG images in it");
    p.put("b/000001.png", 1, 2);
    expect_error(eval("frames -q " + a + " " + b), 3, "a' has no picture '000001', which '");
    p.put("a/000002.png", 1, 2);
    expect_error(eval("frames -q " + a + " " + b), 3, "b' has no picture '000002', which '");
    p.put("c/000000.png", 1, 2);
    p.put("c/000000.jpg", 1, 2);
    expect_error(eval("frames -q " + (p / "c") + " " + a), 3, "are one frame: expected one picture of each name");
    p.put("small/000000.png", 1, 2, 10);
    expect_error(eval("frames -q " + (p / "small") + " " + (p / "small")), 3,
                 "is 10 x 16 pixels, expected 11 x 11 or more");
    std::filesystem::create_directory(p.folder / "broken");
    p.folder.put("broken/000000.png", "no picture");
    p.put("one/000000.png", 1, 2);
    const std::string one = p / "one";
    expect_error(eval("frames -q " + (p / "broken") + " " + one), 3, "expected a PNG or JPEG image");
    expect_error(eval("frames -q " + one + " " + one + " --visible " + (p / "empty")), 3, "no PNG or JPEG images");
    p.put("masks/000007.png", 255, 255, kWidth, true);
    expect_error(eval("frames -q " + one + " " + one + " --visible " + (p / "masks")), 3,
                 "masks' has no picture '000000'");
    p.put("masks/000000.png", 255, 255, kWidth + 3, true);
    expect_error(eval("frames -q " + one + " " + one + " --labels " + (p / "masks")), 3,
                 "is 27 x 16 pixels, expected 24 x 16");
    expect_error(eval("frames " + one), 2, "TRUTH is required");
}

TEST(CliEvalFrames, lpips_of_two_networks_and_two_sizes)
{
    const Pictures p;
    p.put_random("made/front/color/000000.png", 37, 41, 1);
    p.put_random("made/left/color/000000.png", 64, 33, 2);
    p.put_random("true/front/color/000000.png", 37, 41, 3);
    p.put_random("true/left/color/000000.png", 64, 33, 2); // equal
    const std::string folders = (p / "made") + " " + (p / "true");
    const auto picture = [&](const char* name) { return read_png_rgb8(p.folder / name).value(); };
    for (const bool vgg : {false, true}) {
        const LpipsReference reference(vgg, 16);
        reference.weights.write(p.folder / "net.safetensors");
        const ProgramResult result = eval("frames --json -q " + folders + " --lpips " + (p / "net.safetensors"));
        ASSERT_EQ(result.code, 0) << result.err;
        const Json report = json_of(result.out);
        const double expect = reference(picture("made/front/color/000000.png"), picture("true/front/color/000000.png"));
        EXPECT_NEAR(report["frames"][0]["lpips"].get<double>(), expect, 1e-5 * expect);
        EXPECT_EQ(report["frames"][1]["lpips"], 0);
        EXPECT_NEAR(report["lpips"].get<double>(), expect / 2, 1e-5 * expect);
        EXPECT_EQ(report["network"]["kind"], vgg ? "vgg" : "alex");
        EXPECT_FALSE(json_of(eval("frames --json -q " + folders).out).contains("lpips"));
        const ProgramResult table = eval("frames -q " + folders + " --lpips " + (p / "net.safetensors"));
        EXPECT_NE(table.out.find(fmt::format("\nLPIPS {:.4f} in the mean ({})\n", expect / 2, vgg ? "vgg" : "alex")),
                  std::string::npos)
            << table.out;
    }
    p.put("small/000000.png", 1, 2); // 24 x 16: VGG16 sees it, AlexNet does not
    const std::string small = (p / "small") + " " + (p / "small");
    EXPECT_EQ(eval("frames -q " + small + " --lpips " + (p / "net.safetensors")).code, 0);
    StateDict alex = LpipsReference(false, 16).weights;
    alex.write(p.folder / "net.safetensors");
    expect_error(eval("frames -q " + small + " --lpips " + (p / "net.safetensors")), 3,
                 "000000.png' is 24 x 16 pixels, expected 31 x 31 or more, what the network of LPIPS can see");
    alex.tensors.erase("features.3.bias");
    alex.write(p.folder / "net.safetensors");
    expect_error(eval("frames -q " + small + " --lpips " + (p / "net.safetensors")), 3,
                 "1 missing: features.3.bias [12]");
    expect_error(eval("frames -q " + small + " --lpips " + (p / "none.safetensors")), 3, "none.safetensors");
}

TEST(CliEvalDepth, figures_by_hand_of_pixels_and_of_frames)
{
    const Pictures p;
    p.put_depths("made/front/depth/000000.png", 5000, 0); // half of the truth
    p.put_depths("made/front/depth/000001.png", 2000, 6000);
    p.put_depths("true/front/depth/000000.png", 4000, 3000);
    p.put_depths("true/front/depth/000001.png", 2000, 65535);
    const std::string folders = (p / "made") + " " + (p / "true");
    const ProgramResult result = eval("depth --json -q " + folders);
    ASSERT_EQ(result.code, 0) << result.err;
    const Json report = json_of(result.out);
    EXPECT_EQ(report["metric"], "depth");
    EXPECT_EQ(report["true_pixels"], 36 * kHeight);
    EXPECT_EQ(report["pixels"], 24 * kHeight);
    EXPECT_NEAR(report["share"].get<double>(), 2. / 3, 1e-12);
    EXPECT_NEAR(report["abs_rel"].get<double>(), 0.125, 1e-6);
    EXPECT_NEAR(report["sq_rel"].get<double>(), 0.125, 1e-6);
    EXPECT_NEAR(report["rmse"].get<double>(), std::sqrt(0.5), 1e-6);
    EXPECT_NEAR(report["rmse_log"].get<double>(), std::log(1.25) / std::sqrt(2), 1e-6);
    EXPECT_EQ(report["delta2"], 1);
    EXPECT_NEAR(report["mean_of_frames"]["rmse"].get<double>(), 0.5, 1e-6);
    EXPECT_EQ(report["frames"][0]["name"], "front/000000");
    EXPECT_NEAR(report["frames"][0]["rmse"].get<double>(), 1, 1e-6);
    EXPECT_NEAR(report["frames"][1]["share"].get<double>(), 1, 1e-12);
    const Json capped = json_of(eval("depth --json -q --max-depth 2.5 " + folders).out);
    EXPECT_EQ(capped["true_pixels"], 12 * kHeight);
    EXPECT_EQ(capped["rmse"], 0);
    const ProgramResult table = eval("depth -q " + folders);
    EXPECT_TRUE(table.out.starts_with("2 frames, 66.67 % of 576 pixels with a true depth have one\n")) << table.out;
}

TEST(CliEvalDepth, units_and_kinds_of_both_sides)
{
    const Pictures p;
    p.put_depth("made/000000.png", 1280); // of KITTI: 5 m
    p.put_depth("true/000000.png", 5000);
    const std::string folders = (p / "made") + " " + (p / "true");
    const auto rmse = [&](const std::string& more) {
        const ProgramResult r = eval("depth --json -q " + folders + " " + more);
        EXPECT_EQ(r.code, 0) << r.err;
        return json_of(r.out)["rmse"].get<double>();
    };
    EXPECT_NEAR(rmse("--depth-scale 0.00390625 --truth-scale 0.001"), 0, 1e-6);
    EXPECT_NEAR(rmse(""), 3.72, 1e-6);
    EXPECT_NEAR(rmse("--depth-scale 0.00390625"), 5000 / 256. - 5, 1e-5); // of both
    // along rays, a plane at 5 m is farther at the sides
    const double focal = kWidth / 2 / std::tan(30 * 3.14159265358979323846 / 180);
    double squares = 0;
    for (uint32_t i = 0; i < kWidth * kHeight; ++i) {
        const double x = (i % kWidth + 0.5 - kWidth / 2.) / focal, y = (i / kWidth + 0.5 - kHeight / 2.) / focal;
        squares += std::pow(5 / std::sqrt(x * x + y * y + 1) - 5, 2);
    }
    const double expect = std::sqrt(squares / (kWidth * kHeight));
    const std::string scales = "--depth-scale 0.00390625 --truth-scale 0.001 ";
    EXPECT_NEAR(rmse(scales + "--depth-kind ray --truth-kind z --fov-x 60"), expect, 1e-5);
    EXPECT_NEAR(rmse(scales + "--truth-kind ray --fov-x 60"), expect, 1e-5);
    EXPECT_NEAR(rmse(scales + "--depth-kind ray"), 0, 1e-6); // both
    const auto refused = [&](const std::string& more, int code, std::string_view text) {
        expect_error(eval("depth -q " + folders + " " + more), code, text);
    };
    refused("--truth-kind ray", 2, "compare through the camera: --fov-x is needed");
    refused("--fov-x 60", 2, "--fov-x has no meaning for depths that are both along rays");
    refused("--depth-kind carla", 3, "expected CARLA's depth in 8-bit colours");
    refused("--max-depth 0", 2, "--max-depth");
}

TEST(CliEvalDepth, what_cannot_be_compared_is_one_clear_line)
{
    const Pictures p;
    p.put_depth("a/000000.png", 1000);
    p.put_depth("b/000000.png", 1000, kWidth + 1);
    const std::string a = p / "a", b = p / "b";
    expect_error(eval("depth -q " + a + " " + b), 3, "b/000000.png' is 25 x 16 pixels, expected 24 x 16");
    expect_error(eval("depth -q " + a + " " + (p / "none")), 3, "none': expected a folder, this is none");
    p.put_depth("b/000001.png", 1000);
    expect_error(eval("depth -q " + a + " " + b), 3, "a' has no picture '000001', which '");
    expect_error(eval("depth -q " + b + " " + a), 3, "a' has no picture '000001', which '");
    p.put_depth("c/000000.png", 0);
    expect_error(eval("depth -q " + a + " " + (p / "c")), 3, "no pixel of 1 frames can be compared: 0 have a depth");
    p.put("d/000000.png", 7, 7); // gray colours are no depth
    expect_error(eval("depth -q " + a + " " + (p / "d")), 3, "d/000000.png'");
    expect_error(eval("depth " + a), 2, "TRUTH is required");
}

TEST(CliEvalLabels, intersection_over_union_by_hand)
{
    const Pictures p;
    p.put("made/label/000000.png", 2, 13, kWidth, true); // building, car
    p.put("made/label/000001.png", 2, 2, kWidth, true);
    p.put("made/label/000002.png", 3, 13, kWidth, true);
    p.put("true/label/000000.png", 2, 13, kWidth, true);
    p.put("true/label/000001.png", 2, 13, kWidth, true);
    p.put("true/label/000002.png", 255, 13, kWidth, true);
    const std::string folders = (p / "made") + " " + (p / "true");
    const ProgramResult result = eval("labels --json -q " + folders);
    ASSERT_EQ(result.code, 0) << result.err;
    const Json report = json_of(result.out);
    const size_t half = 12 * kHeight; // of a picture
    EXPECT_EQ(report["metric"], "labels");
    EXPECT_EQ(report["pixels"], 5 * half);
    EXPECT_EQ(report["unlabelled"], half);
    EXPECT_EQ(report["classes"], 2); // what is shown where the truth is nothing does not count
    EXPECT_EQ(report["labels"].size(), 2u);
    EXPECT_NEAR(report["labels"]["building"]["iou"].get<double>(), 2. / 3, 1e-12);
    EXPECT_NEAR(report["labels"]["car"]["iou"].get<double>(), 2. / 3, 1e-12);
    EXPECT_EQ(report["labels"]["car"]["true_pixels"], 3 * half);
    EXPECT_EQ(report["labels"]["car"]["shown_pixels"], 2 * half);
    EXPECT_NEAR(report["mean_iou"].get<double>(), 2. / 3, 1e-12);
    EXPECT_NEAR(report["accuracy"].get<double>(), 0.8, 1e-12);
    EXPECT_EQ(report["confusion"]["car"]["building"], half);
    EXPECT_FALSE(report["confusion"]["building"].contains("car"));
    EXPECT_NEAR(report["frames"][1]["mean_iou"].get<double>(), 0.25, 1e-12);
    const ProgramResult table = eval("labels -q " + folders);
    EXPECT_TRUE(table.out.starts_with("3 frames, mean IoU 0.6667 of 2 classes, 80.00 % of 960 pixels right\n"))
        << table.out;
}

TEST(CliEvalLabels, maps_of_either_side_and_what_cannot_be_compared)
{
    const Pictures p;
    p.put("a/000000.png", 11, 26, kWidth, true); // Cityscapes: building, car
    p.put("b/000000.png", 2, 13, kWidth, true);
    const std::string a = p / "a", b = p / "b";
    const std::string ours = p.folder.put("ours.json", R"({"2": "building", "13": "car"})").string();
    EXPECT_EQ(json_of(eval("labels --json -q --map cityscapes " + a + " " + a).out)["mean_iou"], 1);
    EXPECT_EQ(
        json_of(eval("labels --json -q --map cityscapes --truth-map " + ours + " " + a + " " + b).out)["mean_iou"], 1);
    EXPECT_EQ(json_of(eval("labels --json -q --truth-map cityscapes " + b + " " + a).out)["mean_iou"], 1);
    expect_error(eval("labels -q " + a + " " + b), 3, "a': unknown labels: 26 (192 pixels)");
    expect_error(eval("labels -q " + b + " " + a), 3, "unknown labels: 26 (192 pixels)");
    p.put("b/000001.png", 2, 13, kWidth, true);
    expect_error(eval("labels -q " + a + " " + b), 3, "a' has no picture '000001', which '");
    p.put("wide/000000.png", 2, 13, kWidth + 1, true);
    p.put("one/000000.png", 2, 13, kWidth, true);
    expect_error(eval("labels -q " + (p / "one") + " " + (p / "wide")), 3,
                 "wide/000000.png' is 25 x 16 pixels, expected 24 x 16");
    p.put("none/000000.png", 255, 255, kWidth, true);
    expect_error(eval("labels -q " + (p / "one") + " " + (p / "none")), 3, "no pixel of 1 frames has a class in");
    ASSERT_TRUE(write_png_rgb8(p.folder / "none/000000.png", 1, 1, std::vector<uint8_t>{128, 64, 128}));
    expect_error(eval("labels -q " + (p / "none") + " " + (p / "one")), 3, "a picture in colour");
}

// three frames, 0.1 m apart to the right, before a wall at 2 m with a focal length of 20: a pixel each
void put_drive(const Pictures& p, uint8_t change)
{
    CameraPath path;
    for (uint32_t i = 0; i < 3; ++i) {
        CameraFrame frame;
        frame.time = i;
        frame.intrinsics = {20, 20, 12, 8, kWidth, kHeight};
        frame.pose.world_to_camera[3] = -0.1 * i;
        path.frames.push_back(frame);
        const std::string name = fmt::format("{:06}.png", i);
        p.put_depth("drive/depth/" + name, 2000);
        p.put("made/" + name, uint8_t(100 + change * i), uint8_t(100 + change * i));
        p.put("drive/color/" + name, 100, 100);
    }
    EXPECT_TRUE(write_transforms(p.folder / "drive/transforms.json", path));
    EXPECT_TRUE(write_tum(p.folder / "drive/drive.tum", path));
}

TEST(CliEvalFlicker, change_without_cause_is_measured_and_the_truth_beside_it)
{
    const Pictures p;
    put_drive(p, 4);
    const std::string drive = p / "drive";
    const ProgramResult result = eval("flicker --json -q " + (p / "made") + " --depth " + drive + " --path " + drive +
                                      "/transforms.json --truth " + drive);
    ASSERT_EQ(result.code, 0) << result.err;
    const Json report = json_of(result.out);
    EXPECT_NEAR(report["mean"].get<double>(), 4, 1e-9);
    EXPECT_NEAR(report["rms"].get<double>(), 4, 1e-9);
    EXPECT_NEAR(report["share"].get<double>(), 23. / 24, 1e-9); // a column has left the picture
    EXPECT_NEAR(report["truth"]["mean"].get<double>(), 0, 1e-9);
    ASSERT_EQ(report["pairs"].size(), 2u);
    EXPECT_EQ(report["pairs"][1]["from"], "000001");
    EXPECT_EQ(report["pairs"][1]["valid"], 23 * kHeight);
    // a path without intrinsics: --fov-x, and the size of the pictures
    const double fov = 2 * std::atan(12. / 20) * 180 / 3.14159265358979323846;
    const ProgramResult tum = eval(fmt::format("flicker --json -q {} --depth {}/depth --path {}/drive.tum --fov-x {}",
                                               p / "made", drive, drive, fov));
    ASSERT_EQ(tum.code, 0) << tum.err;
    EXPECT_NEAR(json_of(tum.out)["mean"].get<double>(), 4, 1e-9);
    const ProgramResult table =
        eval("flicker -q " + (p / "made") + " --depth " + drive + " --path " + drive + "/transforms.json");
    EXPECT_TRUE(table.out.starts_with("2 pairs of frames, 95.8 % of pixels can be compared\n")) << table.out;
    // depth in another unit, which transforms.json beside it says
    CameraPath both = *read_transforms(p.folder / "drive/transforms.json");
    TransformsFiles files{[](const std::string& camera, uint32_t i) { return rendered_pictures(camera, i); }, "", 0.01};
    EXPECT_TRUE(write_transforms(p.folder / "drive/transforms.json", both, files));
    for (const uint32_t i : {0, 1, 2})
        p.put_depth(fmt::format("drive/depth/{:06}.png", i), 200);
    for (const char* where : {"", "/depth"}) {
        const ProgramResult cm = eval("flicker --json -q " + (p / "made") + " --depth " + drive + where + " --path " +
                                      drive + "/transforms.json");
        ASSERT_EQ(cm.code, 0) << cm.err;
        EXPECT_NEAR(json_of(cm.out)["mean"].get<double>(), 4, 1e-9);
    }
    // part of a drive: only neighbours of the path are pairs
    std::filesystem::remove(p.folder / "made/000002.png");
    const ProgramResult part =
        eval("flicker --json -q " + (p / "made") + " --depth " + drive + " --path " + drive + "/transforms.json");
    ASSERT_EQ(part.code, 0) << part.err;
    EXPECT_EQ(json_of(part.out)["pairs"].size(), 1u);
}

TEST(CliEvalFlicker, what_does_not_fit_together_is_one_clear_line)
{
    const Pictures p;
    put_drive(p, 0);
    const std::string drive = p / "drive", path = " --path " + drive + "/transforms.json", made = p / "made";
    const auto flicker = [&](const std::string& rest) { return eval("flicker -q " + rest); };
    expect_error(flicker(made + path), 2, "--depth is required");
    expect_error(flicker(made + " --depth " + drive), 2, "--path is required");
    expect_error(flicker(made + " --depth " + drive + " --path " + (p / "none.json")), 3, "none.json");
    expect_error(flicker(made + " --depth " + (p / "none") + path), 3, "expected a folder");
    expect_error(flicker(made + " --depth " + drive + "/color" + path), 3, "expected a PNG of 16-bit gray");
    expect_error(flicker(made + " --depth " + drive + path + " --tolerance 0"), 2, "--tolerance");
    p.put("one/000001.png", 1, 2);
    expect_error(flicker((p / "one") + " --depth " + drive + path), 3, "expected two or more, one after the other");
    p.put("one/000009.png", 1, 2);
    p.put_depth("depth9/000001.png", 2000);
    expect_error(flicker((p / "one") + " --depth " + (p / "depth9") + path), 3, "has no picture '000009'");
    p.put_depth("depth9/000009.png", 2000);
    expect_error(flicker((p / "one") + " --depth " + (p / "depth9") + path), 3,
                 "holds 2 pictures, 1 of them frames of");
    p.put_depth("wide/000000.png", 2000, kWidth + 2);
    p.put_depth("wide/000001.png", 2000, kWidth + 2);
    p.put_depth("wide/000002.png", 2000, kWidth + 2);
    expect_error(flicker(made + " --depth " + (p / "wide") + path), 3,
                 "000000.png' is 26 x 16 pixels, the camera of the path has 24 x 16");
    p.put("made/000001.png", 1, 2, kWidth + 1);
    expect_error(flicker(made + " --depth " + drive + path), 3, "000001.png' is 25 x 16 pixels, expected 24 x 16");
    p.put("made/000001.png", 100, 100);
    expect_error(flicker(made + " --depth " + drive + path + " --truth " + (p / "one")), 3, "has no picture '000000'");
    for (const char* name : {"empty/000000.png", "empty/000001.png", "empty/000002.png"})
        p.put_depth(name, 0);
    expect_error(flicker(made + " --depth " + (p / "empty") + path), 3, "no pixel of 2 pairs can be compared");
    p.folder.put("short.json", "{\"frames\": []}");
    expect_error(flicker(made + " --depth " + drive + " --path " + (p / "short.json")), 3, "short.json");
}

// the picture's step is between columns 11 and 12, those of labels are beside it
TEST(CliEvalFrames, edges_by_hand)
{
    const Pictures p;
    const auto put_labels = [&](std::string_view name, uint32_t first) {
        std::vector<uint8_t> classes;
        for (uint32_t i = 0; i < kWidth * kHeight; ++i)
            classes.push_back(i % kWidth < first ? 2 : 13);
        std::filesystem::create_directories((p.folder / "labels"));
        EXPECT_TRUE(write_png_gray8(p.folder / "labels" / name, kWidth, kHeight, classes));
    };
    p.put("frames/000000.png", 100, 140);
    put_labels("000000.png", 12); // there
    p.put("frames/000001.png", 100, 140);
    put_labels("000001.png", 14); // two pixels away
    p.put("frames/000002.png", 100, 105);
    put_labels("000002.png", 12); // no edge
    const ProgramResult result = eval("edges --json " + p / "frames" + " " + p / "labels");
    ASSERT_EQ(result.code, 0) << result.err;
    const Json report = Json::parse(result.out);
    EXPECT_EQ(report["borders"], 3 * kHeight);
    for (const auto& [pixels, edges] : {std::pair{0, 1.0}, {1, 1.0}, {2, 2.0}, {8, 2.0}})
        EXPECT_NEAR(report["within"][pixels].get<double>(), edges / 3, 1e-12);
    EXPECT_NEAR(report["step"].get<double>(), (40.0 + 0 + 5) / 3, 1e-9);
    EXPECT_NEAR(report["step_beside"].get<double>(), (40.0 + 40 + 5) / 3 / 17, 1e-9);
    EXPECT_EQ(report["labels"]["building"]["borders"], 3 * kHeight);
    EXPECT_EQ(report["labels"].size(), 2u);
}

} // namespace cli_eval_frames_test
} // namespace semrover
