// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover bench vsd: a window of the video renderer, random weights: one evaluation of its UNet with guidance, the
// encoding of a frame and the decoding of some, and a GEMM in the same run
#include "engine/deferred/frame_codec.h"
#include "engine/deferred/memory_plan.h"
#include "engine/model/renderer_model.h"
#include "runtime/base/json.h"
#include "tools/bench/bench.h"
#include "tools/bench/call_times.h"
#include "tools/cli/open_device.h"
#include "tools/cli/value_options.h"

#include <CLI/CLI.hpp>

namespace semrover {

namespace {

struct BenchVsdArguments {
    std::string unet, vae, precision = "fp16", weights, profile;
    uint32_t width = 576, height = 384, frames = VideoDefaults().window_frames;
    uint32_t decode_frames = VideoDefaults().decode_frames, tokens = 1, evaluations = 6;
    float cfg_scale = 3;
};

struct VideoNetworks {
    UnetConfig unet;
    VaeConfig vae;
};

// Stable Video Diffusion's, with the channels of the deferred renderer
Result<VideoNetworks> read_video_networks(const BenchVsdArguments& o)
{
    Json unet{{"in_channels", 9}, {"num_frames", 12}}, vae = Json::object();
    if (!o.unet.empty()) {
        SR_TRY(unet, read_json(o.unet));
    }
    if (!o.vae.empty()) {
        SR_TRY(vae, read_json(o.vae));
    }
    VideoNetworks n;
    SR_TRY(n.unet, parse_video_unet_config(unet));
    SR_CHECK(store_as(o.weights, n.unet));
    SR_TRY(n.vae, parse_video_vae_config(vae));
    return n;
}

// `runs` runs, the first of which does not count where there are others
Result<Timing> measure_runs(uint32_t runs, const std::function<Status()>& work)
{
    std::vector<double> times;
    for (uint32_t i = 0; i < runs; ++i) {
        const CallTimer one;
        SR_CHECK(work());
        times.push_back(one.ms());
    }
    if (times.size() > 1)
        times.erase(times.begin());
    return timing_of(std::move(times));
}

Result<Timing> time_encoder(FrameEncoder& encoder, const Vae& vae, const LatentSize& size, uint32_t runs)
{
    const std::vector<float> image(size_t(size.image_width) * size.image_height * vae.config().in_channels, 0.25f);
    return measure_runs(runs, [&] { return encoder.encode(image).map([](const auto&) {}); });
}

Result<Timing> time_decoder(FrameDecoder& decoder, const Vae& vae, const LatentSize& size, uint32_t frames,
                            uint32_t runs)
{
    const std::vector<float> latents(size_t(size.pixels()) * vae.config().latent_channels * frames, 0.25f);
    return measure_runs(runs, [&] { return decoder.decode(latents).map([](const auto&) {}); });
}

// the other networks' memory is gone afterwards
Result<double> gemm_rate(Device& device, DType dtype)
{
    BenchInputs inputs(device);
    SR_TRY(const auto executable, gemm_executable(device, inputs, {}, dtype));
    SR_TRY(const Timing timing, measure([&] { return executable->run(); }));
    return flops_of(*executable) / timing.ms_median / 1e6;
}

void add_shape(Json& report, const BenchVsdArguments& o, const Timing& encode, const Timing& decode)
{
    report["width"] = o.width;
    report["height"] = o.height;
    report["frames"] = o.frames;
    report["decode_frames"] = o.decode_frames;
    report["guidance_scale"] = o.cfg_scale;
    report["encode_ms"] = encode.ms_median;
    report["decode_ms"] = decode.ms_median;
}

Result<SamplingPlan> one_step()
{
    std::vector<std::string> warnings;
    SR_TRY(const SchedulerConfig scheduler, scheduler_config_from_json(video_scheduler_json(), warnings));
    return plan_sampling(scheduler, 1);
}

Result<Timing> time_window(VsdRenderer& vsd, const LatentSize& size, uint32_t channels, uint32_t runs)
{
    const std::vector<float> buffers(size_t(vsd.frames()) * size.pixels() * channels, 0.25f),
        visible(size_t(vsd.frames()) * size.pixels(), 1.f);
    const DenoiserWindow window{0, 0, buffers, visible};
    SR_CHECK(vsd.begin(window));
    SR_TRY(const Timing step, measure_runs(runs, [&]() -> Status {
               SR_CHECK(vsd.begin(window));
               return vsd.step(1).map([](bool) {});
           }));
    SR_CHECK(vsd.cancel());
    return step;
}

Status bench_vsd(const BenchVsdArguments& o, const Globals& globals)
{
    SR_TRY(const VideoNetworks n, read_video_networks(o));
    SR_TRY(const auto device, open_device(globals, o.profile));
    const DType dtype = o.precision == "fp32" ? DType::f32 : DType::f16;
    SR_TRY(const double gemm, gemm_rate(*device, dtype));
    device->reset_peak();
    const uint64_t before = device->allocated_bytes();
    const LatentSize size{o.width, o.height, n.vae.downscale()};
    SR_TRY(const auto vae, Vae::load(*device, n.vae, Checkpoint::random(1), dtype));
    SR_TRY(const auto unet, Unet::load(*device, n.unet, Checkpoint::random(1), dtype));
    SR_TRY(const SamplingPlan plan, one_step());
    VsdOptions options;
    options.last_guidance = o.cfg_scale;
    const std::vector<float> text(size_t(o.tokens) * n.unet.cross_attention_dim, 0.f), added(n.unet.added_numbers, 1.f);
    const RendererWork work{size, true, true, true, o.frames, o.decode_frames};
    SR_TRY(const RendererBytes planned,
           renderer_bytes(device->limits(), {*unet, *vae, plan, o.tokens, 1, options}, std::span(&work, 1)));
    SR_TRY(const auto arena, Arena::create(*device, planned.sizes.front().arena()));
    SR_TRY(const auto vsd,
           VsdRenderer::create(*device, *unet, plan, {o.tokens, text, added}, size, o.frames, options, arena));
    SR_TRY(const auto encoder, FrameEncoder::create(*device, *vae, size, true, arena));
    SR_TRY(const auto decoder, FrameDecoder::create(*device, *vae, size, o.decode_frames, arena));
    restart_profile(*device, o.profile);
    SR_TRY(const Timing encode, time_encoder(*encoder, *vae, size, o.evaluations));
    SR_TRY(const Timing decode, time_decoder(*decoder, *vae, size, o.decode_frames, o.evaluations));
    SR_TRY(const Timing step, time_window(*vsd, size, n.unet.out_channels, o.evaluations));
    Json report = bench_report("vsd", *device, dtype, step, before + planned.peak(MemoryPolicy::resident));
    report["staged_bytes"] = before + planned.peak(MemoryPolicy::staged);
    report["parameters"] = unet->parameters();
    add_shape(report, o, encode, decode);
    report["gemm_gflops"] = gemm;
    if (step.runs) {
        add_rate(report, flops_of(vsd->step_executable()), step);
        report["share_of_gemm"] = report["gflops"].get<double>() / gemm;
    }
    add_executable(report, vsd->step_executable());
    print_report(report, globals);
    return write_profile(*device, o.profile);
}

} // namespace

void add_bench_vsd(CLI::App& bench, const Globals& globals, Run& run)
{
    auto o = std::make_shared<BenchVsdArguments>();
    CLI::App* c = bench.add_subcommand("vsd", "an evaluation of the video renderer's UNet on a window, and its VAE");
    c->add_option("--config", o->unet, "the UNet's config.json; default: Stable Video Diffusion, 9 input channels");
    c->add_option("--vae-config", o->vae, "the VAE's; default: Stable Video Diffusion's");
    add_number(*c, "-W,--width", o->width, "pixels", 1, 16384);
    add_number(*c, "-H,--height", o->height, "pixels", 1, 16384);
    add_number(*c, "--frames", o->frames, "of the window", 1, kMostWindowFrames);
    add_number(*c, "--decode-frames", o->decode_frames, "decoded together", 1, kMostWindowFrames);
    add_number(*c, "--tokens", o->tokens, "tokens of the text", 1, 4096);
    add_number(*c, "--cfg-scale", o->cfg_scale, "guidance of the last frame, the first has 1; 1: no unconditional half",
               0, 1000);
    add_number(*c, "--evaluations", o->evaluations, "runs of each part, the first to warm up; 0: memory only", 0, 1000);
    add_choice(*c, "--precision", {"fp16", "fp32"}, "storage", o->precision);
    add_weights(*c, o->weights);
    add_profile(*c, o->profile);
    c->callback([o, &globals, &run] { run = [o, &globals] { return bench_vsd(*o, globals); }; });
}

} // namespace semrover
