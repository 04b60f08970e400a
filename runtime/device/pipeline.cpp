// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/device/pipeline.h"

#include "runtime/base/file.h"
#include "runtime/base/hash.h"
#include "runtime/device/debug_names.h"
#include "runtime/device/device.h"
#include "runtime/device/pipeline_statistics.h"
#include "runtime/system/system.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <set>
#include <system_error>
#include <thread>
#include <vector>

namespace fs = std::filesystem;

namespace semrover {

namespace {

constexpr uint64_t kMaxCacheBytes = 1ull << 31;
constexpr double kSaveAfterSeconds = 2; // of compiling: writing the file takes some milliseconds

std::string cache_path(Device& device)
{
    const fs::path root = system::user_cache_folder();
    if (root.empty())
        return "";
    VkPhysicalDeviceProperties p;
    device.vk().GetPhysicalDeviceProperties(device.physical(), &p);
    std::string name = fmt::format("pipelines-{:x}-{:x}-{:x}-", p.vendorID, p.deviceID, p.driverVersion);
    for (uint8_t byte : p.pipelineCacheUUID)
        name += fmt::format("{:02x}", byte);
    return (root / "semrover" / (name + ".bin")).string();
}

using Checksum = std::array<char, 8>;

Checksum checksum(std::string_view bytes)
{
    Hash hash;
    hash.add(std::as_bytes(std::span(bytes)));
    return std::bit_cast<Checksum>(hash.value());
}

// A file, or an application's blob: a checksum, and under it the bytes of the tuning's text, that text, and the
// driver's data.
struct Kept {
    std::string_view tuning, data; // empty: none, or none that can be used
};

bool is_ours(std::string_view data, Device& device)
{
    VkPhysicalDeviceProperties p;
    device.vk().GetPhysicalDeviceProperties(device.physical(), &p);
    VkPipelineCacheHeaderVersionOne header;
    if (data.size() < sizeof header)
        return false;
    std::memcpy(&header, data.data(), sizeof header);
    return header.vendorID == p.vendorID && header.deviceID == p.deviceID &&
           !std::memcmp(header.pipelineCacheUUID, p.pipelineCacheUUID, VK_UUID_SIZE);
}

// drivers trust what follows the header: a truncated, damaged or foreign blob must not reach them
Kept parse(std::string_view blob, Device& device)
{
    Checksum sum;
    uint64_t tuning_bytes = 0;
    if (blob.size() < sizeof sum + sizeof tuning_bytes)
        return {};
    std::memcpy(sum.data(), blob.data(), sizeof sum);
    blob.remove_prefix(sizeof sum);
    if (checksum(blob) != sum)
        return {};
    std::memcpy(&tuning_bytes, blob.data(), sizeof tuning_bytes);
    blob.remove_prefix(sizeof tuning_bytes);
    if (tuning_bytes > blob.size())
        return {};
    const Kept kept{blob.substr(0, tuning_bytes), blob.substr(tuning_bytes)};
    return is_ours(kept.data, device) ? kept : Kept{};
}

} // namespace

Result<std::unique_ptr<PipelineStore>> PipelineStore::create(Device& device, std::span<const std::byte> blob)
{
    std::unique_ptr<PipelineStore> store(new PipelineStore(device));
    if (device.owned() && blob.empty())
        store->cache_path_ = cache_path(device);
    std::string file;
    if (!store->cache_path_.empty())
        file = read_text_file(store->cache_path_, kMaxCacheBytes).value_or(""); // what is no file is no cache
    const std::string_view given(reinterpret_cast<const char*>(blob.data()), blob.size());
    const Kept kept = parse(store->cache_path_.empty() ? given : file, device);
    device.tuning().read(kept.tuning);
    store->saved_tuning_ = device.tuning().size();
    auto info = vk_struct<VkPipelineCacheCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_CACHE_CREATE_INFO);
    info.initialDataSize = kept.data.size();
    info.pInitialData = kept.data.data();
    store->reused_bytes_ = kept.data.size();
    SR_VK_MAKE(store->cache_,
               device.vk().CreatePipelineCache(device.handle(), &info, device.vk().allocator(), &store->cache_));
    return store;
}

std::unique_ptr<PipelineStore> PipelineStore::beside(Device& device, PipelineStore& first)
{
    std::unique_ptr<PipelineStore> store(new PipelineStore(device));
    store->first_ = &first;
    store->cache_ = first.cache_;
    return store;
}

PipelineStore::~PipelineStore()
{
    for (const auto& [key, p] : pipelines_)
        device_.vk().DestroyPipeline(device_.handle(), p.pipeline, device_.vk().allocator());
    for (const auto& [variant, s] : shaders_)
        destroy(s);
    if (first_) {
        first_->unsaved_seconds_ += unsaved_seconds_;
        return;
    }
    if (unsaved_seconds_ > 0 || device_.tuning().size() != saved_tuning_)
        save();
    if (cache_)
        device_.vk().DestroyPipelineCache(device_.handle(), cache_, device_.vk().allocator());
}

