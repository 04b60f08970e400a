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

// a part of the work on a frame
struct RefineTask {
    RefinePart part;
    const RefineChain* chain;
    uint32_t frame;
};

// true: the store does not have what the part gives
bool is_left(const RefineStore& store, RefinePart part, const RefineChain& chain, uint32_t frame);
// what is left of a chain
RendererWork work_left(const RefineStore& store, const RefineChain& chain);

struct RefineOrder {
    MemoryPolicy policy = MemoryPolicy::resident;
    size_t steps = 0; // of denoising a frame
    // frames are taken in the order of this path, while they are being drawn: with the resident policy only. None:
    // chain by chain, from the buffers' files
    const CameraPath* drawn = nullptr;
};

// What is left to do, in order, and how far it is: all of a frame before the next where both networks are there, else
// stage by stage. Stages are told to the callbacks.
class RefineSchedule {
  public:
    RefineSchedule(const RefineStore& store, std::span<const RefineChain> chains, const RefineOrder& order,
                   const JobCallbacks& callbacks, const Device& device);

    // none: nothing is left
    const RefineTask* task() const;
    bool follows_encode() const; // the task before was the encoding of the same frame
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
    void add_frames_stage(const RefineStore& store, std::string_view name, RefinePart part);
    std::vector<std::pair<const RefineChain*, uint32_t>> frames_in_order() const;
    void say(bool ended) const;

    std::span<const RefineChain> chains_;
    RefineOrder order_;
    JobCallbacks callbacks_;
    const Device& device_;
    std::vector<Stage> stages_;
    size_t stage_ = 0, task_ = 0;
    size_t counted_ = 0; // of the stage's unit
    bool told_ = false;  // of the stage
};

} // namespace semrover
