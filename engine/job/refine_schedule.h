// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/job.h"
#include "engine/job/refine_store.h"
#include "engine/refine/memory_plan.h"
#include "engine/refine/refine_chain.h"
#include "runtime/device/device.h"

namespace semrover {

enum class RefinePart { encode, denoise, decode };

// a part of the work on a frame, or on the frames of a window
struct RefineTask {
    RefinePart part;
    const RefineChain* chain;
    FrameWindow frames; // encode: one; decode: those that are decoded together
    FrameWindow window; // that they are denoised in

    uint32_t frame() const { return frames.next(); } // the first that the task makes
};

// true: the store does not have all that the part gives of these frames
bool is_left(const RefineStore& store, RefinePart part, const RefineChain& chain, const FrameWindow& frames);
// all of a chain
RendererWork whole_work(const RefineChain& chain);
// what is left of a chain
RendererWork work_left(const RefineStore& store, const RefineChain& chain);

struct RefineOrder {
    MemoryPolicy policy = MemoryPolicy::resident;
    size_t steps = 0; // of denoising a window
    // frames are taken in the order of this path, while they are being drawn: with the resident policy, and frame by
    // frame only. None: chain by chain, from the buffers' files
    const CameraPath* drawn = nullptr;
};

// What is left to do, in order, and how far it is: all of a window before the next where both networks are there, else
// stage by stage. Stages are told to the callbacks.
class RefineSchedule {
  public:
    RefineSchedule(const RefineStore& store, std::span<const RefineChain> chains, const RefineOrder& order,
                   const JobCallbacks& callbacks, const Device& device);

    // none: nothing is left
    const RefineTask* task() const;
    bool follows_encode() const; // the task before was the encoding of a frame of the same window
    void count(bool done);       // of the task: one submit more, and whether it was the last one
    bool at_end_of_stage() const { return stage_ < stages_.size() && task_ == stages_[stage_].tasks.size(); }
    void enter(); // tells of the stage that begins, if it was not told of yet
    void leave(); // tells of the stage that ends, whether all of it is done or not

  private:
    struct Stage {
        std::string_view name, unit;
        size_t total = 0, before = 0; // of the unit
        std::vector<RefineTask> tasks;
    };
    using Windows = std::vector<std::pair<const RefineChain*, FrameWindow>>;
    void add_stage(std::string_view name, std::vector<RefineTask> tasks);
    Windows windows_in_order() const;
    std::vector<RefineTask> encode_tasks(const RefineChain& chain, const FrameWindow& window);
    std::vector<RefineTask> decode_tasks(const RefineChain& chain, const FrameWindow& window) const;
    void say(bool ended) const;

    const RefineStore& store_;
    std::span<const RefineChain> chains_;
    RefineOrder order_;
    JobCallbacks callbacks_;
    const Device& device_;
    std::vector<Stage> stages_;
    std::map<const RefineChain*, uint32_t> encoded_; // frames before this one are encoded, or were not wanted
    size_t stage_ = 0, task_ = 0;
    size_t counted_ = 0; // of the stage's unit
    bool told_ = false;  // of the stage
};

} // namespace semrover
