// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
#include "tests/support/refine_case.h"

#include <algorithm>
#include <csignal>
#include <fstream>
#include <limits>

namespace semrover {
namespace cli_refine_refuses_test {

// ---- bad input: one line, the exit code, nothing left behind

class CliRefineRefuses : public RefineCase {
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

} // namespace cli_refine_refuses_test
} // namespace semrover
