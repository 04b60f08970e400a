// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/model/checkpoint.h"
#include "engine/model/unet_config.h"
#include "engine/model/vae_config.h"
#include "runtime/base/json.h"
#include "tests/support/json_text.h"
#include "tests/support/says.h"

#include <map>

namespace semrover {
namespace engine_renderer_configs_test {

const std::string kGolden = SEMROVER_SOURCE_DIR "/tests/golden/";

using Shapes = std::map<std::string, std::vector<uint64_t>>;

Shapes shapes_of(std::span<const TensorSpec> schema)
{
    Shapes shapes;
    for (const TensorSpec& spec : schema)
        EXPECT_TRUE(shapes.emplace(spec.name, spec.shape).second) << spec.name << " twice";
    return shapes;
}

Shapes shapes_in(const std::string& folder)
{
    Shapes shapes;
    const auto set = SafetensorsSet::open_folder(kGolden + folder);
    EXPECT_TRUE(set) << set.error().message;
    for (const TensorInfo& tensor : set->tensors())
        shapes[tensor.name] = tensor.shape;
    return shapes;
}

Json layout(const std::string& name)
{
    const auto json = read_json(kGolden + "layouts/" + name + ".json");
    EXPECT_TRUE(json) << json.error().message;
    return *json;
}

Json config_of(const std::string& folder)
{
    return *read_json(kGolden + folder + "/config.json");
}

// SD 1.5's config with one field changed
Json unet_with(const std::string& field, Json value)
{
    Json config = layout("sd15_asd_unet")["config"];
    config[field] = std::move(value);
    return config;
}

Json video_unet_with(const std::string& field, Json value)
{
    Json config = layout("svd_vsd_unet")["config"];
    config[field] = std::move(value);
    return config;
}

Json vae_with(const std::string& field, Json value)
{
    Json config = layout("sd15_vae")["config"];
    config[field] = std::move(value);
    return config;
}

TEST(RendererConfigs, the_full_networks_have_the_names_and_shapes_of_the_public_code)
{
    const Json unet = layout("sd15_asd_unet"), vae = layout("sd15_vae");
    const auto unet_config = parse_unet_config(unet["config"]);
    ASSERT_TRUE(unet_config) << unet_config.error().message;
    EXPECT_EQ(unet_config->warnings, std::vector<std::string>());
    EXPECT_EQ(unet_config->heads, std::vector<uint32_t>(4, 8));
    EXPECT_EQ(shapes_of(unet_schema(*unet_config)), unet["tensors"].get<Shapes>());
    const auto vae_config = parse_vae_config(vae["config"]);
    ASSERT_TRUE(vae_config) << vae_config.error().message;
    EXPECT_EQ(vae_config->warnings, std::vector<std::string>());
    EXPECT_EQ(vae_config->downscale(), 8u);
    EXPECT_EQ(shapes_of(vae_schema(*vae_config)), vae["tensors"].get<Shapes>());
}

TEST(RendererConfigs, the_full_networks_of_videos_have_the_names_and_shapes_of_the_public_code)
{
    const Json unet = layout("svd_vsd_unet"), vae = layout("svd_vae");
    const auto unet_config = parse_video_unet_config(unet["config"]);
    ASSERT_TRUE(unet_config) << unet_config.error().message;
    EXPECT_EQ(unet_config->warnings, std::vector<std::string>());
    EXPECT_EQ(unet_config->heads, (std::vector<uint32_t>{5, 10, 20, 20}));
    EXPECT_EQ(unet_config->added_numbers, 3u);
    EXPECT_EQ(shapes_of(unet_schema(*unet_config)), unet["tensors"].get<Shapes>());
    const auto vae_config = parse_video_vae_config(vae["config"]);
    ASSERT_TRUE(vae_config) << vae_config.error().message;
    EXPECT_EQ(vae_config->warnings, std::vector<std::string>());
    EXPECT_EQ(shapes_of(vae_schema(*vae_config)), vae["tensors"].get<Shapes>());
}

TEST(RendererConfigs, the_golden_models_have_the_tensors_their_configs_ask_for)
{
    for (const char* folder : {"unet_asd_tiny/model", "unet_odd_tiny/model", "asd_rollout_tiny/model/unet"}) {
        const auto config = parse_unet_config(config_of(folder));
        ASSERT_TRUE(config) << config.error().message;
        EXPECT_EQ(shapes_of(unet_schema(*config)), shapes_in(folder)) << folder;
    }
    for (const char* folder : {"vae_tiny/model", "asd_rollout_tiny/model/vae"}) {
        const auto config = parse_vae_config(config_of(folder));
        ASSERT_TRUE(config) << config.error().message;
        EXPECT_EQ(shapes_of(vae_schema(*config)), shapes_in(folder)) << folder;
    }
    for (const char* folder : {"unet_vsd_tiny/model", "vsd_window_tiny/model/unet"}) {
        const auto config = parse_video_unet_config(config_of(folder));
        ASSERT_TRUE(config) << config.error().message;
        EXPECT_EQ(shapes_of(unet_schema(*config)), shapes_in(folder)) << folder;
    }
    for (const char* folder : {"vae_temporal_tiny/model", "vsd_window_tiny/model/vae"}) {
        const auto config = parse_video_vae_config(config_of(folder));
        ASSERT_TRUE(config) << config.error().message;
        EXPECT_EQ(shapes_of(vae_schema(*config)), shapes_in(folder)) << folder;
    }
    EXPECT_TRUE(says(parse_video_unet_config(config_of("unet_asd_tiny/model")), "UNet2DConditionModel"));
    EXPECT_TRUE(says(parse_video_vae_config(config_of("vae_tiny/model")), "AutoencoderKL"));
    EXPECT_TRUE(says(parse_unet_config(config_of("unet_vsd_tiny/model")), "UNetSpatioTemporalConditionModel"));
    EXPECT_TRUE(says(parse_vae_config(config_of("vae_temporal_tiny/model")), "AutoencoderKLTemporalDecoder"));
}

TEST(RendererConfigs, a_written_config_reads_as_the_same_network)
{
    UnetConfig unet;
    unet.block_out_channels = {32, 64, 96};
    unet.layers_per_block = {1, 2, 3};
    unet.down_attention = {false, true, true};
    unet.up_attention = {true, false, true};
    unet.heads = {1, 2, 3};
    unet.transformer_layers = {1, 2, 4};
    unet.cross_attention_dim = 40;
    unet.use_linear_projection = true;
    unet.num_class_embeds = 10;
    const auto read = parse_unet_config(unet_config_json(unet));
    ASSERT_TRUE(read) << read.error().message;
    EXPECT_EQ(unet_config_json(*read), unet_config_json(unet));
    EXPECT_EQ(read->layers_per_block, unet.layers_per_block);
    EXPECT_EQ(read->up_attention, unet.up_attention);
    const Shapes shapes = shapes_of(unet_schema(*read));
    EXPECT_EQ(shapes.at("class_embedding.weight"), (std::vector<uint64_t>{10, 128}));
    EXPECT_EQ(shapes.at("up_blocks.0.resnets.3.conv1.weight"), (std::vector<uint64_t>{96, 96 + 64, 3, 3}));
    EXPECT_TRUE(shapes.contains("mid_block.attentions.0.transformer_blocks.3.ff.net.2.bias"));
    unet.mid_attention = false;
    EXPECT_FALSE(shapes_of(unet_schema(unet)).contains("mid_block.resnets.1.norm1.weight"));

    VaeConfig vae;
    vae.block_out_channels = {32, 64};
    vae.shift_factor = 0.5f;
    vae.use_quant_conv = vae.mid_block_add_attention = false;
    const auto vae_read = parse_vae_config(vae_config_json(vae));
    ASSERT_TRUE(vae_read) << vae_read.error().message;
    EXPECT_EQ(vae_config_json(*vae_read), vae_config_json(vae));
    EXPECT_FALSE(shapes_of(vae_schema(*vae_read)).contains("quant_conv.weight"));
}

TEST(RendererConfigs, numbers_may_come_per_level)
{
    EXPECT_EQ(parse_unet_config(unet_with("attention_head_dim", {5, 10, 20, 20}))->heads,
              (std::vector<uint32_t>{5, 10, 20, 20}));
    EXPECT_EQ(parse_unet_config(unet_with("num_attention_heads", 4))->heads, std::vector<uint32_t>(4, 4));
    EXPECT_EQ(parse_unet_config(unet_with("layers_per_block", {1, 2, 3, 4}))->layers_per_block[3], 4u);
    EXPECT_EQ(parse_unet_config(unet_with("transformer_layers_per_block", {1, 2, 3, 4}))->transformer_layers[2], 3u);
    EXPECT_EQ(parse_unet_config(unet_with("cross_attention_dim", {32, 32, 32, 32}))->cross_attention_dim, 32u);
    EXPECT_TRUE(parse_unet_config(unet_with("only_cross_attention", {false, false, false, false})));
    EXPECT_TRUE(says(parse_unet_config(unet_with("cross_attention_dim", {32, 32, 32, 64})), "the same number"));
    EXPECT_TRUE(says(parse_unet_config(unet_with("layers_per_block", {1, 2})), "layers_per_block is [1,2]"));
}

TEST(RendererConfigs, what_the_engine_does_not_do_is_refused_by_name)
{
    const std::pair<const char*, Json> unet[] = {
        {"class_embed_type", "timestep"},
        {"addition_embed_type", "text"},
        {"resnet_time_scale_shift", "scale_shift"},
        {"time_embedding_type", "fourier"},
        {"time_embedding_dim", 512},
        {"time_cond_proj_dim", 256},
        {"encoder_hid_dim", 64},
        {"encoder_hid_dim_type", "text_proj"},
        {"attention_type", "gated"},
        {"only_cross_attention", true},
        {"only_cross_attention", {false, true, false, false}},
        {"dual_cross_attention", true},
        {"act_fn", "gelu"},
        {"mid_block_scale_factor", 1.5},
        {"resnet_out_scale_factor", 0.7},
        {"resnet_skip_time_act", true},
        {"conv_in_kernel", 1},
        {"conv_out_kernel", 5},
        {"center_input_sample", true},
        {"downsample_padding", 0},
        {"mid_block_type", "UNetMidBlock2DSimpleCrossAttn"},
        {"mid_block_type", nullptr},
        {"norm_num_groups", nullptr},
        {"down_block_types", {"DownBlock2D", "KDownBlock2D", "DownBlock2D", "DownBlock2D"}},
        {"up_block_types", {"UpBlock2D"}},
        {"reverse_transformer_layers_per_block", {{1, 1}, {1}}},
        {"in_channels", 0},
        {"in_channels", "13"},
        {"block_out_channels", Json::array()},
        {"block_out_channels", {320, -1, 1280, 1280}},
        {"norm_eps", 0},
        {"freq_shift", "no"},
        {"attention_head_dim", 0},
        {"num_class_embeds", 1e9},
        {"use_linear_projection", 1}};
    for (const auto& [field, value] : unet)
        EXPECT_TRUE(says(parse_unet_config(unet_with(field, value)), field)) << field << " " << value;
    const std::pair<const char*, Json> vae[] = {{"act_fn", "relu"},
                                                {"latents_mean", {0.1, 0.1, 0.1, 0.1}},
                                                {"latents_std", {1, 1, 1, 1}},
                                                {"down_block_types", {"AttnDownEncoderBlock2D"}},
                                                {"up_block_types", {"UpDecoderBlock2D"}},
                                                {"layers_per_block", {1, 2, 2, 2}},
                                                {"scaling_factor", 0},
                                                {"latent_channels", 1.5},
                                                {"force_upcast", "yes"}};
    for (const auto& [field, value] : vae)
        EXPECT_TRUE(says(parse_vae_config(vae_with(field, value)), field)) << field << " " << value;
    EXPECT_TRUE(says(parse_unet_config(Json::array()), "expected a JSON object, found array"));
    EXPECT_TRUE(says(parse_vae_config(7), "expected a JSON object, found number"));
}

TEST(RendererConfigs, what_a_network_of_videos_cannot_be_is_refused_by_name)
{
    const std::pair<const char*, Json> unet[] = {
        {"down_block_types", {"CrossAttnDownBlock2D", "DownBlock2D", "DownBlock2D", "DownBlock2D"}},
        {"up_block_types", {"UpBlockSpatioTemporal"}},
        {"cross_attention_dim", {32, 32, 32, 64}},
        {"layers_per_block", {1, 2}},
        {"transformer_layers_per_block", 0},
        {"num_attention_heads", {5, 10}},
        {"addition_time_embed_dim", 3},
        {"projection_class_embeddings_input_dim", 700},
        {"num_frames", 0},
        {"in_channels", "9"}};
    for (const auto& [field, value] : unet)
        EXPECT_TRUE(says(parse_video_unet_config(video_unet_with(field, value)), field)) << field << " " << value;
    EXPECT_TRUE(says(parse_video_unet_config(video_unet_with("num_attention_heads", 7)),
                     "320 channels at level 0 do not divide into 7 heads"));
    EXPECT_TRUE(says(parse_video_unet_config(video_unet_with("block_out_channels", {48, 96, 96, 96})),
                     "48 channels at level 0 do not divide into 32 groups"));
    EXPECT_EQ(parse_video_unet_config(video_unet_with("layers_per_block", {1, 2, 3, 4}))->layers_per_block[3], 4u);
    EXPECT_EQ(parse_video_unet_config(video_unet_with("num_attention_heads", 4))->heads, std::vector<uint32_t>(4, 4));
    EXPECT_EQ(parse_video_unet_config(video_unet_with("novelty", 1))->warnings,
              std::vector<std::string>{"video unet config: unknown field \"novelty\" is ignored"});
}

TEST(RendererConfigs, channels_must_divide_into_groups_and_heads)
{
    EXPECT_TRUE(
        says(parse_unet_config(unet_with("norm_num_groups", 48)), "320 channels at level 0 do not divide into"));
    EXPECT_TRUE(says(parse_unet_config(unet_with("attention_head_dim", {8, 8, 7, 8})),
                     "1280 channels at level 2 do not divide into 7 heads"));
    EXPECT_TRUE(says(parse_vae_config(vae_with("norm_num_groups", 3)), "128 channels do not divide into 3 groups"));
}

TEST(RendererConfigs, weights_of_8_bits_belong_to_blocks_of_whole_channels)
{
    const UnetConfig unet = *parse_unet_config(unet_with("weights", "q8_0"));
    EXPECT_TRUE(unet.q8_0);
    EXPECT_TRUE(parse_any_unet_config(unet_config_json(unet))->q8_0);
    EXPECT_TRUE(
        parse_any_unet_config(unet_config_json(*parse_video_unet_config(video_unet_with("weights", "q8_0"))))->q8_0);
    EXPECT_FALSE(parse_unet_config(unet_with("weights", "q4_0")));
    Json config = unet_with("weights", "q8_0");
    config["attention_head_dim"] = 20; // of 16 channels, at the first level
    EXPECT_TRUE(parse_unet_config(config));
    config["attention_head_dim"] = 16;
    const auto refused = parse_unet_config(config);
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().message.find("found 320 channels at level 0, heads of 20"), std::string::npos)
        << refused.error().message;
    const Shapes shapes = shapes_of(unet_schema(unet));
    EXPECT_EQ(shapes.at("down_blocks.0.resnets.0.conv1.weight_scale"), (std::vector<uint64_t>{320, 10, 3, 3}));
    EXPECT_EQ(shapes.at("mid_block.attentions.0.transformer_blocks.0.attn2.to_k.weight_scale"),
              (std::vector<uint64_t>{1280, 24}));
    for (const char* whole : {"conv_in", "conv_out", "time_embedding.linear_1", "down_blocks.0.resnets.0.norm1"})
        EXPECT_FALSE(shapes.contains(std::string(whole) + ".weight_scale")) << whole;
}

TEST(RendererConfigs, an_unknown_field_warns)
{
    EXPECT_EQ(parse_unet_config(unet_with("novelty", 1))->warnings,
              std::vector<std::string>{"unet config: unknown field \"novelty\" is ignored"});
    EXPECT_EQ(parse_vae_config(vae_with("no\x1bvelty", 1))->warnings,
              std::vector<std::string>{"vae config: unknown field \"no\\x1bvelty\" is ignored"});
}

TEST(RandomWeights, depend_on_seed_and_name_and_have_the_variance_of_the_fan_in)
{
    std::vector<float> a, b;
    const TensorSpec spec{"conv.weight", {64, 32, 3, 3}};
    random_tensor(1, spec, a);
    random_tensor(1, spec, b);
    EXPECT_EQ(a, b);
    random_tensor(2, spec, b);
    EXPECT_NE(a, b);
    random_tensor(1, {"other.weight", {64, 32, 3, 3}}, b);
    EXPECT_NE(a, b);
    double sum = 0, squares = 0;
    for (const float v : a) {
        sum += v;
        squares += double(v) * v;
    }
    EXPECT_NEAR(sum / double(a.size()), 0, 3e-3);              // standard error 4.3e-4
    EXPECT_NEAR(squares / double(a.size()) * 32 * 9, 1, 0.03); // standard error 6.6e-3
    random_tensor(1, {"norm.weight", {7}}, a);
    ASSERT_EQ(a.size(), 7u);
    for (const float v : a)
        EXPECT_NEAR(v, 1, 0.1);
    random_tensor(1, {"norm.bias", {7}}, a);
    for (const float v : a)
        EXPECT_NEAR(v, 0, 0.05);
}

} // namespace engine_renderer_configs_test
} // namespace semrover
