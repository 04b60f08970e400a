// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/job.h"
#include "engine/job/refine_store.h"
#include "engine/refine/frame_renderer.h"
#include "engine/refine/refine_chain.h"

namespace semrover {

// Brings every frame of every chain to the end: what the store has is taken from there. The order of the work is the
// memory policy's; the frames do not depend on it, nor on where it was stopped.
class Refiner {
  public:
    // store and chains must outlive it
    Refiner(RefineStore& store, std::span<const RefineChain> chains);
    ~Refiner();

    // what is left to do, one per chain
    std::span<const RendererWork> work() const { return work_; }

    // `steps` of denoising a frame; stages "encode", "refine" and "decode" are told to `progress`
    void begin(FrameRenderer& renderer, MemoryPolicy policy, size_t steps, const JobCallbacks& callbacks,
               const Device& device);
    // one submit: a step of denoising, or a picture through the VAE; true: all is done.
    // Errors: internal for NaN, with frame and stage
    Result<bool> step();
    Status cancel(); // waits for what was submitted

  private:
    enum class Part { encode, denoise, decode };
    struct Task {
        Part part;
        const RefineChain* chain;
        uint32_t frame;
    };
    struct Stage;

    void plan(MemoryPolicy policy);
    void add_frames_stage(std::string_view name, Part part);
    bool left(Part part, const RefineChain& chain, uint32_t frame) const;
    RendererWork total() const; // size apart

    bool settle(); // tells of stages that end and begin; true: no task is left
    void say(bool ended) const;
    Result<bool> act(const Task& task); // true: the task is done
    Status encode(const Task& task);
    Result<bool> denoise(const Task& task);
    Status begin_frame(const Task& task);
    Status decode(const Task& task);
    Result<std::span<const NoiseKey>> keys(const RefineChain& chain, uint32_t frame);

    RefineStore& store_;
    std::span<const RefineChain> chains_;
    std::vector<RendererWork> work_;
    FrameRenderer* renderer_ = nullptr;
    const Device* device_ = nullptr;
    JobCallbacks callbacks_;
    size_t steps_ = 0;

    std::vector<Stage> stages_;
    size_t stage_ = 0, task_ = 0;
    size_t counted_ = 0;         // of the stage's unit
    bool announced_ = false;     // the stage is known to `progress`
    bool begun_ = false;         // the frame of the task is being denoised
    bool keep_encoded_ = false;  // in the store; else in encoded_, for the task after
    std::vector<float> encoded_; // latent of the next frame's buffer
    const RefineChain* trail_of_ = nullptr;
    std::optional<NoiseTrail> trail_; // of that chain
};

} // namespace semrover
