// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/device/vulkan.h"
#include "runtime/graph/kernel.h"

#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace semrover {

class Device;

struct Pipeline {
    VkPipeline pipeline = VK_NULL_HANDLE;
    VkPipelineLayout layout = VK_NULL_HANDLE;
    VkDescriptorSetLayout set_layout = VK_NULL_HANDLE;
};

// Compute pipelines by (variant, constants), made on first use, over a VkPipelineCache kept on disk in
// $XDG_CACHE_HOME/semrover (safe to delete; a file of another driver is ignored). It is saved as pipelines are made: a
// run that is killed, or whose device is lost, leaves what it compiled to the next. The tiles that the device's
// programs chose (TileChoices) are kept with it.
class PipelineStore {
  public:
    // blob: of an earlier process, in place of the file; with an application's device there is no file either way
    static Result<std::unique_ptr<PipelineStore>> create(Device& device, std::span<const std::byte> blob = {});
    // over the cache of another store, which outlives it, for another thread
    static std::unique_ptr<PipelineStore> beside(Device& device, PipelineStore& first);
    ~PipelineStore();

    // empty: none is kept, or neither HOME nor XDG_CACHE_HOME is set
    const std::string& file() const { return cache_path_; }
    // what create() takes in another process: whole, or refused there
    Result<std::vector<char>> blob() const;

    // bytes of an earlier run's cache that this one started with; 0: none, or none that is whole and this driver's
    size_t reused_bytes() const { return reused_bytes_; }
    Result<const Pipeline*> get(const KernelVariant& variant, const std::map<uint32_t, uint32_t>& constants);

  private:
    explicit PipelineStore(Device& device) : device_(device) {}
    Status make(const KernelVariant& variant, const std::map<uint32_t, uint32_t>& constants, Pipeline& out);
    Status make_layout(const KernelVariant& variant, Pipeline& out);
    void destroy(const Pipeline& pipeline);
    void save();
    void save_by_and_by(double seconds);

    Device& device_;
    PipelineStore* first_ = nullptr; // whose cache it is, or null
    VkPipelineCache cache_ = VK_NULL_HANDLE;
    std::string cache_path_; // empty: nowhere to keep it
    size_t reused_bytes_ = 0;
    double unsaved_seconds_ = 0; // of compiling
    size_t saved_tiles_ = 0;     // how many were chosen then
    std::map<std::pair<const KernelVariant*, std::map<uint32_t, uint32_t>>, Pipeline> pipelines_;
};

} // namespace semrover
