// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/deferred/deferred_renderer.h"

#include "engine/format/buffer_folder.h"
#include "runtime/base/hash.h"

namespace semrover {

namespace {

// noise key of a camera, from its name: the same whichever cameras are made beside it
uint32_t chain_key(const std::string& camera)
{
    if (camera.empty())
        return 0;
    Hash hash;
    hash.add(camera);
    return uint32_t(hash.value());
}

template <typename T>
void append(std::vector<T>& to, std::span<const T> values)
{
    to.insert(to.end(), values.begin(), values.end());
}

// says which frame an error is about
Result<bool> of_frame(const FrameTask& task, Result<bool> result)
{
    if (!result && result.error().code == ErrorCode::internal)
        result.error().message =
            fmt::format("{}{}: {}", frame_text(task.chain->name, task.frame()),
                        task.frames.made() > 1 ? ", or one made with it" : "", result.error().message);
    return result;
}

} // namespace

Status FrameStore::save_encoded(const CameraChain&, uint32_t frame, std::vector<float>)
{
    SR_ASSERT(false, "the encoded frame {} is not kept", frame);
    return {};
}

Result<EncodedBuffer> FrameStore::load_encoded(const CameraChain&, uint32_t frame)
{
    SR_ASSERT(false, "frame {} is denoised before it is encoded", frame);
    return EncodedBuffer{};
}

Result<std::vector<float>> FrameStore::load_latent(const CameraChain&, uint32_t frame)
{
    SR_ASSERT(false, "the latent of frame {} was not made", frame);
    return std::vector<float>{};
}

Result<std::vector<uint8_t>> FrameStore::load_frame(const CameraChain&, uint32_t frame)
{
    SR_ASSERT(false, "frame {} was not finished", frame);
    return std::vector<uint8_t>{};
}

DeferredRenderer::DeferredRenderer(Device& device, std::shared_ptr<LoadedNetworks> networks, RendererSettings settings,
                                   MemoryPlan plan, FrameStore& store)
    : device_(device), networks_(std::move(networks)), settings_(std::move(settings)), plan_(std::move(plan)),
      store_(store)
{
    settings_.vsd.halves_apart = staged();
}

Result<std::unique_ptr<DeferredRenderer>>
DeferredRenderer::create(Device& device, std::shared_ptr<LoadedNetworks> networks, RendererSettings settings,
                         MemoryPlan plan, std::span<const CameraChain* const> chains, FrameStore& store)
{
    std::unique_ptr<DeferredRenderer> r(
        new DeferredRenderer(device, std::move(networks), std::move(settings), std::move(plan), store));
    for (const CameraChain* c : chains) // histories are there from the beginning, as they are planned
        if (Chain& chain = r->chains_[c]; c->history > 0) {
            SR_TRY(chain.history, FrameHistory::create(device, c->size(), c->model, c->history));
        }
    if (r->staged())
        return r;
    for (const RendererBytes::Size& s : r->plan_.parts.sizes) {
        if (s.work.encode || s.work.decode)
            SR_CHECK(r->networks_.vae());
        if (s.work.denoise)
            SR_CHECK(r->networks_.unet());
    }
    if (!r->plan_.parts.sizes.empty())
        SR_CHECK(r->load(r->plan_.parts.sizes.front()));
    return r;
}

void DeferredRenderer::drop_parts()
{
    encoder_.reset();
    denoiser_.reset();
    decoder_.reset();
    arena_.reset();
}

// all parts for work of one size, with the resident policy
Status DeferredRenderer::load(const RendererBytes::Size& size)
{
    drop_parts();
    work_ = size.work;
    SR_TRY(arena_, Arena::create(device_, size.arena()));
    for (const auto& [part, wanted] : {std::pair{FramePart::encode, work_.encode},
                                       {FramePart::denoise, work_.denoise},
                                       {FramePart::decode, work_.decode}})
        if (wanted)
            SR_CHECK(make(part));
    return {};
}

// makes room for a part of the work, and makes it, where it is not there
Status DeferredRenderer::use(const RendererWork& work, FramePart part)
{
    if (!staged())
        return work_.same_shapes(work) ? Status{} : load(plan_.parts.of(work));
    if (!work_.same_shapes(work))
        drop_parts();
    work_ = work;
    if (part != FramePart::encode)
        encoder_.reset();
    if (part != FramePart::denoise) {
        denoiser_.reset();
        networks_.drop_unet();
    }
    if (part != FramePart::decode)
        decoder_.reset();
    if (part == FramePart::denoise)
        networks_.drop_vae();
    return make(part);
}

Status DeferredRenderer::make(FramePart part)
{
    if (part == FramePart::denoise)
        return denoiser_ ? Status{} : make_denoiser();
    SR_TRY(const Vae* vae, networks_.vae());
    if (part == FramePart::encode && !encoder_) {
        SR_TRY(encoder_, FrameEncoder::create(device_, *vae, work_.size, video(), arena_));
    }
    if (part == FramePart::decode && !decoder_) {
        SR_TRY(decoder_, FrameDecoder::create(device_, *vae, work_.size, work_.decode_frames, arena_));
    }
    return {};
}

Status DeferredRenderer::make_denoiser()
{
    const RendererModel& m = model();
    SR_TRY(const Unet* unet, networks_.unet());
    if (video()) {
        const Conditioning conditioning{m.conditioning_tokens, m.conditioning, m.defaults.video.added_numbers};
        SR_TRY(denoiser_, VsdRenderer::create(device_, *unet, settings_.plan, conditioning, work_.size, work_.frames,
                                              settings_.vsd, arena_));
    } else {
        SR_TRY(denoiser_, AsdRenderer::create(device_, *unet, settings_.plan, {m.conditioning_tokens, m.conditioning},
                                              work_.size, settings_.asd, arena_));
    }
    return {};
}

Result<bool> DeferredRenderer::step(const FrameTask& task)
{
    SR_CHECK(use(task.chain->work, task.part));
    if (task.part == FramePart::denoise)
        return of_frame(task, denoise(task));
    const Status done = task.part == FramePart::encode ? encode(task) : decode(task);
    return of_frame(task, done.map([] { return true; }));
}

Status DeferredRenderer::cancel()
{
    return std::exchange(begun_, false) ? denoiser_->cancel() : Status{};
}

void DeferredRenderer::forget(const CameraChain& chain, uint32_t frame)
{
    Chain& c = chains_[&chain];
    c.frames.erase(c.frames.lower_bound(frame), c.frames.end());
    if (c.finished.value_or(0) > frame)
        c.finished.reset();
}

Status DeferredRenderer::encode(const FrameTask& t)
{
    SR_CHECK(store_.read_seen(*t.chain, t.frame(), encoder_->seen()));
    SR_TRY(EncodedBuffer buffer, encoder_->encode_seen());
    if (staged() && store_.keeps_encoded())
        return store_.save_encoded(*t.chain, t.frame(), std::move(buffer.latent));
    chains_[t.chain].frames[t.frame()].encoded = std::move(buffer);
    return {};
}

Result<const EncodedBuffer*> DeferredRenderer::encoded(const CameraChain& c, uint32_t frame)
{
    EncodedBuffer& buffer = chains_[&c].frames[frame].encoded;
    if (buffer.latent.empty()) {
        SR_TRY(buffer, store_.load_encoded(c, frame));
    }
    return &buffer;
}

Result<std::span<const float>> DeferredRenderer::latent(const CameraChain& c, uint32_t frame)
{
    std::vector<float>& latent = chains_[&c].frames[frame].latent;
    if (latent.empty()) {
        SR_TRY(latent, store_.load_latent(c, frame));
    }
    return std::span<const float>(latent);
}

// followed from the camera's first frame on, whichever frames are made; empty: each frame has its own
Result<std::span<const NoiseKey>> DeferredRenderer::noise(const CameraChain& c, uint32_t frame)
{
    if (!c.warped_noise)
        return std::span<const NoiseKey>{};
    std::map<uint32_t, Frame>& frames = chains_[&c].frames;
    std::optional<NoiseTrail>& noise = frames[frame].noise;
    if (!noise) {
        const auto before = frame > 0 ? frames.find(frame - 1) : frames.end();
        NoiseTrail trail =
            before != frames.end() && before->second.noise ? *before->second.noise : NoiseTrail(c.size());
        while (trail.frames() <= frame) {
            SR_TRY(const FrameView view, store_.view(c, trail.frames()));
            trail.follow(view.camera, view.depth);
        }
        noise = std::move(trail);
    }
    return noise->keys();
}

Result<bool> DeferredRenderer::denoise(const FrameTask& task)
{
    if (!begun_)
        SR_CHECK(begin_window(task));
    begun_ = true;
    SR_TRY(const bool done, denoiser_->step(1));
    if (!done)
        return false;
    begun_ = false;
    SR_CHECK(end_window(task));
    return true;
}

Status DeferredRenderer::begin_window(const FrameTask& t)
{
    const CameraChain& c = *t.chain;
    const FrameWindow& w = t.window;
    std::vector<float> buffers, visible, known;
    std::vector<NoiseKey> keys;
    for (uint32_t f = w.first; f < w.end(); ++f) {
        SR_TRY(const EncodedBuffer* buffer, encoded(c, f));
        append<float>(buffers, buffer->latent);
        append<float>(visible, buffer->visible);
        SR_TRY(const std::span<const NoiseKey> of_frame, noise(c, f));
        append(keys, of_frame);
    }
    // ASD sees the frame before
    const uint32_t seen = !video() && w.first > c.first - c.before ? w.first - 1 : w.first;
    for (uint32_t f = seen; f < w.next(); ++f) {
        SR_TRY(const std::span<const float> made, latent(c, f));
        append(known, made);
    }
    std::map<uint32_t, Frame>& frames = chains_[&c].frames;
    frames.erase(frames.begin(), frames.lower_bound(seen)); // of windows before
    return denoiser_->begin({w.first, chain_key(c.name), buffers, visible, known, keys});
}

Status DeferredRenderer::end_window(const FrameTask& t)
{
    SR_TRY(const std::vector<float> latents, denoiser_->finish());
    const size_t size = latents.size() / t.window.count;
    for (uint32_t f = t.window.next(); f < t.window.end(); ++f) {
        const auto first = latents.begin() + std::ptrdiff_t((f - t.window.first) * size);
        std::vector<float>& made = chains_[t.chain].frames[f].latent;
        made.assign(first, first + std::ptrdiff_t(size));
        SR_CHECK(store_.save_latent(*t.chain, f, made));
    }
    return {};
}

Status DeferredRenderer::decode_latents(const CameraChain& c, const FrameWindow& w)
{
    std::vector<float> latents;
    for (uint32_t f = w.first; f < w.end(); ++f) {
        SR_TRY(const std::span<const float> made, latent(c, f));
        append(latents, made);
    }
    return decoder_->decode_bytes(latents);
}

// the history up to the frame before
Status DeferredRenderer::catch_up(const CameraChain& c, uint32_t frame)
{
    Chain& chain = chains_[&c];
    if (chain.finished == frame)
        return {};
    chain.history->restart();
    if (frame == 0)
        return {};
    SR_TRY(const std::vector<uint8_t> pixels, store_.load_frame(c, frame - 1));
    if (!pixels.empty()) {
        SR_TRY(const FrameView view, store_.view(c, frame - 1));
        return chain.history->restore(pixels, view.camera, view.depth);
    }
    if (frame <= c.first)
        return {};
    SR_CHECK(catch_up(c, c.first)); // what was not kept without a loss is decoded again from the first frame on
    for (uint32_t f = c.first; f < frame; ++f) {
        SR_CHECK(decode_latents(c, {f, 1, 0}));
        SR_CHECK(accumulate(c, f));
        chain.history->keep();
    }
    return {};
}

// the frame that was decoded last
Status DeferredRenderer::accumulate(const CameraChain& c, uint32_t frame)
{
    SR_TRY(const FrameView view, store_.view(c, frame));
    return chains_[&c].history->add(decoder_->bytes(0), view.camera, view.depth);
}

Status DeferredRenderer::decode(const FrameTask& t)
{
    const CameraChain& c = *t.chain;
    Chain& chain = chains_[&c];
    if (c.history > 0)
        SR_CHECK(catch_up(c, t.frame())); // which may decode others: before this one is
    SR_CHECK(decode_latents(c, t.frames));
    if (c.history > 0) {
        SR_CHECK(accumulate(c, t.frame()));
        SR_CHECK(store_.save_frame(c, t.frame(), chain.history->frame()));
        chain.history->keep();
        chain.finished = t.frame() + 1;
    } else {
        for (uint32_t f = t.frames.next(); f < t.frames.end(); ++f)
            SR_CHECK(store_.save_frame(c, f, decoder_->bytes(f - t.frames.first)));
    }
    chain.frames.erase(chain.frames.begin(), chain.frames.lower_bound(t.window.first)); // of windows before
    return {};
}

Result<MemoryPlan> plan_renderer(Device& device, const LoadedNetworks& networks, const RendererSettings& settings,
                                 std::span<const RendererWork> work, uint64_t beside)
{
    const RendererModel& m = networks.model();
    const auto unet = Unet::plan(m.unet, networks.precision());
    const auto vae = Vae::plan(m.vae, networks.precision());
    SR_TRY(RendererBytes parts,
           renderer_bytes(
               device.limits(),
               {*unet, *vae, settings.plan, m.conditioning_tokens, settings.asd.guidance_scale, settings.vsd}, work));
    const LoadedNetworks::Loaded loaded = networks.loaded();
    if (loaded.unet)
        parts.unet = 0;
    if (loaded.vae)
        parts.vae = 0;
    parts.beside = beside;
    return plan_memory(std::move(parts), device.allocated_bytes() - loaded.kept, device.budget());
}

} // namespace semrover
