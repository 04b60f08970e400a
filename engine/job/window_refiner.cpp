// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/window_refiner.h"

namespace semrover {

namespace {

template <typename T>
void append(std::vector<T>& to, std::span<const T> values)
{
    to.insert(to.end(), values.begin(), values.end());
}

} // namespace

void WindowRefiner::give_buffer(const std::string&, const Slot&)
{
    SR_ASSERT(false, "windows are not refined while their frames are drawn");
}

WindowRefiner::Frame& WindowRefiner::at(const RefineChain& chain, uint32_t frame)
{
    if (chain_ != &chain)
        frames_.clear();
    chain_ = &chain;
    return frames_[frame];
}

Status WindowRefiner::encode(const RefineTask& t)
{
    SR_TRY(const BufferFrame buffer, read_buffer(t.chain->camera, t.frame()));
    SR_TRY(EncodedBuffer encoded, renderer_->encode(seen_words(buffer)));
    if (staged())
        return save_latent(PieceKind::encoded, *t.chain, t.frame(), std::move(encoded.latent));
    at(*t.chain, t.frame()).encoded = std::move(encoded);
    return {};
}

// of this start of the run, or from a file of a staged one
Result<const EncodedBuffer*> WindowRefiner::encoded(const RefineChain& c, uint32_t frame)
{
    EncodedBuffer& e = at(c, frame).encoded;
    if (e.latent.empty()) {
        SR_TRY(const BufferFrame buffer, read_buffer(c.camera, frame));
        SR_TRY(e.latent, p_.store.load_latent(PieceKind::encoded, c.camera, frame, c.size));
        e.visible = block_shares(c.size, buffer.visible);
    }
    return &e;
}

Result<std::span<const NoiseKey>> WindowRefiner::noise(const RefineChain& c, uint32_t frame)
{
    std::vector<NoiseKey>& kept = at(c, frame).keys;
    if (kept.empty()) {
        SR_TRY(const std::span<const NoiseKey> fresh, keys(c, frame));
        kept.assign(fresh.begin(), fresh.end());
    }
    return std::span<const NoiseKey>(kept);
}

Result<std::span<const float>> WindowRefiner::latent(const RefineChain& c, uint32_t frame)
{
    if (frame < c.range.first) {
        const size_t size = c.before.size() / (c.range.first - c.windows.front().first);
        return std::span<const float>(c.before).subspan((frame - c.windows.front().first) * size, size);
    }
    std::vector<float>& kept = at(c, frame).latent;
    if (kept.empty()) {
        SR_TRY(kept, p_.store.load_latent(PieceKind::latent, c.camera, frame, c.size));
    }
    return std::span<const float>(kept);
}

Status WindowRefiner::begin_window(const RefineTask& t)
{
    const RefineChain& c = *t.chain;
    std::vector<float> buffers, visible, known;
    std::vector<NoiseKey> noise_keys;
    for (uint32_t f = t.window.first; f < t.window.end(); ++f) {
        SR_TRY(const EncodedBuffer* buffer, encoded(c, f));
        append<float>(buffers, buffer->latent);
        append<float>(visible, buffer->visible);
        SR_TRY(const std::span<const NoiseKey> of_frame, noise(c, f));
        append(noise_keys, of_frame);
        if (f >= t.window.next())
            continue;
        SR_TRY(const std::span<const float> made, latent(c, f));
        append(known, made);
    }
    frames_.erase(frames_.begin(), frames_.lower_bound(t.window.first)); // of windows before
    return renderer_->begin({t.window.first, chain_key(c.camera.name), buffers, visible, known, noise_keys});
}

Status WindowRefiner::end_window(const RefineTask& t)
{
    SR_TRY(const std::vector<float> latents, renderer_->finish());
    const size_t size = latents.size() / t.window.count;
    for (uint32_t f = t.window.next(); f < t.window.end(); ++f) {
        const auto first = latents.begin() + std::ptrdiff_t((f - t.window.first) * size);
        std::vector<float>& made = at(*t.chain, f).latent;
        made.assign(first, first + std::ptrdiff_t(size));
        SR_CHECK(save_latent(PieceKind::latent, *t.chain, f, made));
    }
    return {};
}

Status WindowRefiner::decode(const RefineTask& t)
{
    std::vector<float> latents;
    for (uint32_t f = t.frames.first; f < t.frames.end(); ++f) {
        SR_TRY(const std::span<const float> made, latent(*t.chain, f));
        append(latents, made);
    }
    frames_.erase(frames_.begin(), frames_.lower_bound(t.window.first)); // of windows before
    SR_TRY(const VideoDecoder* decoder, renderer_->decode(latents));
    for (uint32_t f = t.frames.next(); f < t.frames.end(); ++f)
        SR_CHECK(
            p_.out.read(decoder->bytes(f - t.frames.first),
                        [this, c = t.chain, f](std::span<const std::byte> read) { return save_frame(*c, f, read); }));
    return {};
}

} // namespace semrover
