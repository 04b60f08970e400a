// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/deferred/deferred_renderer.h"
#include "engine/job/job.h"
#include "engine/job/refine_store.h"

namespace semrover {

// what is left of a camera's frames
RendererWork work_left(const RefineStore& store, const RefinedCamera& camera);

struct RefineOrder {
    MemoryPolicy policy = MemoryPolicy::resident;
    size_t steps = 0; // of denoising a window
    // frames are taken in the order of this path, while they are being drawn: with the resident policy, and frame by
    // frame only. None: camera by camera, from the buffers' files
    const CameraPath* drawn = nullptr;
};

// What is left to do, in order, and how far it is: all of a window before the next where both networks are there, else
// stage by stage. Callbacks hear of stages.
class RefineSchedule {
  public:
    RefineSchedule(const RefineStore& store, std::span<const RefinedCamera> cameras, const RefineOrder& order,
                   const JobCallbacks& callbacks, const Device& device);

    // none: nothing is left
    const FrameTask* task() const;
    void count(bool done); // of the task: one submit more, and whether it was the last one
    bool at_end_of_stage() const { return stage_ < stages_.size() && task_ == stages_[stage_].tasks.size(); }
    void enter(); // reports the stage that begins, if it was not reported yet
    void leave(); // reports the stage that ends, whether all of it is done or not

  private:
    struct Stage {
        std::string_view name, unit;
        size_t total = 0, before = 0; // of the unit
        std::vector<FrameTask> tasks;
    };
    using Windows = std::vector<std::pair<const RefinedCamera*, FrameWindow>>;
    void add_stage(std::string_view name, std::vector<FrameTask> tasks);
    Windows windows_in_order(std::span<const RefinedCamera> cameras) const;
    std::vector<FrameTask> encode_tasks(const RefinedCamera& camera, const FrameWindow& window);
    std::vector<FrameTask> decode_tasks(const RefinedCamera& camera, const FrameWindow& window) const;
    void report(bool ended) const;

    const RefineStore& store_;
    RefineOrder order_;
    JobCallbacks callbacks_;
    const Device& device_;
    std::vector<Stage> stages_;
    std::map<const RefinedCamera*, uint32_t> encoded_; // frames before this one are encoded, or were not wanted
    size_t stage_ = 0, task_ = 0;
    size_t counted_ = 0;    // of the stage's unit
    bool reported_ = false; // the stage
};

} // namespace semrover
