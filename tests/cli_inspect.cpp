// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
#include "runtime/base/json.h"
#include "tests/support/json_text.h"
#include "tests/support/program.h"
#include "tests/support/renderer_weights.h"
#include "tests/support/safetensors_bytes.h"

#include <algorithm>
#include <gtest/gtest.h>

namespace semrover {
namespace cli_inspect_test {

const std::string kAssets = SEMROVER_SOURCE_DIR "/assets";

TEST(CliInspect, a_grid_shows_its_cells_and_labels)
{
    const ProgramResult text = semrover_program("inspect " + kAssets + "/scenes/street.truth.sgrid");
    EXPECT_EQ(text.code, 0);
    EXPECT_EQ(text.err, "");
    EXPECT_NE(text.out.find("vegetation  788"), std::string::npos) << text.out;
    const ProgramResult result = semrover_program("inspect --json " + kAssets + "/scenes/street.semantic.sgrid");
    const auto json = json_of(result.out);
    EXPECT_EQ(json["cells"], 3710);
    EXPECT_EQ(json["voxel_size"], 0.6);
    EXPECT_EQ(json["labels"]["road"], 416);
    EXPECT_EQ(json["points"], 0);
    EXPECT_EQ(json["extent"]["max_m"], nlohmann::json({30.6, 12.6, 9.6}));
}

TEST(CliInspect, a_model_shows_components_config_and_weights)
{
    const ProgramResult result = semrover_program("--json inspect " + kAssets + "/model");
    ASSERT_EQ(result.code, 0) << result.err;
    const auto json = json_of(result.out);
    const auto& transformer = json["components"]["voxfield_transformer"];
    EXPECT_EQ(transformer["class"], "VoxfieldTransformer");
    EXPECT_EQ(transformer["config"]["num_layers"], 6);
    EXPECT_EQ(transformer["weights"]["dtypes"]["F16"], 178);
    EXPECT_EQ(transformer["weights"]["list"].size(), 178u);
    EXPECT_EQ(transformer["weights"]["parameters"], 7862328);
    EXPECT_EQ(transformer["weights"]["bytes"], 2 * 7862328);
    EXPECT_EQ(transformer["adapter"]["parameters"], 1844736);
    const int renderer = 12738180, vae = 1424155, text = 32;
    EXPECT_EQ(json["parameters"], 7862328 + 1844736 + renderer + vae + text);
    EXPECT_EQ(json["bytes"], 2 * (7862328 + 1844736 + renderer + vae + text));
    const ProgramResult shown = semrover_program("inspect " + kAssets + "/model");
    EXPECT_NE(shown.out.find("parameters  7862328"), std::string::npos);
    EXPECT_EQ(shown.out.find("proj_in.weight"), std::string::npos); // the list needs -v
    EXPECT_NE(semrover_program("inspect -v " + kAssets + "/model").out.find("proj_in.weight"), std::string::npos);
}

TEST(CliInspect, a_model_without_a_component_and_a_single_component_are_shown_too)
{
    const ScratchFolder folder;
    folder.put("model_index.json", R"({"a":["x","Unet"],"b":[null,null],"c":false,"d":["x","Scheduler"]})");
    std::filesystem::create_directory(folder / "d");
    folder.put("d/scheduler_config.json", R"({"beta_end":1})");
    const ProgramResult model = semrover_program("inspect --json " + folder.path().string());
    ASSERT_EQ(model.code, 0) << model.err;
    const auto json = json_of(model.out);
    EXPECT_TRUE(json["components"]["a"].contains("missing"));
    EXPECT_EQ(json["components"].size(), 2u);
    EXPECT_EQ(json["components"]["d"]["config"]["beta_end"], 1);
    const ProgramResult part = semrover_program("inspect " + kAssets + "/model/voxfield_transformer");
    EXPECT_NE(part.out.find("num_layers"), std::string::npos);
}

TEST(CliInspect, a_checkpoint_says_what_it_is_and_whether_it_can_render)
{
    const ScratchFolder folder;
    UnetConfig unet = small_unet();
    ldm_weights(unet, small_vae()).write(folder / "ldm.safetensors", DType::f16);
    const ProgramResult ldm = semrover_program("inspect --json " + (folder / "ldm.safetensors").string());
    ASSERT_EQ(ldm.code, 0) << ldm.err;
    const auto json = json_of(ldm.out);
    EXPECT_EQ(json["kind"], "Stable Diffusion-like single file (LDM)");
    EXPECT_EQ(json["unet"]["config"], unet_config_json(unet));
    EXPECT_EQ(json["unet"]["deferred_renderer"], "ready (13 input channels)");
    EXPECT_EQ(json["vae"]["config"], vae_config_json(small_vae()));
    EXPECT_EQ(json["unet"]["parameters"].get<int>() + json["vae"]["parameters"].get<int>(), json["parameters"]);

    unet.in_channels = 4;
    unet.cross_attention_dim = 768;
    Weights w = ldm_weights(unet, small_vae(), "none.");
    w.write(folder / "plain.safetensors");
    const ProgramResult plain = semrover_program("inspect " + (folder / "plain.safetensors").string());
    EXPECT_NE(plain.out.find("Stable Diffusion 1.x single file (LDM)"), std::string::npos);
    EXPECT_NE(plain.out.find("no: a plain UNet (4 input channels)"), std::string::npos);
    EXPECT_NE(plain.out.find("vae         none"), std::string::npos) << plain.out.substr(0, 2000);

    UnetConfig video = small_video_unet();
    ldm_weights(video, small_video_vae()).write(folder / "video.safetensors", DType::f16);
    const auto svd = json_of(semrover_program("inspect --json " + (folder / "video.safetensors").string()).out);
    EXPECT_EQ(svd["kind"], "Stable Video Diffusion single file (LDM)");
    EXPECT_EQ(svd["unet"]["deferred_renderer"], "ready, of videos (9 input channels)");
    EXPECT_EQ(svd["unet"]["config"], unet_config_json(video));
    EXPECT_EQ(svd["vae"]["config"], vae_config_json(small_video_vae()));

    const std::string golden = SEMROVER_SOURCE_DIR "/tests/golden/";
    for (const auto& [name, kind] : {std::pair{"unet_asd_tiny/model", "UNet2DConditionModel"},
                                     std::pair{"unet_vsd_tiny/model", "UNetSpatioTemporalConditionModel"},
                                     std::pair{"vae_tiny/model", "AutoencoderKL"},
                                     std::pair{"vae_temporal_tiny/model", "AutoencoderKLTemporalDecoder"},
                                     std::pair{"transformer_tiny/model", "VoxfieldTransformer"}}) {
        const auto part = json_of(semrover_program("inspect --json " + golden + name).out);
        EXPECT_EQ(part["weights"]["kind"], kind);
    }
}

TEST(CliInspect, a_renderer_of_videos_says_how_drives_are_cut)
{
    const ScratchFolder folder;
    const std::filesystem::path golden = SEMROVER_SOURCE_DIR "/tests/golden/vsd_window_tiny/model";
    std::filesystem::copy(golden / "unet", folder / "renderer");
    std::filesystem::copy(golden / "vae", folder / "vae");
    folder.put("model_index.json", R"({"renderer": ["diffusers", "UNetSpatioTemporalConditionModel"],
        "defaults": {"renderer": {"window_overlap": 3, "frame_correlation": 0}}})");
    const auto json = json_of(semrover_program("inspect --json " + folder.path().string()).out);
    EXPECT_EQ(json["components"]["renderer"]["weights"]["deferred_renderer"], "ready, of videos (9 input channels)");
    EXPECT_EQ(json["video"]["window_frames"], 6);
    EXPECT_EQ(json["video"]["window_overlap"], 3);
    EXPECT_EQ(json["video"]["frame_correlation"], 0);
    EXPECT_EQ(json["video"]["decode_frames"], 2);
    EXPECT_EQ(json["video"]["guidance_scale"], nlohmann::json({1, 3}));
    EXPECT_EQ(json["video"]["sampler"], "euler");
    EXPECT_FALSE(json_of(semrover_program("inspect --json " + kAssets + "/model").out).contains("video"));
}

TEST(CliInspect, what_it_cannot_show_ends_with_one_line_and_code_3)
{
    const ScratchFolder folder;
    expect_error(semrover_program("inspect " + (folder / "none").string()), 3, "No such file");
    expect_error(semrover_program("inspect " + folder.path().string()), 3,
                 "is a folder without files; expected a trajectory");
    expect_error(semrover_program("inspect " + folder.put("m.ckpt", "x").string()), 3, "convert it with Python");
    expect_error(semrover_program("inspect " + folder.put("g.sgrid", safetensors_bytes("{}")).string()), 3,
                 "2 missing: cells [0, 3], labels [0]");
    expect_error(semrover_program("inspect " + folder.put("x.safetensors", "short").string()), 3, "found only 5 bytes");
    folder.put("model_index.json", R"({"../up":["x","Unet"]})");
    expect_error(semrover_program("inspect " + folder.path().string()), 3, "no name of a component's folder");
    expect_error(semrover_program("inspect " + kAssets + "/scenes/street.truth.sgrid >/dev/full"), 3,
                 "cannot write to standard output");
}

TEST(CliInspect, names_from_a_file_cannot_steer_the_terminal)
{
    const ScratchFolder folder;
    const auto file = folder.put("x", safetensors_bytes(R"({"__metadata__":{"k":"a\u001b[31m\nb"}})"));
    const ProgramResult result = semrover_program("inspect " + file.string());
    EXPECT_EQ(result.out.find('\x1b'), std::string::npos);
    EXPECT_NE(result.out.find("a\\x1b[31m\\x0ab"), std::string::npos) << result.out;
}

TEST(Cli, a_usage_error_ends_with_code_2)
{
    expect_error(semrover_program(""), 2, "no command given");
    expect_error(semrover_program("dance"), 2, "dance");
    expect_error(semrover_program("inspect"), 2, "FILE|DIR is required");
    expect_error(semrover_program("inspect --sideways x"), 2, "sideways");
    expect_error(semrover_program("inspect x --max-vram lots"), 2, "max-vram");
}

TEST(Cli, help_and_version_end_with_code_0)
{
    EXPECT_EQ(semrover_program("--version").code, 0);
    const ProgramResult help = semrover_program("--help");
    EXPECT_EQ(help.code, 0);
    EXPECT_NE(help.out.find("inspect"), std::string::npos);
    EXPECT_EQ(semrover_program("inspect --help").code, 0);
}

} // namespace cli_inspect_test
} // namespace semrover
