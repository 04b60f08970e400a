// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/frame_refiner.h"

#include <cstring>

namespace semrover {

namespace {

// [pixels, channels] of a slot's bytes
std::vector<float> rows_of(const Slot& slot, uint32_t pixels, std::span<const std::byte> bytes)
{
    std::vector<float> values(size_t(pixels) * slot.cols());
    for (uint32_t i = 0; i < pixels; ++i)
        std::memcpy(&values[size_t(i) * slot.cols()], &bytes[size_t(i) * slot.ld() * 4], slot.cols() * 4ull);
    return values;
}

} // namespace

// histories are there from the first task on, as they are planned
Status FrameRefiner::start(const RendererWork& work, const RendererWork& total)
{
    for (const RefineChain& c : p_.chains)
        if (c.history > 0 && !trails_[&c].history) {
            SR_TRY(trails_[&c].history,
                   FrameHistory::create(p_.device, c.size, c.cameras.front().intrinsics.model, c.history));
        }
    return renderer_->start(work, total);
}

void FrameRefiner::give_buffer(const std::string& camera, const Slot& seen)
{
    Trail& t = trails_[chain_of(camera)];
    t.seen = seen;
    ++t.given;
}

bool FrameRefiner::waits() const
{
    const RefineTask* t = order_.drawn ? schedule_.task() : nullptr;
    if (!t || t->part == RefinePart::decode)
        return false;
    const auto found = trails_.find(t->chain);
    return found == trails_.end() || found->second.given <= t->frame();
}

Status FrameRefiner::encode(const RefineTask& t)
{
    if (order_.drawn)
        return renderer_->encode_seen(trails_[t.chain].seen);
    SR_TRY(const BufferFrame buffer, read_buffer(t.chain->camera, t.frame()));
    if (!staged())
        return renderer_->encode_seen(seen_words(buffer));
    SR_TRY(std::vector<float> latent, renderer_->encode(floats_of_pixels(buffer.color)));
    return save_latent(PieceKind::encoded, *t.chain, t.frame(), std::move(latent));
}

// of this start of the run, or from an earlier one's file
Result<std::vector<float>> FrameRefiner::latent(const RefineChain& c, uint32_t frame)
{
    SR_CHECK(p_.out.arrive());
    const Trail& t = trails_[&c];
    if (t.frame == frame && !t.latent.empty())
        return t.latent;
    return p_.store.load_latent(PieceKind::latent, c.camera, frame, c.size);
}

Result<std::vector<float>> FrameRefiner::latent_before(const RefineTask& t)
{
    if (t.frame() == t.chain->range.first)
        return t.chain->before;
    return latent(*t.chain, t.frame() - 1);
}

Status FrameRefiner::begin_window(const RefineTask& t)
{
    SR_TRY(const std::span<const NoiseKey> noise, keys(*t.chain, t.frame()));
    return staged() ? begin_staged(t, noise) : begin_resident(t, noise);
}

Status FrameRefiner::begin_staged(const RefineTask& t, std::span<const NoiseKey> noise)
{
    const RefineChain& c = *t.chain;
    SR_TRY(const BufferFrame buffer, read_buffer(c.camera, t.frame()));
    SR_TRY(const std::vector<float> encoded, p_.store.load_latent(PieceKind::encoded, c.camera, t.frame(), c.size));
    const std::vector<float> visible = block_shares(c.size, buffer.visible);
    SR_TRY(const std::vector<float> before, latent_before(t));
    return renderer_->begin({t.frame(), chain_key(c.camera.name), encoded, visible, before, noise});
}

Status FrameRefiner::begin_resident(const RefineTask& t, std::span<const NoiseKey> noise)
{
    const RefineChain& c = *t.chain;
    if (!schedule_.follows_encode()) { // a staged start of the run did that
        SR_TRY(const BufferFrame buffer, read_buffer(c.camera, t.frame()));
        SR_TRY(const std::vector<float> encoded, p_.store.load_latent(PieceKind::encoded, c.camera, t.frame(), c.size));
        SR_CHECK(renderer_->use_latent(encoded, block_shares(c.size, buffer.visible)));
    }
    const bool first = t.frame() == c.range.first && c.before.empty();
    if (!first && (on_device_ != &c || frame_on_device_ + 1 != t.frame())) {
        SR_TRY(const std::vector<float> before, latent_before(t));
        SR_CHECK(renderer_->use_previous(before));
    }
    on_device_ = nullptr;
    return renderer_->begin_frame({t.frame(), chain_key(c.camera.name), first, noise});
}

Status FrameRefiner::end_window(const RefineTask& t)
{
    const auto keep = [this, t](std::vector<float> latent) {
        Trail& trail = trails_[t.chain];
        trail.frame = t.frame();
        trail.latent = latent;
        return save_latent(PieceKind::latent, *t.chain, t.frame(), std::move(latent));
    };
    if (staged()) {
        SR_TRY(std::vector<float> latent, renderer_->finish());
        return keep(std::move(latent));
    }
    SR_CHECK(renderer_->end_frame());
    on_device_ = t.chain;
    frame_on_device_ = t.frame();
    const Slot& slot = renderer_->denoiser()->slots().latent;
    return p_.out.read(slot, [slot, keep, pixels = t.chain->size.pixels()](std::span<const std::byte> bytes) {
        return keep(rows_of(slot, pixels, bytes));
    });
}

// What was not kept without a loss, from the first frame on. Its latents are there.
Status FrameRefiner::decode_again(const RefineTask& t, FrameHistory& history)
{
    const RefineChain& c = *t.chain;
    for (uint32_t f = c.range.first; f < t.frame(); ++f) {
        SR_TRY(const std::vector<float> values, latent(c, f));
        SR_TRY(const std::vector<float> image, renderer_->decode(values));
        SR_TRY(const ImageGray16 depth, depth_of(c, f));
        SR_CHECK(history.add(pixels_of_floats(image), c.cameras[f], depth));
    }
    return {};
}

// none: it is a first frame
Result<std::vector<uint8_t>> FrameRefiner::finished_before(const RefineTask& t) const
{
    if (t.frame() == t.chain->range.first)
        return t.chain->picture_before;
    SR_TRY(ImageRgb8 picture, p_.store.load_frame(t.chain->camera, t.frame() - 1));
    return std::move(picture.pixels);
}

// to the frame before
Status FrameRefiner::catch_up(const RefineTask& t)
{
    const RefineChain& c = *t.chain;
    if (trails_[&c].finished == t.frame())
        return {};
    FrameHistory& history = *trails_[&c].history;
    history.restart();
    if (t.frame() != c.range.first && !p_.store.lossless())
        return decode_again(t, history);
    SR_TRY(const std::vector<uint8_t> pixels, finished_before(t));
    if (pixels.empty())
        return {};
    SR_TRY(const ImageGray16 depth, depth_of(c, t.frame() - 1));
    return history.restore(pixels, c.cameras[t.frame() - 1], depth);
}

// decoded: pixels, or a slot of their words
template <typename Decoded>
Status FrameRefiner::accumulate(const RefineTask& t, const Decoded& decoded)
{
    const RefineChain& c = *t.chain;
    Trail& trail = trails_[&c];
    SR_TRY(const ImageGray16 depth, depth_of(c, t.frame()));
    SR_CHECK(trail.history->add(decoded, c.cameras[t.frame()], depth));
    trail.finished = t.frame() + 1;
    return read_frame(t, trail.history->frame());
}

Status FrameRefiner::read_frame(const RefineTask& t, const Slot& bytes)
{
    return p_.out.read(bytes,
                       [this, t](std::span<const std::byte> read) { return save_frame(*t.chain, t.frame(), read); });
}

Status FrameRefiner::decode(const RefineTask& t)
{
    const bool accumulated = t.chain->history > 0;
    if (accumulated)
        SR_CHECK(catch_up(t)); // which may decode others: before this one is
    if (on_device_ != t.chain || frame_on_device_ != t.frame()) {
        SR_TRY(const std::vector<float> values, latent(*t.chain, t.frame()));
        SR_TRY(const std::vector<float> image, renderer_->decode(values));
        const std::vector<uint8_t> pixels = pixels_of_floats(image);
        return accumulated ? accumulate(t, pixels) : save_frame(*t.chain, t.frame(), std::as_bytes(std::span(pixels)));
    }
    SR_TRY(const Slot bytes, renderer_->decode_latent());
    return accumulated ? accumulate(t, bytes) : read_frame(t, bytes);
}

} // namespace semrover
