// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/deferred/memory_plan.h"

#include "engine/deferred/frame_codec.h"

#include <algorithm>

namespace semrover {

std::string_view policy_name(MemoryPolicy policy)
{
    return policy == MemoryPolicy::resident ? "resident" : "staged";
}

ArenaSize RendererBytes::Size::arena() const
{
    ArenaSize arena;
    for (const PartBytes* part : {&encode, &denoise, &decode})
        arena.cover(part->arena);
    return arena;
}

uint64_t RendererBytes::peak(MemoryPolicy policy) const
{
    uint64_t peak = 0;
    for (const Size& s : sizes) {
        if (policy == MemoryPolicy::resident) {
            const uint64_t state = s.encode.state + s.denoise.state + s.decode.state;
            peak = std::max(peak, unet + vae + state + s.arena().bytes());
            continue;
        }
        if (s.work.encode || s.work.decode)
            peak = std::max(peak, vae + std::max(s.encode.bytes(), s.decode.bytes()));
        if (s.work.denoise)
            peak = std::max(peak, unet + s.apart.bytes());
    }
    return beside + peak;
}

const RendererBytes::Size& RendererBytes::of(const RendererWork& work) const
{
    const auto found = std::ranges::find_if(sizes, [&](const Size& s) { return s.work.same_shapes(work); });
    SR_ASSERT(found != sizes.end(), "work on pictures of {} x {} that was not planned", work.size.image_width,
              work.size.image_height);
    return *found;
}

namespace {

Result<PartBytes> denoiser_bytes(const DeviceLimits& limits, const RendererNetworks& n, const RendererWork& w,
                                 bool halves_apart)
{
    if (!n.unet.config().video)
        return AsdRenderer::planned_bytes(limits, n.unet, n.plan, n.text_tokens, w.size, n.guidance_scale);
    VsdOptions options = n.video;
    options.halves_apart = halves_apart;
    return VsdRenderer::planned_bytes(limits, n.unet, n.plan, n.text_tokens, w.size, w.frames, options);
}

Status plan_parts(const DeviceLimits& limits, const RendererNetworks& n, RendererBytes::Size& s)
{
    if (s.work.denoise) {
        SR_TRY(s.denoise, denoiser_bytes(limits, n, s.work, false));
        s.apart = s.denoise;
        if (n.unet.config().video) {
            SR_TRY(s.apart, denoiser_bytes(limits, n, s.work, true));
        }
    }
    if (s.work.encode) {
        SR_TRY(s.encode, FrameEncoder::planned_bytes(limits, n.vae, s.work.size));
    }
    if (s.work.decode) {
        SR_TRY(s.decode, FrameDecoder::planned_bytes(limits, n.vae, s.work.size, s.work.decode_frames));
    }
    return {};
}

} // namespace

Result<RendererBytes> renderer_bytes(const DeviceLimits& limits, const RendererNetworks& n,
                                     std::span<const RendererWork> work)
{
    RendererBytes bytes;
    for (const RendererWork& w : work) {
        const auto same = [&](const RendererBytes::Size& s) { return s.work.same_shapes(w); };
        auto size = std::ranges::find_if(bytes.sizes, same);
        if (size == bytes.sizes.end() && w.any())
            size = bytes.sizes.insert(size, {w, {}, {}, {}, {}});
        if (!w.any())
            continue;
        size->work.encode |= w.encode;
        size->work.denoise |= w.denoise;
        size->work.decode |= w.decode;
    }
    for (RendererBytes::Size& s : bytes.sizes) {
        SR_CHECK(plan_parts(limits, n, s));
        if (s.work.denoise)
            bytes.unet = n.unet.device_bytes(limits);
        if (s.work.encode || s.work.decode)
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
                "the renderer needs {}; `max_bytes` allows {}. Smaller frames or `precision` fp16 need less", needs,
                budget);
}

} // namespace semrover