Result<std::vector<char>> PipelineStore::blob() const
{
    size_t bytes = 0;
    SR_VK(device_.vk().GetPipelineCacheData(device_.handle(), cache_, &bytes, nullptr));
    const std::string tuning = device_.tuning().text();
    const uint64_t tuning_bytes = tuning.size();
    std::string kept(reinterpret_cast<const char*>(&tuning_bytes), sizeof tuning_bytes);
    kept += tuning;
    const size_t before = kept.size();
    kept.resize(before + bytes);
    SR_VK(device_.vk().GetPipelineCacheData(device_.handle(), cache_, &bytes, kept.data() + before));
    kept.resize(before + bytes);
    const Checksum sum = checksum(kept);
    std::vector<char> blob(sum.begin(), sum.end());
    blob.insert(blob.end(), kept.begin(), kept.end());
    return blob;
}

// best effort: a cache that cannot be written costs time at the next start, nothing else
void PipelineStore::save()
{
    if (cache_path_.empty())
        return;
    (void)unless_memory_is_short([this]() -> Status {
        SR_TRY(const std::vector<char> bytes, blob());
        SR_CHECK(make_folder(fs::path(cache_path_).parent_path()));
        return write_file_atomically(cache_path_, std::as_bytes(std::span(bytes)));
    });
    saved_tuning_ = device_.tuning().size();
    saved_ = true;
}

Result<std::vector<const Pipeline*>> PipelineStore::get(std::span<const Pass> passes)
{
    std::vector<Missing> missing;
    std::set<Key> asked;
    for (const Pass& pass : passes) {
        const Key key{pass.variant, pass.constants};
        Pipeline& kept = pipelines_[key]; // which has a place before it is made
        if (kept.pipeline || !asked.insert(key).second)
            continue;
        SR_TRY(const Shader* of_variant, shader(*pass.variant));
        missing.push_back({&pass, of_variant, &kept});
    }
    SR_CHECK(compile(missing));
    std::vector<const Pipeline*> found;
    for (const Pass& pass : passes)
        found.push_back(&pipelines_.at({pass.variant, pass.constants}));
    return found;
}

// What was made before a failure stays. An application's allocator is called from its own thread only.
Status PipelineStore::compile(std::span<Missing> missing)
{
    std::atomic<size_t> next = 0;
    const auto make_next = [&] {
        const size_t i = next++;
        if (i >= missing.size())
            return false;
        missing[i].status = unless_memory_is_short([&] { return make(missing[i]); });
        return true;
    };
    const size_t most = device_.vk().allocator() ? 1 : std::max(std::thread::hardware_concurrency(), 1u);
    std::vector<std::jthread> others;
    try {
        while (others.size() + 1 < std::min(most, missing.size()))
            others.emplace_back([&] {
                while (make_next()) {
                }
            });
    } catch (const std::system_error&) { // no more threads: those that are there do it
    } catch (const std::bad_alloc&) {
    }
    auto begin = std::chrono::steady_clock::now();
    const auto save = [&] {
        const auto now = std::chrono::steady_clock::now();
        save_by_and_by(std::chrono::duration<double>(now - begin).count());
        begin = now;
    };
    Status status = device_.check_cancelled();
    for (; status && make_next(); status = device_.check_cancelled())
        save();
    next = missing.size();
    others.clear();
    if (!missing.empty()) // what the other threads made last, or all of it
        save();
    for (Missing& m : missing)
        if (status && !m.made->pipeline)
            status = std::move(m.status);
    return status;
}

void PipelineStore::save_by_and_by(double seconds)
{
    unsaved_seconds_ += seconds;
    if (first_) // which is another thread's
        return;
    if ((saved_ || reused_bytes_) && unsaved_seconds_ < kSaveAfterSeconds)
        return;
    save();
    unsaved_seconds_ = 0;
}

Result<const Shader*> PipelineStore::shader(const KernelVariant& variant)
{
    if (const auto at = shaders_.find(&variant); at != shaders_.end())
        return &at->second;
    Shader& made = shaders_[&variant]; // which has a place before it is made
    Status status = unless_memory_is_short([&] { return make_shader(variant, made); });
    if (status)
        return &made;
    destroy(made);
    shaders_.erase(&variant);
    return tl::make_unexpected(std::move(status).error());
}

void PipelineStore::destroy(const Shader& s)
{
    device_.vk().DestroyShaderModule(device_.handle(), s.module, device_.vk().allocator());
    device_.vk().DestroyPipelineLayout(device_.handle(), s.layout, device_.vk().allocator());
    device_.vk().DestroyDescriptorSetLayout(device_.handle(), s.set_layout, device_.vk().allocator());
}

