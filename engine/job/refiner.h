// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/outgoing.h"
#include "engine/job/refine_schedule.h"
#include "engine/refine/frame_renderer.h"

#include <map>

namespace semrover {

// Brings every frame of every chain to the end: what the store has is taken from there. With the resident policy pixels
// and latents stay on the device, and files only leave it; with the staged one a stage reads what the one before wrote.
// The frames depend neither on that nor on where the work was stopped.
class Refiner {
  public:
    // all of it must outlive the refiner; nothing is on its way through `out`
    struct Parts {
        Device& device;
        FrameRenderer& renderer;
        RefineStore& store;
        Outgoing& out;
        std::span<const RefineChain> chains;
    };
    Refiner(const Parts& parts, const RefineOrder& order, const JobCallbacks& callbacks);

    // Where frames are refined while they are drawn: the buffer of the next frame of a camera, from the first on. Its
    // pixels (SplatPixelSlots::seen) stay until the next one's; its depth may come later, in order, too.
    void give_buffer(const std::string& camera, const Slot& seen);
    void give_depth(const std::string& camera, const ImageGray16& depth);
    bool waits() const; // step() wants a buffer that was not given yet

    // one submit: a step of denoising, or a picture through the VAE; true: all is done.
    // Errors: internal for NaN, with frame and stage
    Result<bool> step();
    Status cancel(); // waits for what was submitted
    void close();    // tells that the stage ends, unfinished

  private:
    // of a chain, while it is at work
    struct Trail {
        Slot seen;                 // of the last buffer that was given
        uint32_t given = 0;        // buffers so far
        uint32_t frame = 0;        // of `latent`
        std::vector<float> latent; // empty: none yet
        std::optional<NoiseTrail> noise;
    };
    const RefineChain* chain_of(const std::string& camera) const;
    bool staged() const { return order_.policy == MemoryPolicy::staged; }
    Result<bool> settle();                    // at the next task; true: none is left
    Result<bool> act(const RefineTask& task); // true: the task is done
    Status encode(const RefineTask& task);
    Result<bool> denoise(const RefineTask& task);
    Status begin_frame(const RefineTask& task);
    Status begin_staged(const RefineTask& task, std::span<const NoiseKey> noise);
    Status begin_resident(const RefineTask& task, std::span<const NoiseKey> noise);
    Status end_frame(const RefineTask& task);
    Status decode(const RefineTask& task);
    Result<std::span<const NoiseKey>> keys(const RefineChain& chain, uint32_t frame);
    Result<std::vector<float>> latent(const RefineChain& chain, uint32_t frame);
    Result<std::vector<float>> latent_before(const RefineTask& task); // empty: it is a first frame
    Status save(PieceKind kind, const RefineTask& task, std::vector<float> latent);
    Status save_frame(const RefineTask& task, std::vector<uint8_t> pixels);

    Parts p_;
    RefineOrder order_;
    std::map<const RefineChain*, RendererWork> work_;
    RendererWork total_{{}, false, false, false}; // of all chains, size apart
    RefineSchedule schedule_;
    bool begun_ = false;                     // the frame of the task is being denoised
    const RefineChain* on_device_ = nullptr; // whose latent lies in the denoiser's slot
    uint32_t frame_on_device_ = 0;
    std::map<const RefineChain*, Trail> trails_;
};

} // namespace semrover
