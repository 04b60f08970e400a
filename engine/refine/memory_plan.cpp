// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/refine/memory_plan.h"

#include "engine/refine/video_decoder.h"

#include <algorithm>

namespace semrover {

std::string_view policy_name(MemoryPolicy policy)
{
    return policy == MemoryPolicy::resident ? "resident" : "staged";
}

uint64_t RendererBytes::peak(MemoryPolicy policy) const
{
    uint64_t peak = 0;
    for (const Size& s : sizes) {
        if (policy == MemoryPolicy::resident) {
            peak = std::max(peak, unet + vae + s.state + std::max({s.denoise, s.encode, s.decode}));
            continue;
        }
        if (s.encode || s.decode)
            peak = std::max(peak, vae + std::max(s.encode, s.decode));
        if (s.denoise)
            peak = std::max(peak, unet + s.apart);
    }
    return outgoing + peak;
}

namespace {

Result<AsdRenderer::Bytes> denoiser_bytes(const DeviceLimits& limits, const RendererNetworks& n, const RendererWork& w,
                                          bool halves_apart)
{
    if (!n.unet.config().video)
        return AsdRenderer::planned_bytes(limits, n.unet, n.plan, n.text_tokens, w.size, n.guidance_scale);
    VsdOptions options = n.video;
    options.halves_apart = halves_apart;
    return VsdRenderer::planned_bytes(limits, n.unet, n.plan, n.text_tokens, w.size, w.frames, options);
}

Result<uint64_t> decoder_bytes(const DeviceLimits& limits, const RendererNetworks& n, const RendererWork& w)
{
    if (n.unet.config().video)
        return VideoDecoder::planned_bytes(limits, n.vae, w.size, w.decode_frames);
    return LatentCodec::planned_bytes(limits, n.vae, w.size, CodecDirection::decode);
}

} // namespace

Result<RendererBytes> renderer_bytes(const DeviceLimits& limits, const RendererNetworks& n,
                                     std::span<const RendererWork> work)
{
    RendererBytes bytes;
    for (const RendererWork& w : work) {
        RendererBytes::Size& s = bytes.sizes.emplace_back();
        if (w.denoise) {
            SR_TRY(const AsdRenderer::Bytes denoiser, denoiser_bytes(limits, n, w, false));
            AsdRenderer::Bytes apart = denoiser;
            if (n.unet.config().video) {
                SR_TRY(apart, denoiser_bytes(limits, n, w, true));
            }
            s.state = denoiser.state;
            s.denoise = denoiser.programs;
            s.apart = apart.state + apart.programs;
            bytes.unet = n.unet.device_bytes(limits);
        }
        if (w.encode) {
            SR_TRY(s.encode, LatentCodec::planned_bytes(limits, n.vae, w.size, CodecDirection::encode));
        }
        if (w.decode) {
            SR_TRY(s.decode, decoder_bytes(limits, n, w));
        }
        if (w.encode || w.decode)
            bytes.vae = n.vae.device_bytes(limits);
    }
    return bytes;
}

Result<MemoryPlan> plan_memory(RendererBytes parts, uint64_t allocated, uint64_t budget)
{
    std::string needs;
    for (MemoryPolicy policy : {MemoryPolicy::resident, MemoryPolicy::staged}) {
        const uint64_t bytes = allocated + parts.peak(policy);
        if (!budget || bytes <= budget)
            return MemoryPlan{policy, bytes, std::move(parts)};
        needs += fmt::format("{}{} bytes {}", needs.empty() ? "" : ", ", bytes, policy_name(policy));
    }
    return fail(ErrorCode::out_of_memory,
                "the renderer needs {}; --max-vram allows {}. Smaller frames or --precision fp16 need less", needs,
                budget);
}

} // namespace semrover
