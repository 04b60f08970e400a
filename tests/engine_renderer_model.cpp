// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/model/renderer_model.h"
#include "tests/support/json_text.h"
#include "tests/support/renderer_weights.h"
#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"

namespace semrover {
namespace engine_renderer_model_test {

namespace fs = std::filesystem;

const std::string kFile = "diffusion_pytorch_model.safetensors";

// a complete model in the diffusers layout
void put_model(const Path& folder, const UnetConfig& unet = small_unet(), const char* renderer = "renderer")
{
    Weights unet_weights, vae_weights, conditioning;
    unet_weights.add(unet_schema(unet));
    unet_weights.write(folder / renderer / kFile);
    EXPECT_TRUE(write_json(folder / renderer / "config.json", unet_config_json(unet)));
    vae_weights.add(vae_schema(small_vae()));
    vae_weights.write(folder / "vae" / kFile);
    EXPECT_TRUE(write_json(folder / "vae" / "config.json", vae_config_json(small_vae())));
    conditioning.add("encoder_hidden_states", {"c", {1, 5, unet.cross_attention_dim}});
    conditioning.write(folder / "conditioning" / "conditioning.safetensors", DType::f16);
    EXPECT_TRUE(write_json(folder / "scheduler" / "scheduler_config.json", stable_diffusion_scheduler_json()));
}

TEST(RendererModel, a_folder_gives_configs_scheduler_text_and_defaults)
{
    const ScratchFolder folder;
    put_model(folder.path());
    EXPECT_TRUE(write_json(
        folder / "model_index.json",
        {{"_class_name", "SemRoverPipeline"},
         {"defaults",
          {{"num_inference_steps", 99},
           {"renderer", {{"num_inference_steps", 7}, {"previous_noise", 0.5}, {"frame_noise", "warped"}}}}}}));
    const auto m = RendererModel::open(folder.path());
    ASSERT_TRUE(m) << m.error().message;
    EXPECT_EQ(m->warnings, std::vector<std::string>());
    EXPECT_EQ(m->unet.in_channels, 13u);
    EXPECT_EQ(m->vae.downscale(), 4u);
    EXPECT_EQ(m->scheduler.sampler, Sampler::ddim);
    EXPECT_EQ(m->conditioning_tokens, 5u);
    ASSERT_EQ(m->conditioning.size(), 5u * 24);
    EXPECT_NE(m->conditioning[7], 0);
    EXPECT_EQ(m->defaults.num_inference_steps, 7);
    EXPECT_EQ(m->defaults.guidance_scale, 1.5f);
    EXPECT_EQ(m->defaults.previous_noise, 0.5f);
    EXPECT_EQ(m->defaults.frame_noise, FrameNoise::warped);
    EXPECT_EQ(m->defaults.splat_radius, 0.04f);
    EXPECT_TRUE(m->open_unet()->require(unet_schema(m->unet)));
    EXPECT_TRUE(m->open_vae()->require(vae_schema(m->vae)));
    EXPECT_EQ(RendererModel::open(folder.path(), Sampler::dpmpp_2m)->scheduler.sampler, Sampler::dpmpp_2m);
    const auto hash = m->hash();
    ASSERT_TRUE(hash);
    EXPECT_TRUE(write_json(folder / "scheduler" / "scheduler_config.json", {{"_class_name", "DDPMScheduler"}}));
    EXPECT_NE(*RendererModel::open(folder.path())->hash(), *hash);
}

TEST(RendererModel, a_model_index_that_is_no_object_is_refused)
{
    const ScratchFolder folder;
    put_model(folder.path());
    folder.put("model_index.json", "[1]");
    const auto m = RendererModel::open(folder.path());
    EXPECT_TRUE(says(m, "model_index.json': expected an object, found array"));
}

TEST(RendererModel, says_how_wide_the_splats_of_its_buffers_are)
{
    const ScratchFolder folder;
    put_model(folder.path());
    const auto radius = [&](const nlohmann::json& value) {
        EXPECT_TRUE(write_json(folder / "model_index.json", {{"defaults", {{"renderer", {{"splat_radius", value}}}}}}));
        return RendererModel::open(folder.path());
    };
    EXPECT_EQ(radius(0.1)->defaults.splat_radius, 0.1f);
    EXPECT_EQ(radius("auto")->defaults.splat_radius, std::nullopt);
    for (const nlohmann::json& wrong :
         {nlohmann::json(0), nlohmann::json(-1), nlohmann::json(100), nlohmann::json("wide"), nlohmann::json(true)})
        EXPECT_TRUE(says(radius(wrong), "supported: metres (0..100) or \"auto\"")) << wrong;
}

TEST(RendererModel, without_scheduler_and_text_stable_diffusions_stand_in)
{
    const ScratchFolder folder;
    put_model(folder.path(), small_unet(), "unet");
    fs::remove_all(folder / "conditioning");
    fs::remove_all(folder / "scheduler");
    const auto m = RendererModel::open(folder.path());
    ASSERT_TRUE(m) << m.error().message;
    ASSERT_EQ(m->warnings.size(), 1u);
    EXPECT_NE(m->warnings[0].find("zeros stand for the text"), std::string::npos);
    EXPECT_EQ(m->conditioning, std::vector<float>(77 * 24, 0.f));
    const SchedulerConfig& s = m->scheduler;
    EXPECT_EQ(s.sampler, Sampler::ddim);
    EXPECT_EQ(s.beta_schedule, BetaSchedule::scaled_linear);
    EXPECT_EQ(s.beta_start, 0.00085);
    EXPECT_EQ(s.beta_end, 0.012);
    EXPECT_EQ(s.prediction, Prediction::epsilon);
    EXPECT_EQ(s.steps_offset, 1);
    EXPECT_FALSE(s.set_alpha_to_one);
    EXPECT_FALSE(s.clip_sample);
}

TEST(RendererModel, pndm_gives_way_to_ddim)
{
    const ScratchFolder folder;
    put_model(folder.path());
    Json pndm = stable_diffusion_scheduler_json();
    pndm["_class_name"] = "PNDMScheduler";
    EXPECT_TRUE(write_json(folder / "scheduler" / "scheduler_config.json", pndm));
    const auto m = RendererModel::open(folder.path());
    ASSERT_TRUE(m) << m.error().message;
    EXPECT_EQ(m->scheduler.sampler, Sampler::ddim);
    EXPECT_EQ(m->warnings.size(), 1u);
}

TEST(RendererModel, an_adapter_that_is_not_read_is_named)
{
    const ScratchFolder folder;
    put_model(folder.path());
    ASSERT_TRUE(RendererModel::open(folder.path())->warnings.empty());
    folder.put("pytorch_lora_weights.safetensors", "x");
    const auto m = RendererModel::open(folder.path());
    ASSERT_TRUE(m) << m.error().message;
    ASSERT_EQ(m->warnings.size(), 1u);
    EXPECT_NE(m->warnings[0].find("pytorch_lora_weights.safetensors': an adapter (LoRA), which a renderer does not"),
              std::string::npos);
}

TEST(RendererModel, an_ldm_file_is_a_model_too)
{
    const ScratchFolder folder;
    ldm_weights(small_unet(), small_vae()).write(folder / "m.safetensors", DType::f16);
    const auto m = RendererModel::open(folder / "m.safetensors");
    ASSERT_TRUE(m) << m.error().message;
    EXPECT_EQ(unet_config_json(m->unet), unet_config_json(small_unet()));
    EXPECT_TRUE(m->open_vae()->require(vae_schema(m->vae)));
    EXPECT_EQ(m->warnings.size(), 1u); // no text
    EXPECT_TRUE(m->hash());
}

TEST(RendererModel, what_is_missing_is_named)
{
    const ScratchFolder folder;
    EXPECT_TRUE(says(RendererModel::open(folder.path()), "has no renderer: expected renderer/config.json or unet/"));
    folder.put("x.safetensors", "");
    EXPECT_TRUE(says(RendererModel::open(folder.path()), "if 'x.safetensors' is a single-file checkpoint, give the"));
    folder.put("model.ckpt", "");
    EXPECT_TRUE(says(RendererModel::open(folder.path()), "convert it with Python"));
    EXPECT_TRUE(says(RendererModel::open(folder / "model.ckpt"), "state_dict"));
    EXPECT_TRUE(says(RendererModel::open(folder / "none"), "No such file"));
    put_model(folder.path());
    fs::remove_all(folder / "vae");
    fs::remove(folder / "model.ckpt");
    fs::remove(folder / "x.safetensors");
    EXPECT_TRUE(says(RendererModel::open(folder.path()), "has no VAE: expected vae/config.json"));
    put_model(folder.path());
    fs::rename(folder / "renderer" / kFile, folder / "renderer" / "diffusion_pytorch_model.bin");
    EXPECT_TRUE(says(RendererModel::open(folder.path()), "convert it with Python"));

    Weights w = ldm_weights(small_unet(), small_vae(), "other.");
    w.write(folder / "no_vae.safetensors");
    EXPECT_TRUE(says(RendererModel::open(folder / "no_vae.safetensors"), "has no VAE"));
    EXPECT_TRUE(says(RendererModel::open(folder / "vae" / kFile), "has no renderer"));
}

TEST(RendererModel, a_unet_of_other_channels_is_refused)
{
    const ScratchFolder folder;
    UnetConfig unet = small_unet();
    unet.in_channels = 4;
    put_model(folder.path(), unet);
    EXPECT_TRUE(says(RendererModel::open(folder.path()), "`asd_init`"));
    EXPECT_TRUE(RendererModel::read(folder.path()));
    ldm_weights(unet, small_vae()).write(folder / "m.safetensors");
    EXPECT_TRUE(says(RendererModel::open(folder / "m.safetensors"), "previous latent (4), buffer latent (4)"));
    unet.in_channels = 9;
    put_model(folder.path(), unet);
    EXPECT_TRUE(says(RendererModel::open(folder.path()), "in_channels is 9, expected 13"));
    unet.in_channels = 13;
    unet.out_channels = 8;
    put_model(folder.path(), unet);
    EXPECT_TRUE(says(RendererModel::open(folder.path()), "out_channels is 8"));
}

TEST(RendererModel, files_that_do_not_fit_are_refused_before_a_device_is_touched)
{
    const ScratchFolder folder;
    put_model(folder.path());
    UnetConfig wider = small_unet();
    wider.cross_attention_dim = 32;
    EXPECT_TRUE(write_json(folder / "renderer" / "config.json", unet_config_json(wider)));
    EXPECT_TRUE(
        says(RendererModel::open(folder.path()), "encoder_hidden_states is [1, 5, 24], expected [1, 1..4096, 32]"));
    fs::remove_all(folder / "conditioning");
    EXPECT_TRUE(says(RendererModel::open(folder.path()), "22 misshapen"));
    EXPECT_TRUE(write_json(folder / "renderer" / "config.json", {{"class_embed_type", "timestep"}}));
    EXPECT_TRUE(
        says(RendererModel::open(folder.path()), "config.json': unet config: class_embed_type is \"timestep\""));
    put_model(folder.path());
    EXPECT_TRUE(write_json(folder / "model_index.json", {{"defaults", {{"renderer", {{"guidance_scale", -1}}}}}}));
    EXPECT_TRUE(says(RendererModel::open(folder.path()), "defaults.renderer: guidance_scale is -1"));
    EXPECT_TRUE(write_json(folder / "model_index.json", {{"defaults", 7}}));
    EXPECT_TRUE(says(RendererModel::open(folder.path()), "expected a JSON object"));
}

} // namespace engine_renderer_model_test
} // namespace semrover
