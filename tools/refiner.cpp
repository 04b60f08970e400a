// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/refiner.h"

#include "runtime/base/hash.h"
#include "tools/cli/progress.h"

namespace semrover {

namespace {

// says which frame an error is about
template <typename T>
Result<T> of_frame(const RefineChain& chain, uint32_t frame, Result<T> result)
{
    if (!result && result.error().code == ErrorCode::internal)
        result.error().message = fmt::format("{}: {}", frame_text(chain.camera.name, frame), result.error().message);
    return result;
}

} // namespace

uint32_t chain_key(const std::string& camera)
{
    if (camera.empty())
        return 0;
    Hash hash;
    hash.add(camera);
    return uint32_t(hash.value());
}

Refiner::Refiner(const RefineStore& store, std::span<const RefineChain> chains) : chains_(chains)
{
    for (const RefineChain& c : chains) {
        RendererWork w{c.size, false, false, false};
        for (uint32_t f = c.range.first; f <= c.range.last; ++f) {
            const bool latent = store.has(PieceKind::latent, c.camera, f);
            w.denoise |= !latent;
            w.encode |= !latent && !store.has(PieceKind::encoded, c.camera, f);
            w.decode |= !store.has(PieceKind::frame, c.camera, f);
            ++latents_;
        }
        work_.push_back(w);
    }
}

RendererWork Refiner::total() const
{
    RendererWork all{{}, false, false, false};
    for (const RendererWork& w : work_) {
        all.encode |= w.encode;
        all.denoise |= w.denoise;
        all.decode |= w.decode;
    }
    return all;
}

struct Refiner::Session {
    FrameRenderer& renderer;
    RefineStore& store;
    std::span<const RefineChain> chains;
    std::span<const RendererWork> work;
    RendererWork run_work;
    const Device& device;
    const Globals& globals;
    const RefineChain* trail_of = nullptr;
    std::optional<NoiseTrail> trail; // of that chain

    // noise of a frame, followed from the camera's first frame on, whichever frames are refined
    Result<std::span<const NoiseKey>> keys(const RefineChain& c, uint32_t frame)
    {
        if (c.cameras.empty())
            return std::span<const NoiseKey>{};
        if (trail_of != &c || trail->frames() > frame + 1) {
            trail.emplace(c.size);
            trail_of = &c;
        }
        while (trail->frames() <= frame) {
            SR_TRY(const ImageGray16 depth, read_depth(c.camera, trail->frames()));
            trail->follow(c.cameras[trail->frames()], depth);
        }
        return trail->keys();
    }
    Result<std::vector<float>> encode(const RefineChain& c, uint32_t frame, const BufferFrame& buffer)
    {
        if (store.has(PieceKind::encoded, c.camera, frame))
            return store.load_latent(PieceKind::encoded, c.camera, frame, c.size);
        return of_frame(c, frame, renderer.encode(floats_of_pixels(buffer.color)));
    }
    Status denoise(const RefineChain& c, uint32_t frame, const AsdRenderer::StepCallback& step)
    {
        SR_TRY(const BufferFrame buffer, read_buffer(c.camera, frame));
        SR_TRY(const std::vector<float> latent, encode(c, frame, buffer));
        const std::vector<float> visible = block_shares(c.size, buffer.visible);
        std::vector<float> previous = c.before;
        if (frame > c.range.first) {
            SR_TRY(previous, store.load_latent(PieceKind::latent, c.camera, frame - 1, c.size));
        }
        SR_TRY(const std::span<const NoiseKey> noise, keys(c, frame));
        const AsdFrame input{frame, chain_key(c.camera.name), latent, visible, previous, noise};
        SR_TRY(const std::vector<float> result, of_frame(c, frame, renderer.denoise(input, step)));
        return store.save_latent(PieceKind::latent, c.camera, frame, c.size, result);
    }
    Status decode(const RefineChain& c, uint32_t frame)
    {
        SR_TRY(const std::vector<float> latent, store.load_latent(PieceKind::latent, c.camera, frame, c.size));
        SR_TRY(const std::vector<float> image, of_frame(c, frame, renderer.decode(latent)));
        return store.save_frame(c.camera, frame, pixels_of_floats(image));
    }

