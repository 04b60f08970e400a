// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/refiner.h"

#include <algorithm>

namespace semrover {

namespace {

// says which frame an error is about
template <typename T>
T of_frame(const RefineTask& task, T result)
{
    if (!result && result.error().code == ErrorCode::internal)
        result.error().message =
            fmt::format("{}{}: {}", frame_text(task.chain->camera.name, task.frame()),
                        task.frames.made() > 1 ? ", or one made with it" : "", result.error().message);
    return result;
}

} // namespace

std::vector<uint32_t> seen_words(const BufferFrame& buffer)
{
    std::vector<uint32_t> words(buffer.visible.size());
    for (size_t i = 0; i < words.size(); ++i)
        words[i] = buffer.color[3 * i] | uint32_t(buffer.color[3 * i + 1]) << 8 |
                   uint32_t(buffer.color[3 * i + 2]) << 16 | (buffer.visible[i] ? 255u << 24 : 0u);
    return words;
}

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

void Refiner::give_depth(const std::string& camera, const ImageGray16& depth)
{
    const RefineChain* chain = chain_of(camera);
    Depths& depths = depths_[chain];
    const uint32_t frame = depths.given++;
    if (wants_depth(*chain, frame))
        depths.frames[frame] = depth;
    if (!chain->warped_noise)
        return;
    NoiseTrail& noise = noise_.try_emplace(chain, chain->size).first->second;
    noise.follow(chain->cameras[frame], depth);
}

// of a finished frame and of the one before it, until that is there
bool Refiner::wants_depth(const RefineChain& chain, uint32_t frame) const
{
    const FrameRange& range = chain.range;
    const auto left = [&](uint32_t f) {
        return f >= range.first && f <= range.last && !p_.store.has(PieceKind::frame, chain.camera, f);
    };
    // frames that were not kept without a loss are decoded again from the first one on
    return chain.history > 0 && (!p_.store.lossless() || left(frame) || left(frame + 1));
}

Result<ImageGray16> Refiner::depth_of(const RefineChain& c, uint32_t frame)
{
    std::map<uint32_t, ImageGray16>& frames = depths_[&c].frames;
    if (order_.drawn) {
        SR_CHECK(p_.out.arrive()); // with what was drawn
        frames.erase(frames.begin(), frames.lower_bound(frame));
        SR_ASSERT(frames.contains(frame), "the depth of frame {} was not drawn", frame);
    } else if (!frames.contains(frame)) {
        frames.clear();
        SR_TRY(frames[frame], read_depth(c.camera, frame));
    }
    return frames[frame];
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
    SR_CHECK(start(work_[task.chain], total_));
    SR_TRY(const bool done, act(task));
    schedule_.count(done);
    return settle();
}

Status Refiner::cancel()
{
    return std::exchange(begun_, false) ? cancel_window() : Status{};
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

Result<bool> Refiner::denoise(const RefineTask& task)
{
    if (!begun_)
        SR_CHECK(begin_window(task));
    begun_ = true;
    SR_TRY(const bool done, step_window());
    if (!done)
        return false;
    begun_ = false;
    SR_CHECK(end_window(task));
    return true;
}

// followed from the camera's first frame on, whichever frames are refined
Result<std::span<const NoiseKey>> Refiner::keys(const RefineChain& c, uint32_t frame)
{
    if (!c.warped_noise)
        return std::span<const NoiseKey>{};
    if (order_.drawn)
        SR_CHECK(p_.out.arrive()); // with what was drawn
    NoiseTrail& noise = noise_.try_emplace(&c, c.size).first->second;
    if (noise.frames() > frame + 1)
        noise = NoiseTrail(c.size);
    while (noise.frames() <= frame) {
        SR_TRY(const ImageGray16 depth,
               order_.drawn ? read_depth(c.camera, noise.frames()) : depth_of(c, noise.frames()));
        noise.follow(c.cameras[noise.frames()], depth);
    }
    return noise.keys();
}

Status Refiner::save_latent(PieceKind kind, const RefineChain& c, uint32_t frame, std::vector<float> latent)
{
    return p_.out.write([&store = p_.store, kind, &c, frame, values = std::move(latent)] {
        return store.save_latent(kind, c.camera, frame, c.size, values);
    });
}

Status Refiner::save_frame(const RefineChain& c, uint32_t frame, std::span<const std::byte> pixels)
{
    const auto* first = reinterpret_cast<const uint8_t*>(pixels.data());
    const size_t count = size_t(c.size.image_width) * c.size.image_height * 3;
    return p_.out.write([&store = p_.store, &c, frame, bytes = std::vector<uint8_t>(first, first + count)] {
        return store.save_frame(c.camera, frame, bytes);
    });
}

} // namespace semrover
