// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
#include "engine/model/renderer_model.h"
#include "engine/model/weight_blocks.h"
#include "tests/support/checkpoint_values.h"
#include "tests/support/json_text.h"
#include "tests/support/program.h"
#include "tests/support/renderer_weights.h"
#include "tests/support/says.h"

namespace semrover {
namespace cli_convert_test {

namespace fs = std::filesystem;

const std::string kFile = "diffusion_pytorch_model.safetensors";

ProgramResult convert(const Path& in, const Path& out, const std::string& more = "")
{
    return semrover_program("convert " + in.string() + " " + out.string() + " -q " + more);
}

// every value is the seeded one, as `dtype` holds it
void expect_seeded(const Checkpoint& checkpoint, std::span<const TensorSpec> schema, DType dtype)
{
    const Status status = checkpoint.require(schema);
    ASSERT_TRUE(status) << status.error().message;
    std::vector<float> expected;
    std::vector<std::byte> bytes;
    for (const TensorSpec& spec : schema) {
        random_tensor(1, spec, expected);
        ASSERT_TRUE(encode_floats(expected, dtype, spec.name, bytes));
        to_float(bytes, dtype, expected.data());
        EXPECT_EQ(values_of(checkpoint, spec), expected) << spec.name;
        EXPECT_EQ(checkpoint.stream(spec).dtype, dtype) << spec.name;
    }
}

void put_diffusers(const Path& folder, const UnetConfig& unet = small_unet())
{
    Weights unet_weights, vae_weights;
    unet_weights.add(unet_schema(unet));
    unet_weights.write(folder / "unet" / kFile);
    Json config = unet_config_json(unet);
    config["sample_size"] = 53; // one that the engine has no use for
    ASSERT_TRUE(write_json(folder / "unet" / "config.json", config));
    vae_weights.add(vae_schema(small_vae()));
    vae_weights.write(folder / "vae" / kFile);
    ASSERT_TRUE(write_json(folder / "vae" / "config.json", vae_config_json(small_vae())));
}

TEST(CliConvert, an_ldm_file_becomes_a_folder_that_opens_with_the_same_numbers)
{
    const ScratchFolder folder;
    Weights w = ldm_weights(small_unet(), small_vae());
    w.add("cond_stage_model.transformer.x", {"x", {3}});
    w.write(folder / "in.safetensors");
    const ProgramResult result = convert(folder / "in.safetensors", folder / "out/");
    ASSERT_EQ(result.code, 0) << result.err;
    EXPECT_NE(result.out.find("left out: cond_stage_model.*"), std::string::npos) << result.out;
    const auto m = RendererModel::open(folder / "out");
    ASSERT_TRUE(m) << m.error().message;
    EXPECT_EQ(unet_config_json(m->unet), unet_config_json(small_unet()));
    EXPECT_EQ(m->scheduler.steps_offset, 1);
    expect_seeded(*m->open_unet(), unet_schema(m->unet), DType::f32);
    expect_seeded(*m->open_vae(), vae_schema(m->vae), DType::f32);
    EXPECT_EQ((*read_json(folder / "out/model_index.json"))["renderer"][1], "UNet2DConditionModel");
    EXPECT_EQ(folder.entries(), 2u); // nothing temporary is left
}

TEST(CliConvert, a_folder_keeps_what_it_says_and_changes_precision)
{
    const ScratchFolder folder;
    put_diffusers(folder / "in");
    for (const char* name : {"text_encoder", "safety_checker"})
        fs::create_directory(folder / "in" / name);
    Json scheduler = stable_diffusion_scheduler_json();
    scheduler["beta_end"] = 0.013;
    ASSERT_TRUE(write_json(folder / "in/scheduler/scheduler_config.json", scheduler));
    ASSERT_TRUE(write_json(folder / "in/model_index.json", {{"scheduler", {"diffusers", "DDIMScheduler"}},
                                                            {"defaults", {{"renderer", {{"guidance_scale", 2}}}}}}));
    Weights text;
    text.add("encoder_hidden_states", {"c", {1, 5, 24}});
    text.write(folder / "in/conditioning/conditioning.safetensors");
    for (const auto& [option, dtype] : {std::pair{"f16", DType::f16}, std::pair{"bf16", DType::bf16}}) {
        const Path out = folder / option;
        const ProgramResult result = convert(folder / "in", out, fmt::format("--dtype {}", option));
        ASSERT_EQ(result.code, 0) << result.err;
        EXPECT_NE(result.out.find("left out: safety_checker, text_encoder ("), std::string::npos) << result.out;
        const auto m = RendererModel::open(out);
        ASSERT_TRUE(m) << m.error().message;
        expect_seeded(*m->open_unet(), unet_schema(m->unet), dtype);
        EXPECT_EQ(m->scheduler.beta_end, 0.013);
        EXPECT_EQ(m->defaults.guidance_scale, 2);
        EXPECT_EQ(m->conditioning_tokens, 5u);
        EXPECT_EQ((*read_json(out / "renderer/config.json"))["sample_size"], 53);
    }
}

TEST(CliConvert, a_single_file_may_bring_its_text)
{
    const ScratchFolder folder;
    Weights weights = ldm_weights(small_unet(), small_vae());
    weights.add(std::string(kLdmConditioning), {"c", {1, 5, 24}});
    weights.write(folder / "in.safetensors");
    const auto in = RendererModel::open(folder / "in.safetensors");
    ASSERT_TRUE(in) << in.error().message;
    EXPECT_EQ(in->conditioning_tokens, 5u);
    const ProgramResult result = convert(folder / "in.safetensors", folder / "out", "");
    ASSERT_EQ(result.code, 0) << result.err;
    const auto out = RendererModel::open(folder / "out");
    ASSERT_TRUE(out) << out.error().message;
    EXPECT_EQ(out->conditioning, in->conditioning);
    EXPECT_NE(out->conditioning, std::vector<float>(5 * 24, 0.f));
}

TEST(CliConvert, asd_init_widens_the_input_with_zeros)
{
    const ScratchFolder folder;
    UnetConfig unet = small_unet();
    unet.in_channels = 4;
    put_diffusers(folder / "in", unet);
    ldm_weights(unet, small_vae()).write(folder / "in.safetensors");
    for (const char* in : {"in", "in.safetensors"}) {
        const ProgramResult result = convert(folder / in, folder / "out", "-y --asd-init --dtype f32");
        ASSERT_EQ(result.code, 0) << result.err;
        const auto m = RendererModel::open(folder / "out");
        ASSERT_TRUE(m) << m.error().message;
        EXPECT_EQ(m->unet.in_channels, 13u);
        std::vector<float> plain;
        random_tensor(1, {"conv_in.weight", {32, 4, 3, 3}}, plain);
        const std::vector<float> wide = values_of(*m->open_unet(), {"conv_in.weight", {32, 13, 3, 3}});
        for (size_t i = 0; i < wide.size(); ++i) {
            const size_t row = i / (13 * 9), column = i % (13 * 9);
            ASSERT_EQ(wide[i], column < 4 * 9 ? plain[row * 4 * 9 + column] : 0.f) << i;
        }
    }
    expect_error(convert(folder / "out", folder / "again", "--asd-init"), 3, "this one takes 13");
}

TEST(CliConvert, a_single_file_of_stable_video_diffusion_becomes_a_renderer_of_videos)
{
    const ScratchFolder folder;
    UnetConfig unet = small_video_unet();
    unet.in_channels = 8;
    Weights w = ldm_weights(unet, small_video_vae());
    for (const char* name : {"model.diffusion_model.label_emb.0.2.weight",
                             "model.diffusion_model.input_blocks.1.0.time_stack.in_layers.0.weight",
                             "model.diffusion_model.input_blocks.1.0.time_mixer.mix_factor",
                             "model.diffusion_model.input_blocks.1.1.time_stack.0.norm_in.weight",
                             "model.diffusion_model.input_blocks.1.1.time_pos_embed.2.bias",
                             "model.diffusion_model.middle_block.2.time_stack.out_layers.3.weight",
                             "first_stage_model.decoder.mid.block_1.time_stack.in_layers.2.weight",
                             "first_stage_model.decoder.up.1.block.2.mix_factor",
                             "first_stage_model.decoder.conv_out.time_mix_conv.weight"})
        EXPECT_TRUE(w.specs.contains(name)) << name;
    w.add("conditioner.embedders.0.x", {"x", {3}});
    w.write(folder / "in.safetensors");
    const ProgramResult plain = convert(folder / "in.safetensors", folder / "plain");
    ASSERT_EQ(plain.code, 0) << plain.err;
    EXPECT_NE(plain.out.find("left out: conditioner.*"), std::string::npos) << plain.out;
    const auto m = RendererModel::read(folder / "plain");
    ASSERT_TRUE(m) << m.error().message;
    EXPECT_EQ(unet_config_json(m->unet), unet_config_json(unet));
    expect_seeded(*m->open_unet(), unet_schema(m->unet), DType::f32);
    EXPECT_EQ(m->scheduler.sampler, Sampler::euler);
    EXPECT_TRUE(m->vae.video);
    // the file has none, the folder one that changes nothing
    const std::vector<float> quant = values_of(*m->open_vae(), {"quant_conv.weight", {8, 8, 1, 1}});
    for (size_t i = 0; i < quant.size(); ++i)
        EXPECT_EQ(quant[i], i / 8 == i % 8 ? 1.f : 0.f);
    const Json index = *read_json(folder / "plain/model_index.json");
    EXPECT_EQ(index["renderer"][1], "UNetSpatioTemporalConditionModel");
    EXPECT_EQ(index["vae"][1], "AutoencoderKLTemporalDecoder");
    EXPECT_EQ(index["scheduler"][1], "EulerDiscreteScheduler");
    EXPECT_TRUE(says(RendererModel::open(folder / "plain"), "`vsd_init` makes it so"));
    expect_error(convert(folder / "plain", folder / "no", "--asd-init"), 3, "--asd-init wants a UNet of single images");
}

TEST(CliConvert, vsd_init_keeps_the_images_weights_for_the_buffer_and_adds_visibility_with_zeros)
{
    const ScratchFolder folder;
    UnetConfig unet = small_video_unet();
    unet.in_channels = 8;
    ldm_weights(unet, small_video_vae()).write(folder / "in.safetensors");
    ASSERT_EQ(convert(folder / "in.safetensors", folder / "plain").code, 0);
    for (const char* in : {"in.safetensors", "plain"}) {
        const ProgramResult result = convert(folder / in, folder / "out", "-y --vsd-init");
        ASSERT_EQ(result.code, 0) << result.err;
        const auto m = RendererModel::open(folder / "out");
        ASSERT_TRUE(m) << m.error().message;
        EXPECT_EQ(m->unet.in_channels, 9u);
        EXPECT_EQ(m->defaults.video.window_frames, 12u);
        EXPECT_EQ(m->defaults.video.window_overlap, 4u);
        std::vector<float> plain;
        random_tensor(1, {"conv_in.weight", {32, 8, 3, 3}}, plain);
        const std::vector<float> wide = values_of(*m->open_unet(), {"conv_in.weight", {32, 9, 3, 3}});
        for (size_t i = 0; i < wide.size(); ++i) {
            const size_t row = i / (9 * 9), column = i % (9 * 9);
            ASSERT_EQ(wide[i], column < 8 * 9 ? plain[row * 8 * 9 + column] : 0.f) << i;
        }
    }
    expect_error(convert(folder / "out", folder / "again", "--vsd-init"), 3, "this one takes 9");
    put_diffusers(folder / "images");
    expect_error(convert(folder / "images", folder / "again", "--vsd-init"), 3, "--vsd-init wants a UNet of videos");
    expect_error(convert(folder / "out", folder / "again", "--vsd-init --asd-init"), 2, "excludes");
}

TEST(CliConvert, a_transformer_comes_along_with_its_adapter)
{
    const ScratchFolder folder;
    const ProgramResult result = convert(SEMROVER_SOURCE_DIR "/assets/model", folder / "out", "--dtype f32 --json");
    ASSERT_EQ(result.code, 0) << result.err;
    EXPECT_EQ(json_of(result.out)["components"]["voxfield_transformer"]["tensors"], 178);
    const Json index = *read_json(folder / "out/model_index.json");
    EXPECT_EQ(index["voxfield_scheduler"][1], "DDPMScheduler");
    const Json before = *read_json(SEMROVER_SOURCE_DIR "/assets/model/model_index.json");
    EXPECT_TRUE(before["defaults"].contains("num_inference_steps"));
    EXPECT_EQ(index["defaults"], before["defaults"]);
    const auto set = SafetensorsSet::open_folder(folder / "out/voxfield_transformer");
    ASSERT_TRUE(set) << set.error().message;
    EXPECT_EQ(set->tensors()[0].dtype, DType::f32);
    const std::string adapter = "voxfield_transformer/pytorch_lora_weights.safetensors";
    EXPECT_EQ(contents(folder / "out" / adapter), contents(Path(SEMROVER_SOURCE_DIR "/assets/model") / adapter));
    const std::string quality = "voxfield_transformer/quality.safetensors"; // of a preset
    EXPECT_EQ(contents(folder / "out" / quality), contents(Path(SEMROVER_SOURCE_DIR "/assets/model") / quality));
    EXPECT_EQ(index["presets"], before["presets"]);
    fs::copy(SEMROVER_SOURCE_DIR "/assets/model", folder / "plain", fs::copy_options::recursive);
    fs::remove(folder / "plain" / adapter);
    ASSERT_EQ(convert(folder / "plain", folder / "out", "-y").code, 0);
    EXPECT_FALSE(fs::exists(folder / "out" / adapter)) << "it belongs to the weights that it came with";
}

TEST(CliConvert, a_number_beyond_half_precision_is_an_error_that_names_the_tensor)
{
    const ScratchFolder folder;
    Weights w = ldm_weights(small_unet(), small_vae());
    w.values["model.diffusion_model.out.2.weight"][5] = 70000;
    w.write(folder / "in.safetensors");
    expect_error(convert(folder / "in.safetensors", folder / "out", "--dtype f16"), 3,
                 "tensor 'model.diffusion_model.out.2.weight' holds 70000 at element 5, which F16 cannot hold");
    EXPECT_FALSE(fs::exists(folder / "out"));
    EXPECT_EQ(folder.entries(), 1u);
    EXPECT_EQ(convert(folder / "in.safetensors", folder / "out", "--dtype bf16").code, 0);
}

// heads of 8 channels
UnetConfig unet_for_blocks()
{
    UnetConfig unet = small_unet();
    unet.heads = {4, 8, 8};
    return unet;
}

TEST(CliConvert, weights_of_a_networks_blocks_become_int8_with_scales)
{
    const ScratchFolder folder;
    put_diffusers(folder / "in", unet_for_blocks());
    const ProgramResult result = convert(folder / "in", folder / "out", "--weights q8_0 --json");
    ASSERT_EQ(result.code, 0) << result.err;
    const auto m = RendererModel::open(folder / "out");
    ASSERT_TRUE(m) << m.error().message;
    EXPECT_TRUE(m->unet.q8_0);
    EXPECT_EQ((*read_json(folder / "out/renderer/config.json"))["sample_size"], 53);
    const Checkpoint checkpoint = *m->open_unet();
    std::vector<float> expected, got, scratch;
    uint64_t in_blocks = 0, parameters = 0;
    for (const TensorSpec& spec : unet_schema(unet_for_blocks())) {
        random_tensor(1, spec, expected);
        parameters += expected.size();
        const auto values = checkpoint.values(spec, scratch);
        ASSERT_TRUE(values);
        if (values->dtype == DType::f32) {
            EXPECT_EQ(values_of(checkpoint, spec), expected) << spec.name;
            continue;
        }
        const auto scales = checkpoint.values(scales_of(spec), scratch);
        ASSERT_TRUE(scales);
        const uint32_t taps = spec.shape.size() == 4 ? uint32_t(spec.shape[2] * spec.shape[3]) : 1;
        from_blocks(values->bytes, scales->bytes, uint32_t(spec.shape[1]), taps, got);
        float largest = 0;
        for (const float v : expected)
            largest = std::max(largest, std::abs(v));
        for (size_t i = 0; i < got.size(); ++i)
            ASSERT_NEAR(got[i], expected[i], largest / 250) << spec.name << ' ' << i;
        in_blocks += got.size();
    }
    EXPECT_GT(in_blocks, parameters * 9 / 10);
    EXPECT_EQ(json_of(result.out)["components"]["renderer"]["parameters"], parameters);
    expect_seeded(*m->open_vae(), vae_schema(m->vae), DType::f32);
    ASSERT_EQ(convert(folder / "out", folder / "again").code, 0); // as it is
    EXPECT_EQ(contents(folder / "again/renderer" / kFile), contents(folder / "out/renderer" / kFile));
}

TEST(CliConvert, blocks_that_are_not_whole_are_refused)
{
    const ScratchFolder folder;
    put_diffusers(folder / "narrow");
    expect_error(convert(folder / "narrow", folder / "none", "--weights q8_0"), 3,
                 "want channels and heads of multiples of 8, found 32 channels at level 0, heads of 4");
    put_diffusers(folder / "in", unet_for_blocks());
    ASSERT_EQ(convert(folder / "in", folder / "out", "--weights q8_0").code, 0);
    const Path file = folder / "out/renderer" / kFile;
    const std::string name = "mid_block.resnets.0.conv1.weight_scale", whole = contents(file);
    const auto error_with = [&](const std::function<bool(TensorData&)>& keep) {
        folder.put("out/renderer/" + kFile, whole);
        const SafetensorsSet set = *SafetensorsSet::open(file);
        std::vector<TensorData> tensors;
        for (const TensorInfo& t : set.tensors())
            if (TensorData data{t.name, t.dtype, t.shape, set.bytes(t)}; keep(data))
                tensors.push_back(data);
        EXPECT_TRUE(write_safetensors(folder / "changed", tensors));
        fs::rename(folder / "changed", file);
        const auto m = RendererModel::open(folder / "out");
        return m ? std::string() : m.error().message;
    };
    EXPECT_NE(error_with([&](TensorData& t) { return t.name != name; }).find("1 missing: " + name), std::string::npos)
        << error_with([&](TensorData& t) { return t.name != name; });
    const auto reshaped = error_with([&](TensorData& t) {
        if (t.name == name)
            t.shape = {2, 64, 3, 3};
        return true;
    });
    EXPECT_NE(reshaped.find(name + " expected [64, 2, 3, 3] found [2, 64, 3, 3]"), std::string::npos) << reshaped;
    const auto retyped = error_with([&](TensorData& t) {
        if (t.name == name)
            t.dtype = DType::bf16;
        return true;
    });
    EXPECT_NE(retyped.find(name + " expected F16 found BF16"), std::string::npos) << retyped;
}

TEST(CliConvert, what_exists_is_replaced_only_when_asked)
{
    const ScratchFolder folder;
    put_diffusers(folder / "in");
    const ProgramResult dry = convert(folder / "in", folder / "out", "--dry-run");
    EXPECT_EQ(dry.code, 0) << dry.err;
    EXPECT_NE(dry.out.find("renderer"), std::string::npos);
    EXPECT_FALSE(fs::exists(folder / "out"));
    fs::create_directories(folder / "out/renderer");
    folder.put("out/notes.txt", "mine");
    folder.put("out/renderer/diffusion_pytorch_model.fp16.safetensors", "stale, and preferred by every reader");
    expect_error(convert(folder / "in", folder / "out"), 2, "-y replaces it");
    ASSERT_EQ(convert(folder / "in", folder / "out", "-y").code, 0);
    EXPECT_TRUE(RendererModel::open(folder / "out"));
    EXPECT_EQ(contents(folder / "out/notes.txt"), "mine");
    expect_error(convert(folder / "in", folder / "in", "-y"), 2, "IN and OUT are the same");
    expect_error(convert(folder / "in", folder.put("file", "x"), "-y"), 3, "is a file");
}

TEST(CliConvert, what_is_no_model_is_bad_input)
{
    const ScratchFolder folder;
    expect_error(convert(folder / "none", folder / "out"), 3, "No such file");
    expect_error(convert(folder.path(), folder / "out"), 3, "is a folder without files; expected a trajectory");
    expect_error(convert(folder.put("x.ckpt", "x"), folder / "out"), 3, "convert it with Python");
    expect_error(convert(folder.path(), folder / "out"), 3, "convert it with Python");
    for (const char* name : {"cameras.bin", "images.bin", "points3D.bin"}) { // no pickles, and no clouds
        const Path part = folder.put(name, "x");
        const std::string advice = fmt::format("give its folder, '{}'", folder.path().string());
        for (const char* out : {"out", "out.sgrid", "out.tum"})
            expect_error(convert(part, folder / out), 3, advice);
        expect_error(semrover_program("inspect " + part.string()), 3, advice);
        expect_error(semrover_program("render " SEMROVER_SOURCE_DIR "/assets/scenes/street.truth.sgrid --path " +
                                      part.string() + " -o " + (folder / "frames").string()),
                     3, advice);
    }
    const Path plain = folder / "transformer";
    for (const char* part : {"voxfield_transformer", "voxfield_scheduler"}) {
        fs::create_directories(plain / part);
        fs::copy(Path(SEMROVER_SOURCE_DIR) / "assets/model" / part, plain / part);
    }
    expect_error(convert(plain, folder / "out", "--asd-init"), 3, "has no renderer");
    expect_error(convert(folder.path(), folder / "out", "--dtype int8"), 2, "dtype");
    put_diffusers(folder / "in");
    Weights bad;
    bad.add(unet_schema(small_unet()));
    bad.values["conv_in.bias"][0] = NAN;
    bad.write(folder / "in/unet" / kFile);
    expect_error(convert(folder / "in", folder / "out"), 3, "tensor 'conv_in.bias' holds NaN");
    EXPECT_FALSE(fs::exists(folder / "out"));
}

} // namespace cli_convert_test
} // namespace semrover
