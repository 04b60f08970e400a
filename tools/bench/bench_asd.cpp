// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover bench asd: one frame of the autoregressive renderer, random weights: a denoising step with guidance, and the
// encoding and decoding around the steps
#include "engine/deferred/asd.h"
#include "engine/deferred/frame_codec.h"
#include "engine/model/renderer_model.h"
#include "runtime/base/json.h"
#include "tools/bench/bench.h"
#include "tools/cli/open_device.h"
#include "tools/cli/value_options.h"

#include <CLI/CLI.hpp>

namespace semrover {

namespace {

struct BenchAsdArguments {
    std::string unet, vae, precision = "fp16", weights;
    uint32_t width = 616, height = 424, tokens = 77;
    float cfg_scale = 1.5f;
};

// a picture through one direction of the VAE, whose memory is gone afterwards
Result<Timing> time_encoder(Device& device, const Vae& vae, const LatentSize& size)
{
    SR_TRY(const auto encoder, FrameEncoder::create(device, vae, size, false));
    const std::vector<float> image(size_t(size.image_width) * size.image_height * vae.config().in_channels, 0.25f);
    return measure([&] { return encoder->encode(image).map([](const auto&) {}); });
}

Result<Timing> time_decoder(Device& device, const Vae& vae, const LatentSize& size)
{
    SR_TRY(const auto decoder, FrameDecoder::create(device, vae, size, 1));
    const std::vector<float> latent(size_t(size.pixels()) * vae.config().latent_channels, 0.25f);
    return measure([&] { return decoder->decode(latent).map([](const auto&) {}); });
}

Status bench_asd(const BenchAsdArguments& o, const Globals& globals)
{
    VaeConfig vae_config;
    UnetConfig unet_config;
    unet_config.in_channels = renderer_channels(vae_config);
    SR_CHECK(read_config(o.unet, parse_unet_config, unet_config));
    SR_CHECK(store_as(o.weights, unet_config));
    SR_CHECK(read_config(o.vae, parse_vae_config, vae_config));
    SR_TRY(const auto device, open_device(globals));
    const DType dtype = o.precision == "fp32" ? DType::f32 : DType::f16;
    const LatentSize size{o.width, o.height, vae_config.downscale()};
    SR_TRY(const auto vae, Vae::load(*device, vae_config, Checkpoint::random(1), dtype));
    SR_TRY(const Timing encode, time_encoder(*device, *vae, size));
    SR_TRY(const Timing decode, time_decoder(*device, *vae, size));
    device->reset_peak();
    SR_TRY(const auto unet, Unet::load(*device, unet_config, Checkpoint::random(1), dtype));
    SR_TRY(const SamplingPlan plan, plan_sampling(stable_diffusion_scheduler(), 1));
    const std::vector<float> text(size_t(o.tokens) * unet_config.cross_attention_dim, 0.f);
    AsdOptions options;
    options.guidance_scale = o.cfg_scale;
    SR_TRY(const auto asd, AsdRenderer::create(*device, *unet, plan, {o.tokens, text}, size, options));
    const std::vector<float> latent(size_t(size.pixels()) * unet_config.out_channels, 0.25f),
        visible(size.pixels(), 1.f);
    const DenoiserWindow frame{1, 0, latent, visible, latent};
    SR_TRY(const Timing step, measure([&] { return asd->render(frame).map([](const auto&) {}); }));
    SR_TRY(const PartBytes planned,
           AsdRenderer::planned_bytes(device->limits(), *unet, plan, o.tokens, size, o.cfg_scale));
    const uint64_t weights = vae->device_bytes(device->limits()) + unet->device_bytes(device->limits());
    Json report = bench_report("asd", *device, dtype, step, weights + planned.bytes());
    report["width"] = o.width;
    report["height"] = o.height;
    report["guidance_scale"] = o.cfg_scale;
    report["encode_ms"] = encode.ms_median;
    report["decode_ms"] = decode.ms_median;
    add_rate(report, flops_of(asd->step_executable()), step);
    add_executable(report, asd->step_executable());
    print_report(report, globals);
    return {};
}

} // namespace

void add_bench_asd(CLI::App& bench, const Globals& globals, Run& run)
{
    auto o = std::make_shared<BenchAsdArguments>();
    CLI::App* c = bench.add_subcommand("asd", "a denoising step of the autoregressive renderer, and its VAE");
    c->add_option("--config", o->unet, "the UNet's config.json; default: Stable Diffusion 1.5 with 13 input channels");
    c->add_option("--vae-config", o->vae, "the VAE's; default: Stable Diffusion 1.5's");
    add_number(*c, "-W,--width", o->width, "pixels", 1u, 16384u);
    add_number(*c, "-H,--height", o->height, "pixels", 1u, 16384u);
    add_number(*c, "--tokens", o->tokens, "tokens of the text", 1u, 4096u);
    add_number(*c, "--cfg-scale", o->cfg_scale, "guidance; 1: no unconditional half", 0, 1000);
    add_choice(*c, "--precision", {"fp16", "fp32"}, "storage", o->precision);
    add_weights(*c, o->weights);
    c->callback([o, &globals, &run] { run = [o, &globals] { return bench_asd(*o, globals); }; });
}

} // namespace semrover