    // `act` on every frame of every chain that `left` says is to do, chain by chain; a count of what is left
    template <typename Left>
    size_t count(Left&& left) const
    {
        size_t total = 0;
        for (const RefineChain& c : chains)
            for (uint32_t f = c.range.first; f <= c.range.last; ++f)
                total += left(c, f);
        return total;
    }
    template <typename Left, typename Act>
    Status each(Left&& left, Act&& act)
    {
        for (size_t i = 0; i < chains.size(); ++i)
            for (uint32_t f = chains[i].range.first; f <= chains[i].range.last; ++f) {
                if (!left(chains[i], f))
                    continue;
                if (interrupt_requested())
                    return fail(ErrorCode::interrupted, "interrupted");
                SR_CHECK(renderer.start(work[i], run_work));
                SR_CHECK(act(chains[i], f));
            }
        return {};
    }
    // one kind of work on all frames, under a line of progress that counts frames
    template <typename Left, typename Act>
    Status stage(const char* name, Left&& left, Act&& act)
    {
        const size_t total = count(left);
        if (total == 0)
            return {};
        Progress progress(progress_to_stderr(globals), name, "frames", total);
        size_t done = 0;
        SR_CHECK(each(left, [&](const RefineChain& c, uint32_t f) -> Status {
            SR_CHECK(act(c, f));
            progress.update(++done, device.allocated_bytes());
            return {};
        }));
        progress.finish();
        return {};
    }

    Status encode_all()
    {
        const auto left = [&](const RefineChain& c, uint32_t f) {
            return !store.has(PieceKind::latent, c.camera, f) && !store.has(PieceKind::encoded, c.camera, f);
        };
        return stage("encode", left, [&](const RefineChain& c, uint32_t f) -> Status {
            SR_TRY(const BufferFrame buffer, read_buffer(c.camera, f));
            SR_TRY(const std::vector<float> latent, encode(c, f, buffer));
            return store.save_latent(PieceKind::encoded, c.camera, f, c.size, latent);
        });
    }
    // latents, each with its frame where `decode_too`; progress counts denoising steps
    Status denoise_all(size_t steps, size_t latents, bool decode_too)
    {
        const auto no_latent = [&](const RefineChain& c, uint32_t f) {
            return !store.has(PieceKind::latent, c.camera, f);
        };
        size_t done = latents - count(no_latent);
        Progress progress(progress_to_stderr(globals), "refine", "steps", latents * steps, done * steps);
        const auto step = [&](size_t step_done, size_t) {
            progress.update(done * steps + step_done, device.allocated_bytes());
            return !interrupt_requested();
        };
        const auto left = [&](const RefineChain& c, uint32_t f) {
            return no_latent(c, f) || (decode_too && !store.has(PieceKind::frame, c.camera, f));
        };
        SR_CHECK(each(left, [&](const RefineChain& c, uint32_t f) -> Status {
            if (no_latent(c, f)) {
                SR_CHECK(denoise(c, f, step));
                ++done;
            }
            return decode_too && !store.has(PieceKind::frame, c.camera, f) ? decode(c, f) : Status{};
        }));
        progress.finish();
        return {};
    }
    Status decode_all()
    {
        const auto left = [&](const RefineChain& c, uint32_t f) { return !store.has(PieceKind::frame, c.camera, f); };
        return stage("decode", left, [&](const RefineChain& c, uint32_t f) { return decode(c, f); });
    }
};

Status Refiner::run(FrameRenderer& renderer, RefineStore& store, MemoryPolicy policy, size_t steps,
                    const Device& device, const Globals& globals)
{
    Session s{renderer, store, chains_, work_, total(), device, globals, nullptr, {}};
    if (policy == MemoryPolicy::resident)
        return s.denoise_all(steps, latents_, true);
    SR_CHECK(s.encode_all());
    SR_CHECK(s.denoise_all(steps, latents_, false));
    return s.decode_all();
}

} // namespace semrover
