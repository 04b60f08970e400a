// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/device/device.h"
#include "runtime/graph/autotuner.h"
#include "runtime/graph/plan.h"

#include <memory>
#include <vector>

namespace semrover {

// A compiled graph on a device: arena, pipelines, descriptor sets and recorded command buffers; run any number of
// times, each run one submit, or several short ones where the device has a watchdog. The first run is measured then,
// and the second waits for it once and cuts submits by what passes really took. One with alternatives to try
// measures some more (Autotuner).
class Executable {
  public:
    static Result<std::unique_ptr<Executable>> create(Device& device, const Graph& graph);
    static Result<std::unique_ptr<Executable>> create(Device& device, Plan plan);
    ~Executable();
    Executable(const Executable&) = delete;
    Executable& operator=(const Executable&) = delete;

    Status run();              // submits and waits
    Result<uint64_t> submit(); // ticket for Device::wait
    // into a command buffer that is being recorded, which stays good as long as the executable: executions must not
    // overlap
    void record_into(VkCommandBuffer commands) const;
    Status collect_profile(); // after a wait, when the device has a profile

    const Plan& plan() const { return plan_; }
    double host_us() const { return runs_ ? host_us_ / double(runs_) : 0; } // host time of one submit, mean

  private:
    Executable(Device& device, Plan plan) : device_(device), plan_(std::move(plan)) {}
    Status choose_alternatives();
    Status allocate();
    Status get_pipelines();
    Status make_sets();
    Status bind(const Pass& pass, VkDescriptorSet set);
    Status make_queries();
    Status record();
    Status record_again();
    Status record_submit(uint32_t index);
    void record_passes(VkCommandBuffer commands, uint32_t submit, bool timed) const;
    std::string label_of(const Pass& pass) const;
    void record_dispatch(VkCommandBuffer commands, size_t index, bool timed) const;
    Result<std::vector<uint64_t>> stamps() const; // two a dispatch, in units of the device
    Status schedule_again();
    static const PassBinding& stand_in(const Pass& pass, size_t binding);
    std::pair<VkBuffer, uint64_t> locate(const PassBinding& binding) const;

    Device& device_;
    Plan plan_;
    std::vector<std::unique_ptr<Buffer>> blocks_;
    VkDescriptorPool descriptors_ = VK_NULL_HANDLE;
    VkCommandPool commands_pool_ = VK_NULL_HANDLE;
    VkQueryPool queries_ = VK_NULL_HANDLE;
    std::vector<const struct Pipeline*> pipelines_; // one per pass
    std::vector<VkDescriptorSet> sets_;             // one per pass
    std::vector<VkBufferView> views_;
    std::vector<VkCommandBuffer> commands_; // one per submit
    bool recorded_ = false;                 // the commands are those of the plan as it is
    bool measuring_ = false;                // the first run, or one of the autotuner: its passes are timed
    Autotuner autotuner_;
    double host_us_ = 0;
    uint64_t runs_ = 0;
};

} // namespace semrover
