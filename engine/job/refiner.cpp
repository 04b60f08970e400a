// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/refiner.h"

#include <algorithm>
#include <cstring>

namespace semrover {

namespace {

// says which frame an error is about
template <typename T>
T of_frame(const RefineTask& task, T result)
{
    if (!result && result.error().code == ErrorCode::internal)
        result.error().message =
            fmt::format("{}: {}", frame_text(task.chain->camera.name, task.frame), result.error().message);
    return result;
}

// a buffer's files as splat_pixels() would make them
std::vector<uint32_t> seen_words(const BufferFrame& buffer)
{
    std::vector<uint32_t> words(buffer.visible.size());
    for (size_t i = 0; i < words.size(); ++i)
        words[i] = buffer.color[3 * i] | uint32_t(buffer.color[3 * i + 1]) << 8 |
                   uint32_t(buffer.color[3 * i + 2]) << 16 | (buffer.visible[i] ? 255u << 24 : 0u);
    return words;
}

// [pixels, channels] of a slot's bytes
std::vector<float> rows_of(const Slot& slot, uint32_t pixels, std::span<const std::byte> bytes)
{
    std::vector<float> values(size_t(pixels) * slot.cols());
    for (uint32_t i = 0; i < pixels; ++i)
        std::memcpy(&values[size_t(i) * slot.cols()], &bytes[size_t(i) * slot.ld() * 4], slot.cols() * 4ull);
    return values;
}

} // namespace

Refiner::Refiner(const Parts& parts, const RefineOrder& order, const JobCallbacks& callbacks)
    : p_(parts), order_(order), schedule_(parts.store, parts.chains, order, callbacks, parts.device)
{
    for (const RefineChain& c : p_.chains) {
        const RendererWork w = work_[&c] = work_left(p_.store, c);
        total_.encode |= w.encode;
        total_.denoise |= w.denoise;
        total_.decode |= w.decode;
    }
}

const RefineChain* Refiner::chain_of(const std::string& camera) const
{
    for (const RefineChain& c : p_.chains)
        if (c.camera.name == camera)
            return &c;
    return nullptr;
}

void Refiner::give_buffer(const std::string& camera, const Slot& seen)
{
    Trail& t = trails_[chain_of(camera)];
    t.seen = seen;
    ++t.given;
}

void Refiner::give_depth(const std::string& camera, const ImageGray16& depth)
{
    const RefineChain* chain = chain_of(camera);
    if (chain->cameras.empty())
        return;
    auto& noise = trails_[chain].noise;
    if (!noise)
        noise.emplace(chain->size);
    noise->follow(chain->cameras[noise->frames()], depth);
}

bool Refiner::waits() const
{
    const RefineTask* t = order_.drawn ? schedule_.task() : nullptr;
    if (!t || t->part == RefinePart::decode)
        return false;
    const auto found = trails_.find(t->chain);
    return found == trails_.end() || found->second.given <= t->frame;
}

Result<bool> Refiner::settle()
{
    for (;;) {
        schedule_.enter();
        if (!schedule_.at_end_of_stage())
            return !schedule_.task();
        SR_CHECK(p_.out.drain()); // the next stage reads what this one wrote
        schedule_.leave();
    }
}

Result<bool> Refiner::step()
{
    SR_CHECK(p_.out.poll());
    SR_TRY(const bool over, settle());
    if (over)
        return true;
    const RefineTask task = *schedule_.task();
    const RendererWork& work = work_[task.chain];
    SR_CHECK(p_.renderer.start(work, total_));
    SR_TRY(const bool done, act(task));
    schedule_.count(done);
    return settle();
}

Status Refiner::cancel()
{
    return std::exchange(begun_, false) ? p_.renderer.cancel() : Status{};
}

void Refiner::close()
{
    if (schedule_.task())
        schedule_.leave();
}

Result<bool> Refiner::act(const RefineTask& task)
{
    if (task.part == RefinePart::denoise)
        return of_frame(task, denoise(task));
    SR_CHECK(of_frame(task, task.part == RefinePart::encode ? encode(task) : decode(task)));
    return true;
}

Status Refiner::save(PieceKind kind, const RefineTask& t, std::vector<float> latent)
{
    return p_.out.write([&store = p_.store, kind, t, values = std::move(latent)] {
        return store.save_latent(kind, t.chain->camera, t.frame, t.chain->size, values);
    });
}

Status Refiner::save_frame(const RefineTask& t, std::vector<uint8_t> pixels)
{
    return p_.out.write([&store = p_.store, t, bytes = std::move(pixels)] {
        return store.save_frame(t.chain->camera, t.frame, bytes);
    });
}

Status Refiner::encode(const RefineTask& t)
{
    if (order_.drawn)
        return p_.renderer.encode_seen(trails_[t.chain].seen);
    SR_TRY(const BufferFrame buffer, read_buffer(t.chain->camera, t.frame));
    if (!staged())
        return p_.renderer.encode_seen(seen_words(buffer));
    SR_TRY(std::vector<float> latent, p_.renderer.encode(floats_of_pixels(buffer.color)));
    return save(PieceKind::encoded, t, std::move(latent));
}

// noise of a frame, followed from the camera's first frame on, whichever frames are refined
Result<std::span<const NoiseKey>> Refiner::keys(const RefineChain& c, uint32_t frame)
{
    if (c.cameras.empty())
        return std::span<const NoiseKey>{};
    if (order_.drawn)
        SR_CHECK(p_.out.arrive()); // with what was drawn
    auto& noise = trails_[&c].noise;
    if (!noise || noise->frames() > frame + 1)
        noise.emplace(c.size);
    while (noise->frames() <= frame) {
        SR_TRY(const ImageGray16 depth, read_depth(c.camera, noise->frames()));
        noise->follow(c.cameras[noise->frames()], depth);
    }
    return noise->keys();
}

// of this start of the run, or from an earlier one's file
Result<std::vector<float>> Refiner::latent(const RefineChain& c, uint32_t frame)
{
    SR_CHECK(p_.out.arrive());
    const Trail& t = trails_[&c];
    if (t.frame == frame && !t.latent.empty())
        return t.latent;
    return p_.store.load_latent(PieceKind::latent, c.camera, frame, c.size);
}

Result<std::vector<float>> Refiner::latent_before(const RefineTask& t)
{
    if (t.frame == t.chain->range.first)
        return t.chain->before;
    return latent(*t.chain, t.frame - 1);
}

Status Refiner::begin_frame(const RefineTask& t)
{
    SR_TRY(const std::span<const NoiseKey> noise, keys(*t.chain, t.frame));
    SR_CHECK(staged() ? begin_staged(t, noise) : begin_resident(t, noise));
    begun_ = true;
    return {};
}

Status Refiner::begin_staged(const RefineTask& t, std::span<const NoiseKey> noise)
{
    const RefineChain& c = *t.chain;
    SR_TRY(const BufferFrame buffer, read_buffer(c.camera, t.frame));
    SR_TRY(const std::vector<float> encoded, p_.store.load_latent(PieceKind::encoded, c.camera, t.frame, c.size));
    const std::vector<float> visible = block_shares(c.size, buffer.visible);
    SR_TRY(const std::vector<float> before, latent_before(t));
    return p_.renderer.begin({t.frame, chain_key(c.camera.name), encoded, visible, before, noise});
}

Status Refiner::begin_resident(const RefineTask& t, std::span<const NoiseKey> noise)
{
    const RefineChain& c = *t.chain;
    if (!schedule_.follows_encode()) { // a staged start of the run did that
        SR_TRY(const BufferFrame buffer, read_buffer(c.camera, t.frame));
        SR_TRY(const std::vector<float> encoded, p_.store.load_latent(PieceKind::encoded, c.camera, t.frame, c.size));
        SR_CHECK(p_.renderer.use_latent(encoded, block_shares(c.size, buffer.visible)));
    }
    const bool first = t.frame == c.range.first && c.before.empty();
    if (!first && (on_device_ != &c || frame_on_device_ + 1 != t.frame)) {
        SR_TRY(const std::vector<float> before, latent_before(t));
        SR_CHECK(p_.renderer.use_previous(before));
    }
    on_device_ = nullptr;
    return p_.renderer.begin_frame({t.frame, chain_key(c.camera.name), first, noise});
}

Result<bool> Refiner::denoise(const RefineTask& t)
{
    if (!begun_)
        SR_CHECK(begin_frame(t));
    SR_TRY(const bool done, p_.renderer.step(1));
    if (!done)
        return false;
    begun_ = false;
    SR_CHECK(end_frame(t));
    return true;
}

Status Refiner::end_frame(const RefineTask& t)
{
    const auto keep = [this, t](std::vector<float> latent) {
        Trail& trail = trails_[t.chain];
        trail.frame = t.frame;
        trail.latent = latent;
        return save(PieceKind::latent, t, std::move(latent));
    };
    if (staged()) {
        SR_TRY(std::vector<float> latent, p_.renderer.finish());
        return keep(std::move(latent));
    }
    SR_CHECK(p_.renderer.end_frame());
    on_device_ = t.chain;
    frame_on_device_ = t.frame;
    const Slot& slot = p_.renderer.denoiser()->slots().latent;
    return p_.out.read(slot, [slot, keep, pixels = t.chain->size.pixels()](std::span<const std::byte> bytes) {
        return keep(rows_of(slot, pixels, bytes));
    });
}

Status Refiner::decode(const RefineTask& t)
{
    if (on_device_ != t.chain || frame_on_device_ != t.frame) {
        SR_TRY(const std::vector<float> values, latent(*t.chain, t.frame));
        SR_TRY(const std::vector<float> image, p_.renderer.decode(values));
        return save_frame(t, pixels_of_floats(image));
    }
    SR_TRY(const Slot bytes, p_.renderer.decode_latent());
    return p_.out.read(bytes, [this, t](std::span<const std::byte> read) {
        const auto* first = reinterpret_cast<const uint8_t*>(read.data());
        const size_t count = size_t(t.chain->size.image_width) * t.chain->size.image_height * 3;
        return save_frame(t, {first, first + count});
    });
}

} // namespace semrover
