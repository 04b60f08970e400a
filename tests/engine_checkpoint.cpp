// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/model/checkpoint.h"
#include "engine/model/ldm_config.h"
#include "tests/support/checkpoint_values.h"
#include "tests/support/json_text.h"
#include "tests/support/renderer_weights.h"
#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"

#include <cmath>

namespace semrover {
namespace engine_checkpoint_test {

using Network = Checkpoint::Network;

const std::string kBase = "diffusion_pytorch_model";

// every tensor of the schema as `checkpoint` gives it is the seeded one
void expect_seeded(const Checkpoint& checkpoint, std::span<const TensorSpec> schema, uint64_t seed = 1)
{
    const Status status = checkpoint.require(schema);
    ASSERT_TRUE(status) << status.error().message;
    std::vector<float> expected;
    for (const TensorSpec& spec : schema) {
        random_tensor(seed, spec, expected);
        EXPECT_EQ(values_of(checkpoint, spec), expected) << spec.name;
    }
}

TEST(LdmNames, are_those_of_every_tensor_of_a_stable_diffusion_file)
{
    const std::string layouts = SEMROVER_SOURCE_DIR "/tests/golden/layouts/";
    const auto map = read_json(layouts + "ldm_to_diffusers.json")->get<std::map<std::string, std::string>>();
    const auto unet = parse_unet_config((*read_json(layouts + "sd15_asd_unet.json"))["config"]);
    const auto vae = parse_vae_config((*read_json(layouts + "sd15_vae.json"))["config"]);
    std::map<std::string, std::string> ours;
    for (const TensorSpec& spec : unet_schema(*unet))
        ours[std::string(kLdmUnet) + ldm_unet_name(*unet, spec.name)] = spec.name;
    for (const TensorSpec& spec : vae_schema(*vae))
        ours[std::string(kLdmVae[0]) + ldm_vae_name(*vae, spec.name)] = spec.name;
    EXPECT_EQ(ours.size(), 686u + 248u);
    EXPECT_EQ(ours, map);
}

TEST(Checkpoint, a_folder_one_file_or_shards_and_an_ldm_file_give_the_same_numbers)
{
    const ScratchFolder folder;
    const UnetConfig unet = small_unet();
    const VaeConfig vae = small_vae();
    Weights all;
    all.add(unet_schema(unet));
    all.write(folder / "one" / (kBase + ".safetensors"));
    Weights parts[2];
    Json index = {{"weight_map", Json::object()}};
    size_t i = 0;
    for (const auto& [name, spec] : all.specs) {
        parts[i % 2].add(name, spec);
        index["weight_map"][name] = fmt::format("{}-{}.safetensors", kBase, i++ % 2);
    }
    for (size_t part = 0; part < 2; ++part)
        parts[part].write(folder / "shards" / fmt::format("{}-{}.safetensors", kBase, part));
    EXPECT_TRUE(write_json(folder / "shards" / (kBase + ".safetensors.index.json"), index));
    Weights ldm = ldm_weights(unet, vae);
    ldm.add("model_ema.decay", {"model_ema.decay", {1}});
    ldm.add("betas", {"betas", {1000}});
    ldm.add("cond_stage_model.x", {"cond_stage_model.x", {2}});
    ldm.write(folder / "ldm.safetensors");

    for (const char* name : {"one", "shards"}) {
        const auto checkpoint = Checkpoint::open_folder(folder / name, Network::unet);
        ASSERT_TRUE(checkpoint) << checkpoint.error().message;
        expect_seeded(*checkpoint, unet_schema(unet));
    }
    const auto from_ldm = Checkpoint::open_ldm(folder / "ldm.safetensors", Network::unet, &unet, nullptr);
    ASSERT_TRUE(from_ldm) << from_ldm.error().message;
    expect_seeded(*from_ldm, unet_schema(unet));
    const auto vae_from_ldm = Checkpoint::open_ldm(folder / "ldm.safetensors", Network::vae, nullptr, &vae);
    ASSERT_TRUE(vae_from_ldm) << vae_from_ldm.error().message;
    expect_seeded(*vae_from_ldm, vae_schema(vae));
    ldm_weights(unet, vae, kLdmVae[1]).write(folder / "vae.safetensors");
    expect_seeded(*Checkpoint::open_ldm(folder / "vae.safetensors", Network::vae, nullptr, &vae), vae_schema(vae));
    expect_seeded(Checkpoint::random(1), unet_schema(unet));
}

TEST(Checkpoint, half_precision_is_read_exactly)
{
    const ScratchFolder folder;
    Weights w;
    const TensorSpec spec{"w", {3, 5}};
    w.add("w", spec);
    std::vector<float> again(15);
    std::vector<std::byte> bytes(30);
    for (const DType dtype : {DType::f16, DType::bf16}) {
        w.write(folder / (kBase + ".safetensors"), dtype);
        const auto checkpoint = Checkpoint::open_folder(folder.path(), Network::unet);
        const std::vector<float> values = values_of(*checkpoint, spec);
        EXPECT_EQ(checkpoint->stream(spec).dtype, dtype);
        from_float(w.values["w"], dtype, bytes.data());
        to_float(bytes, dtype, again.data());
        EXPECT_EQ(values, again);
        for (size_t i = 0; i < values.size(); ++i)
            EXPECT_NEAR(values[i], w.values["w"][i], std::abs(w.values["w"][i]) / (dtype == DType::f16 ? 2048 : 256));
    }
}

TEST(Checkpoint, old_names_and_matrices_as_convolutions_are_understood)
{
    const ScratchFolder folder;
    const VaeConfig vae = small_vae();
    Weights w;
    w.add(vae_schema(vae));
    for (const char* half : {"encoder", "decoder"})
        for (const auto& [name, old] : {std::pair{"to_q", "query"}, std::pair{"to_k", "key"},
                                        std::pair{"to_v", "value"}, std::pair{"to_out.0", "proj_attn"}})
            for (const char* end : {"weight", "bias"}) {
                const std::string attention = fmt::format("{}.mid_block.attentions.0.", half);
                w.rename(fmt::format("{}{}.{}", attention, name, end), fmt::format("{}{}.{}", attention, old, end));
            }
    w.specs["encoder.mid_block.attentions.0.query.weight"].shape = {64, 64, 1, 1};
    w.specs["quant_conv.weight"].shape = {8, 8};
    w.write(folder / (kBase + ".safetensors"));
    expect_seeded(*Checkpoint::open_folder(folder.path(), Network::vae), vae_schema(vae));
    // a UNet has no such names
    EXPECT_TRUE(says(Checkpoint::open_folder(folder.path(), Network::unet)->require(vae_schema(vae)), "query.weight"));
}

TEST(Checkpoint, one_error_lists_what_is_missing_misshapen_and_unexpected)
{
    const ScratchFolder folder;
    const UnetConfig unet = small_unet();
    Weights w = ldm_weights(unet, small_vae());
    w.erase("model.diffusion_model.out.2.bias");
    w.specs["model.diffusion_model.time_embed.0.weight"].shape = {32, 128};
    w.add("model.diffusion_model.label_emb.0.0.weight", {"x", {4, 4}});
    w.write(folder / "x.safetensors");
    const auto checkpoint = Checkpoint::open_ldm(folder / "x.safetensors", Network::unet, &unet, nullptr);
    EXPECT_TRUE(says(checkpoint->require(unet_schema(unet)),
                     "1 missing: model.diffusion_model.out.2.bias [4]; 1 misshapen: "
                     "model.diffusion_model.time_embed.0.weight expected [128, 32] found [32, 128]; 1 unexpected: "
                     "model.diffusion_model.label_emb.0.0.weight [4, 4]"));
}

TEST(Checkpoint, a_plain_unet_is_refused_with_the_nine_channels_it_lacks)
{
    const ScratchFolder folder;
    UnetConfig unet = small_unet();
    unet.in_channels = 4;
    Weights w;
    w.add(unet_schema(unet));
    w.write(folder / (kBase + ".safetensors"));
    unet.in_channels = 13;
    const Status status = Checkpoint::open_folder(folder.path(), Network::unet)->require(unet_schema(unet));
    EXPECT_TRUE(says(status, "9 more: previous latent (4), buffer latent (4), visibility (1)"));
    EXPECT_TRUE(says(status, "`asd_init`"));
}

TEST(Checkpoint, files_that_are_none_are_refused)
{
    const ScratchFolder folder;
    const UnetConfig unet = small_unet();
    const VaeConfig vae = small_vae();
    EXPECT_TRUE(says(Checkpoint::open_folder(folder.path(), Network::unet), "found none"));
    folder.put(kBase + ".bin", "x");
    EXPECT_TRUE(says(Checkpoint::open_folder(folder.path(), Network::unet), "convert it with Python"));
    EXPECT_TRUE(
        says(Checkpoint::open_ldm(folder.put("x.ckpt", "x"), Network::unet, &unet, nullptr), "convert it with"));
    Weights w;
    w.add("x", {"x", {1}});
    w.write(folder / "x.safetensors");
    EXPECT_TRUE(says(Checkpoint::open_ldm(folder / "x.safetensors", Network::vae, nullptr, &vae), "has no VAE"));
}

TEST(LdmConfig, follows_from_names_and_shapes)
{
    const ScratchFolder folder;
    UnetConfig unet = small_unet();
    VaeConfig vae = small_vae();
    ldm_weights(unet, vae).write(folder / "1.safetensors");
    const auto one = SafetensorsSet::open(folder / "1.safetensors");
    EXPECT_TRUE(is_ldm(*one));
    const auto guess = ldm_unet_config(*one);
    ASSERT_TRUE(guess) << guess.error().message;
    EXPECT_EQ(unet_config_json(*guess), unet_config_json(unet));
    EXPECT_EQ(guess->warnings, std::vector<std::string>());
    const auto vae_guess = ldm_vae_config(*one);
    ASSERT_TRUE(vae_guess) << vae_guess.error().message;
    EXPECT_EQ(vae_config_json(*vae_guess), vae_config_json(vae));

    unet = {};
    unet.block_out_channels = {64, 128, 192, 192, 192};
    unet.layers_per_block = {1, 2, 1, 3, 1};
    unet.down_attention = {false, true, true, true, false};
    unet.up_attention = {false, false, true, true, false};
    unet.transformer_layers = {1, 2, 1, 3, 4};
    unet.heads = {1, 2, 3, 3, 3};
    unet.cross_attention_dim = 1024;
    unet.use_linear_projection = true;
    unet.num_class_embeds = 10;
    vae.block_out_channels = {48, 96};
    vae.norm_num_groups = 16;
    vae.use_quant_conv = false;
    ldm_weights(unet, vae, kLdmVae[1]).write(folder / "2.safetensors");
    const auto two = SafetensorsSet::open(folder / "2.safetensors");
    EXPECT_EQ(unet_config_json(*ldm_unet_config(*two)), unet_config_json(unet));
    const auto grouped = ldm_vae_config(*two);
    EXPECT_EQ(vae_config_json(*grouped), vae_config_json(vae));
    EXPECT_EQ(grouped->warnings.size(), 1u);
}

TEST(LdmConfig, the_files_own_config_comes_first)
{
    const ScratchFolder folder;
    UnetConfig unet = small_unet();
    unet.heads = {4, 2, 2};
    unet.norm_num_groups = 8;
    const Json own = {{"unet", unet_config_json(unet)}};
    ldm_weights(unet, small_vae()).write(folder / "x.safetensors", DType::f32, {{"semrover.config", own.dump()}});
    const auto set = SafetensorsSet::open(folder / "x.safetensors");
    EXPECT_EQ(unet_config_json(*ldm_unet_config(*set)), unet_config_json(unet));
    EXPECT_EQ(ldm_vae_config(*set)->norm_num_groups, 32u);
    ldm_weights(unet, small_vae()).write(folder / "y.safetensors", DType::f32, {{"semrover.config", "{"}});
    EXPECT_TRUE(says(ldm_unet_config(*SafetensorsSet::open(folder / "y.safetensors")), "semrover.config"));
}

TEST(LdmConfig, a_file_that_lacks_a_layer_says_which)
{
    const ScratchFolder folder;
    Weights w = ldm_weights(small_unet(), small_vae());
    w.erase("model.diffusion_model.out.2.weight");
    w.erase("first_stage_model.decoder.conv_in.weight");
    w.specs["model.diffusion_model.input_blocks.0.0.weight"].shape = {32 * 13 * 9};
    w.write(folder / "x.safetensors");
    const auto set = SafetensorsSet::open(folder / "x.safetensors");
    EXPECT_TRUE(
        says(ldm_unet_config(*set), "tensor 'model.diffusion_model.input_blocks.0.0.weight' is of shape [3744]"));
    EXPECT_TRUE(says(ldm_vae_config(*set), "tensor 'first_stage_model.decoder.conv_in.weight' is missing"));
}

} // namespace engine_checkpoint_test
} // namespace semrover