Status PipelineStore::make_shader(const KernelVariant& variant, Shader& out)
{
    std::vector<VkDescriptorSetLayoutBinding> bindings;
    for (const BindingInfo& b : variant.bindings)
        bindings.push_back(
            {b.binding,
             b.kind == BindingKind::texel ? VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER : VK_DESCRIPTOR_TYPE_STORAGE_BUFFER,
             1, VK_SHADER_STAGE_COMPUTE_BIT, nullptr});
    auto set = vk_struct<VkDescriptorSetLayoutCreateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO);
    set.bindingCount = uint32_t(bindings.size());
    set.pBindings = bindings.data();
    SR_VK_MAKE(out.set_layout, device_.vk().CreateDescriptorSetLayout(device_.handle(), &set, device_.vk().allocator(),
                                                                      &out.set_layout));
    const VkPushConstantRange range{VK_SHADER_STAGE_COMPUTE_BIT, 0, variant.push_bytes};
    auto layout = vk_struct<VkPipelineLayoutCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO);
    layout.setLayoutCount = 1;
    layout.pSetLayouts = &out.set_layout;
    layout.pushConstantRangeCount = variant.push_bytes ? 1 : 0;
    layout.pPushConstantRanges = &range;
    SR_VK_MAKE(out.layout,
               device_.vk().CreatePipelineLayout(device_.handle(), &layout, device_.vk().allocator(), &out.layout));
    auto code = vk_struct<VkShaderModuleCreateInfo>(VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO);
    code.codeSize = variant.code.size_bytes();
    code.pCode = variant.code.data();
    SR_VK_MAKE(out.module,
               device_.vk().CreateShaderModule(device_.handle(), &code, device_.vk().allocator(), &out.module));
    return {};
}

Status PipelineStore::make(Missing& m) const
{
    const KernelVariant& variant = *m.pass->variant;
    std::vector<VkSpecializationMapEntry> entries;
    std::vector<uint32_t> values;
    for (const auto& [id, value] : m.pass->constants) {
        entries.push_back({id, uint32_t(values.size() * 4), 4});
        values.push_back(value);
    }
    auto subgroup = vk_struct<VkPipelineShaderStageRequiredSubgroupSizeCreateInfo>(
        VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_REQUIRED_SUBGROUP_SIZE_CREATE_INFO);
    subgroup.requiredSubgroupSize = device_.limits().matrix.subgroup;
    const bool matrices = variant.features & kFeatureCooperativeMatrix;
    const VkSpecializationInfo specialization{uint32_t(entries.size()), entries.data(), values.size() * 4,
                                              values.data()};
    auto info = vk_struct<VkComputePipelineCreateInfo>(VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO);
    info.stage = {
        VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO,
        matrices ? &subgroup : nullptr,
        matrices ? VkPipelineShaderStageCreateFlags(VK_PIPELINE_SHADER_STAGE_CREATE_REQUIRE_FULL_SUBGROUPS_BIT) : 0,
        VK_SHADER_STAGE_COMPUTE_BIT,
        m.shader->module,
        "main",
        &specialization};
    info.layout = m.shader->layout;
    info.flags = VK_PIPELINE_CREATE_DISPATCH_BASE_BIT; // long passes are cut
    if (device_.pipeline_statistics())
        info.flags |= VK_PIPELINE_CREATE_CAPTURE_STATISTICS_BIT_KHR;
    auto robust = vk_struct<VkPipelineRobustnessCreateInfoEXT>(VK_STRUCTURE_TYPE_PIPELINE_ROBUSTNESS_CREATE_INFO_EXT);
    robust.storageBuffers = robust.uniformBuffers = VK_PIPELINE_ROBUSTNESS_BUFFER_BEHAVIOR_ROBUST_BUFFER_ACCESS_EXT;
    if (device_.pipeline_robustness())
        info.pNext = &robust;
    *m.made = {VK_NULL_HANDLE, m.shader->layout, m.shader->set_layout, nullptr};
    const VkResult result = device_.vk().CreateComputePipelines(device_.handle(), cache_, 1, &info,
                                                                device_.vk().allocator(), &m.made->pipeline);
    if (result != VK_SUCCESS) {
        m.made->pipeline = VK_NULL_HANDLE;
        const Error error = vk_error(result, "vkCreateComputePipelines");
        return fail(error.code, "{}: {}", m.pass->name(), error.message);
    }
    name_object(device_.vk(), device_.handle(), VK_OBJECT_TYPE_PIPELINE, reinterpret_cast<uint64_t>(m.made->pipeline),
                m.pass->name());
    if (device_.pipeline_statistics()) {
        SR_TRY(auto statistics, statistics_of(device_.vk(), device_.handle(), m.made->pipeline));
        m.made->statistics = std::make_shared<const std::vector<Statistic>>(std::move(statistics));
    }
    return {};
}

} // namespace semrover
