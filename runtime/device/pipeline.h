// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/device/profile.h"
#include "runtime/device/vulkan.h"
#include "runtime/graph/pass.h"

#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace semrover {

class Device;

// what the pipelines of a variant share
struct Shader {
    VkShaderModule module = VK_NULL_HANDLE;
    VkPipelineLayout layout = VK_NULL_HANDLE;
    VkDescriptorSetLayout set_layout = VK_NULL_HANDLE;
};

struct Pipeline {
    VkPipeline pipeline = VK_NULL_HANDLE;
    VkPipelineLayout layout = VK_NULL_HANDLE; // its shader's
    VkDescriptorSetLayout set_layout = VK_NULL_HANDLE;
    std::shared_ptr<const std::vector<Statistic>> statistics; // null where the device does not capture them
};

// Compute pipelines by (variant, constants), made when an executable needs them, over a VkPipelineCache kept on disk in
// $XDG_CACHE_HOME/semrover (safe to delete; a file of another driver is ignored). It is saved as pipelines are made: a
// run that is killed, or whose device is lost, leaves what it compiled to the next. The alternatives that the device's
// executables chose (TuningCache) are kept with it.
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
    // one a pass; those that are missing are compiled on several threads
    Result<std::vector<const Pipeline*>> get(std::span<const Pass> passes);

  private:
    explicit PipelineStore(Device& device) : device_(device) {}
    using Key = std::pair<const KernelVariant*, std::map<uint32_t, uint32_t>>;
    struct Missing {
        const Pass* pass;
        const Shader* shader;
        Pipeline* made; // where the store keeps it
        Status status = {};
    };
    Status compile(std::span<Missing> missing);
    Status make(Missing& missing) const;
    Result<const Shader*> shader(const KernelVariant& variant);
    Status make_shader(const KernelVariant& variant, Shader& out);
    void destroy(const Shader& shader);
    void save();
    void save_by_and_by(double seconds);

    Device& device_;
    PipelineStore* first_ = nullptr; // whose cache it is, or null
    VkPipelineCache cache_ = VK_NULL_HANDLE;
    std::string cache_path_; // empty: nowhere to keep it
    size_t reused_bytes_ = 0;
    bool saved_ = false;         // in this process
    double unsaved_seconds_ = 0; // of compiling
    size_t saved_tuning_ = 0;    // how many were chosen then
    std::map<const KernelVariant*, Shader> shaders_;
    std::map<Key, Pipeline> pipelines_;
};

} // namespace semrover
