// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "engine/network/unet.h"
#include "engine/network/vae.h"
#include "runtime/base/json.h"
#include "tests/support/feature_map_case.h"

#include <cmath>

namespace semrover {
namespace engine_networks_test {

VaeConfig small_vae()
{
    VaeConfig c;
    c.block_out_channels = {16, 32};
    c.layers_per_block = 1;
    c.norm_num_groups = 8;
    return c;
}

UnetConfig small_unet()
{
    UnetConfig c;
    c.in_channels = 13;
    c.block_out_channels = {16, 24, 32};
    c.layers_per_block = {1, 1, 1};
    c.down_attention = {true, true, false};
    c.up_attention = {false, true, true};
    c.heads = {2, 3, 2};
    c.transformer_layers = {1, 2, 1};
    c.cross_attention_dim = 20;
    c.norm_num_groups = 8;
    return c;
}

// a latent through the decoder of a device with these limits
HostImages decode(const std::string& limits, DType precision, const VaeConfig& config, uint32_t height, uint32_t width,
                  size_t& passes)
{
    auto device = Device::create({.limits = limits});
    SR_ASSERT(bool(device), "{}", device.error().message);
    auto vae = Vae::load(**device, config, Checkpoint::random(3), precision);
    SR_ASSERT(bool(vae), "{}", vae.error().message);
    KernelCase k(**device);
    const HostImages latent = random_images(k, 1, height, width, config.latent_channels, DType::f32);
    const FeatureMap y = (*vae)->decode(k.graph, latent.input(k));
    HostImages image{y.height, y.width, k.run(y.data)};
    passes = k.plan().passes.size();
    return image;
}

double largest_difference(const HostImages& a, const HostImages& b)
{
    double largest = 0;
    for (uint32_t y = 0; y < a.height; ++y)
        for (uint32_t x = 0; x < a.width; ++x)
            for (uint32_t c = 0; c < a.rows.cols; ++c)
                largest = std::max(largest, std::abs(double(a.at(0, y, x, c)) - b.at(0, y, x, c)));
    return largest;
}

TEST(engine_networks, have_the_parameters_of_stable_diffusion)
{
    UnetConfig unet;
    EXPECT_EQ(Unet::plan(unet, DType::f16)->parameters(), 859520964u);
    unet.in_channels = 13;
    EXPECT_EQ(Unet::plan(unet, DType::f16)->parameters(), 859520964u + 9 * 9 * 320);
    EXPECT_EQ(Vae::plan({}, DType::f16)->parameters(), 83653863u);
}

// bytes on the device in fp16, and in blocks where they can be
std::pair<uint64_t, uint64_t> planned_bytes(UnetConfig config)
{
    const uint64_t half = Unet::plan(config, DType::f16)->device_bytes({});
    config.q8_0 = true;
    return {half, Unet::plan(config, DType::f16)->device_bytes({})};
}

// 8.5 bits a weight of the blocks
TEST(engine_networks, need_about_half_the_memory_with_weights_of_8_bits)
{
    UnetConfig unet;
    unet.in_channels = 13;
    const auto [half, blocks] = planned_bytes(unet);
    EXPECT_NEAR(double(half), 1.724e9, 0.005e9);
    EXPECT_NEAR(double(blocks), 0.9215e9, 0.005e9);
    const auto svd = *read_json(SEMROVER_SOURCE_DIR "/tests/golden/layouts/svd_vsd_unet.json");
    const auto [video_half, video_blocks] = planned_bytes(*parse_video_unet_config(svd["config"]));
    EXPECT_NEAR(double(video_half), 3.259e9, 0.005e9);
    EXPECT_NEAR(double(video_blocks), 1.639e9, 0.005e9);
}

TEST(engine_networks, decode_the_same_image_in_bands_of_rows)
{
    size_t whole = 0, banded = 0;
    for (DType precision : {DType::f32, DType::f16}) {
        const HostImages a = decode("", precision, small_vae(), 21, 19, whole);
        const char* limits = precision == DType::f32 ? "range=163840,texels=10240" : "range=81920,texels=5120";
        const HostImages b = decode(limits, precision, small_vae(), 21, 19, banded);
        EXPECT_GT(banded, whole);
        EXPECT_EQ(largest_difference(a, b), 0);
        EXPECT_EQ(a.height, 42u);
        EXPECT_EQ(a.width, 38u);
    }
}

// wide enough for the GEMMs by which devices with matrix units attend
TEST(engine_networks, decode_the_same_image_by_either_way_to_attend)
{
    VaeConfig wide = small_vae();
    wide.block_out_channels = {32, 128};
    size_t passes = 0;
    const HostImages a = decode("variant=simt", DType::f16, wide, 18, 17, passes);
    const HostImages b = decode("", DType::f16, wide, 18, 17, passes);
    EXPECT_LT(largest_difference(a, b), 3e-2);
}

// wide enough for Winograd's algorithm, which a device with few texels does not have room for
TEST(engine_networks, decode_the_same_image_by_either_way_to_convolve)
{
    VaeConfig wide = small_vae();
    wide.block_out_channels = {96, 128};
    size_t direct = 0, winograd = 0;
    for (DType precision : {DType::f32, DType::f16}) {
        const HostImages a = decode("texels=4096000", precision, wide, 18, 17, direct);
        const HostImages b = decode("", precision, wide, 18, 17, winograd);
        // with lowered limits (SEMROVER_LIMITS) there is no room for it at all, and GPUs do without
        const DeviceLimits& limits = test_device().limits();
        EXPECT_EQ(winograd > direct, limits.type == DeviceType::cpu && limits.max_storage_range > 100u << 20);
        EXPECT_LT(largest_difference(a, b), precision == DType::f32 ? 1e-4 : 3e-2);
    }
}

// force_upcast stores the residual stream divided by 32, which changes rounding and nothing else
TEST(engine_networks, decode_the_same_image_with_a_scaled_stream)
{
    size_t passes;
    VaeConfig config = small_vae();
    const HostImages exact = decode("", DType::f32, config, 9, 7, passes);
    const HostImages scaled = decode("", DType::f16, config, 9, 7, passes);
    config.force_upcast = false;
    const HostImages plain = decode("", DType::f16, config, 9, 7, passes);
    EXPECT_LT(largest_difference(exact, scaled), 2e-2);
    EXPECT_LT(largest_difference(exact, plain), 2e-2);
    EXPECT_NE(largest_difference(plain, scaled), 0);
}

// one evaluation over `images` copies of a sample
HostImages evaluate(const UnetConfig& config, DType precision, uint32_t images, uint32_t height, uint32_t width)
{
    Device& device = test_device();
    auto unet = Unet::load(device, config, Checkpoint::random(4), precision);
    SR_ASSERT(bool(unet), "{}", unet.error().message);
    KernelCase k(device);
    const HostImages one = random_images(k, 1, height, width, config.in_channels, precision);
    HostImages x{height, width, HostMatrix(images * one.image_rows(), config.in_channels, precision)};
    for (uint32_t r = 0; r < x.rows.rows; ++r)
        for (uint32_t c = 0; c < config.in_channels; ++c)
            x.rows.set(r, c, one.rows.at(r % one.image_rows(), c));
    const Tensor text = k.input(k.random(5, config.cross_attention_dim, precision));
    const Tensor table = (*unet)->time_table(k.graph, k.input(std::vector<float>{321}));
    const Tensor context = (*unet)->context_table(k.graph, text);
    const FeatureMap y =
        (*unet)->forward(k.graph, x.input(k), table, k.input(std::vector<uint32_t>(images, 0)), {context, 5, 0});
    return {y.height, y.width, k.run(y.data)};
}

TEST(engine_networks, evaluate_every_image_of_a_batch_alike_at_odd_sizes)
{
    for (DType precision : {DType::f32, DType::f16})
        for (const auto& [height, width] : {std::pair{9u, 7u}, std::pair{6u, 13u}, std::pair{8u, 8u}}) {
            const HostImages one = evaluate(small_unet(), precision, 1, height, width);
            const HostImages three = evaluate(small_unet(), precision, 3, height, width);
            ASSERT_EQ(one.height, height);
            ASSERT_EQ(one.width, width);
            for (uint32_t i = 0; i < 3; ++i)
                for (uint32_t p = 0; p < height * width; ++p)
                    for (uint32_t c = 0; c < 4; ++c) {
                        const float v = one.at(0, p / width, p % width, c);
                        ASSERT_TRUE(std::isfinite(v));
                        ASSERT_EQ(v, three.at(i, p / width, p % width, c)) << "image " << i << " pixel " << p;
                    }
        }
}

UnetConfig small_video_unet()
{
    UnetConfig c = small_unet();
    c.in_channels = 9;
    c.block_out_channels = {32, 96, 64};
    c.video = true;
    c.norm_num_groups = 32;
    c.use_linear_projection = true;
    c.added_embed_dim = 8;
    c.added_numbers = 3;
    return c;
}

// one evaluation over `copies` of a video of three frames
HostImages evaluate_videos(DType precision, uint32_t copies, uint32_t height, uint32_t width)
{
    constexpr uint32_t kFrames = 3;
    const UnetConfig config = small_video_unet();
    auto unet = Unet::load(test_device(), config, Checkpoint::random(5), precision);
    SR_ASSERT(bool(unet), "{}", unet.error().message);
    KernelCase k(test_device());
    const HostImages one = random_images(k, kFrames, height, width, config.in_channels, precision);
    HostImages x{height, width, HostMatrix(copies * one.rows.rows, config.in_channels, precision)};
    for (uint32_t r = 0; r < x.rows.rows; ++r)
        for (uint32_t c = 0; c < config.in_channels; ++c)
            x.rows.set(r, c, one.rows.at(r % one.rows.rows, c));
    std::vector<uint32_t> number, row(copies * kFrames, 0);
    for (uint32_t i = 0; i < copies * kFrames; ++i)
        number.push_back(i % kFrames);
    const Tensor text = k.input(k.random(2, config.cross_attention_dim, precision));
    const Tensor added = k.input(std::vector<float>{6, 127, 0.02f}, 3);
    const Tensor table = (*unet)->time_table(k.graph, k.input(std::vector<float>{0.4f}), {}, added);
    const Tensor context = (*unet)->context_table(k.graph, text);
    const Tensor made = (*unet)->frame_table(k.graph, k.input(std::vector<float>{0, 1, 2}));
    const Tensor frames = k.output(made.rows, made.cols, made.dtype, made.ld);
    k.graph.keep(made, frames);
    const Unet::Videos videos{{kFrames, frames, k.input(number)}, k.input(std::vector<uint32_t>(copies, 0))};
    const FeatureMap y = (*unet)->forward(k.graph, x.input(k), table, k.input(row), {context, 2, 0}, videos);
    return {y.height, y.width, k.run(y.data)};
}

void expect_same(const HostImages& video, const HostImages& videos)
{
    const uint32_t frames = video.batch();
    for (uint32_t i = 0; i < videos.batch(); ++i)
        for (uint32_t p = 0; p < video.height * video.width; ++p)
            for (uint32_t c = 0; c < 4; ++c) {
                const float v = video.at(i % frames, p / video.width, p % video.width, c);
                ASSERT_TRUE(std::isfinite(v));
                ASSERT_EQ(v, videos.at(i, p / video.width, p % video.width, c)) << "image " << i << " pixel " << p;
            }
}

TEST(engine_networks, of_videos_have_the_parameters_of_stable_video_diffusion)
{
    const auto config = [](const char* name) {
        return (*read_json(SEMROVER_SOURCE_DIR "/tests/golden/layouts/" + std::string(name)))["config"];
    };
    const UnetConfig unet = *parse_video_unet_config(config("svd_vsd_unet.json"));
    EXPECT_EQ(Unet::plan(unet, DType::f16)->parameters(), 1524625962u);
    const VaeConfig vae = *parse_video_vae_config(config("svd_vae.json"));
    EXPECT_EQ(Vae::plan(vae, DType::f16)->parameters(), 97742847u);
}

TEST(engine_networks, evaluate_every_video_of_a_batch_alike)
{
    for (DType precision : {DType::f32, DType::f16})
        expect_same(evaluate_videos(precision, 1, 9, 7), evaluate_videos(precision, 2, 9, 7));
}

TEST(engine_networks, refuse_a_network_without_its_weights)
{
    const Path empty = ::testing::TempDir() + "semrover_no_weights";
    std::filesystem::create_directories(empty);
    EXPECT_FALSE(Checkpoint::open_folder(empty, Checkpoint::Network::unet));
    std::filesystem::remove_all(empty);
}

} // namespace engine_networks_test
} // namespace semrover
