// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/outgoing.h"
#include "engine/job/refine_schedule.h"
#include "engine/refine/noise_trail.h"

#include <map>

namespace semrover {

// Brings every frame of every chain to the end: what the store has is taken from there. How, is up to the kind of
// renderer: frame by frame (FrameRefiner), or window by window (WindowRefiner). The frames depend neither on the memory
// policy nor on where the work was stopped.
class Refiner {
  public:
    // all of it must outlive the refiner; nothing is on its way through `out`
    struct Parts {
        Device& device;
        RefineStore& store;
        Outgoing& out;
        std::span<const RefineChain> chains;
    };
    virtual ~Refiner() = default;
    Refiner(const Refiner&) = delete;
    Refiner& operator=(const Refiner&) = delete;

    // Where frames are refined while they are drawn: the buffer of the next frame of a camera, from the first on. Its
    // pixels (SplatPixelSlots::seen) stay until the next one's; its depth may come later, in order, too.
    virtual void give_buffer(const std::string& camera, const Slot& seen) = 0;
    void give_depth(const std::string& camera, const ImageGray16& depth);
    virtual bool waits() const { return false; } // step() wants a buffer that was not given yet

    // one submit: a step of denoising, or pictures through the VAE; true: all is done.
    // Errors: internal for NaN, with frame and stage
    Result<bool> step();
    Status cancel(); // waits for what was submitted
    void close();    // tells that the stage ends, unfinished

  protected:
    Refiner(const Parts& parts, const RefineOrder& order, const JobCallbacks& callbacks);

    // the networks that a chain's work wants, as far as all chains' work wants them
    virtual Status start(const RendererWork& work, const RendererWork& total) = 0;
    virtual Status encode(const RefineTask& task) = 0;
    virtual Status begin_window(const RefineTask& task) = 0;
    virtual Result<bool> step_window() = 0; // true: it is denoised
    virtual Status end_window(const RefineTask& task) = 0;
    virtual Status cancel_window() = 0;
    virtual Status decode(const RefineTask& task) = 0;

    const RefineChain* chain_of(const std::string& camera) const;
    bool staged() const { return order_.policy == MemoryPolicy::staged; }
    // as it was drawn, or from the buffers' files; frames in order
    Result<ImageGray16> depth_of(const RefineChain& chain, uint32_t frame);
    // noise of a frame; empty: each frame has its own
    Result<std::span<const NoiseKey>> keys(const RefineChain& chain, uint32_t frame);
    Status save_latent(PieceKind kind, const RefineChain& chain, uint32_t frame, std::vector<float> latent);
    Status save_frame(const RefineChain& chain, uint32_t frame, std::span<const std::byte> pixels);

    Parts p_;
    RefineOrder order_;
    RefineSchedule schedule_;

  private:
    Result<bool> settle();                    // at the next task; true: none is left
    Result<bool> act(const RefineTask& task); // true: the task is done
    Result<bool> denoise(const RefineTask& task);

    std::map<const RefineChain*, RendererWork> work_;
    RendererWork total_{{}, false, false, false}; // of all chains, size apart
    bool begun_ = false;                          // the window of the task is being denoised
    bool wants_depth(const RefineChain& chain, uint32_t frame) const;
    std::map<const RefineChain*, NoiseTrail> noise_;
    struct Depths {
        uint32_t given = 0;                     // of those that are drawn, so far
        std::map<uint32_t, ImageGray16> frames; // that are still wanted, or the last one that was read
    };
    std::map<const RefineChain*, Depths> depths_;
};

// a buffer's files as splat_pixels() would make them
std::vector<uint32_t> seen_words(const BufferFrame& buffer);

} // namespace semrover
