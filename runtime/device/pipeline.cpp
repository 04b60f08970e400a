// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/device/pipeline.h"

#include "runtime/base/file.h"
#include "runtime/base/hash.h"
#include "runtime/device/device.h"
#include "runtime/system/system.h"

#include <algorithm>
#include <array>
#include <bit>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <filesystem>
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

// A file, or an application's blob: a checksum, and under it the bytes of the tiles' text, that text, and the driver's
// data.
struct Kept {
    std::string_view tiles, data; // empty: none, or none that can be used
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
    uint64_t tile_bytes = 0;
    if (blob.size() < sizeof sum + sizeof tile_bytes)
        return {};
    std::memcpy(sum.data(), blob.data(), sizeof sum);
    blob.remove_prefix(sizeof sum);
    if (checksum(blob) != sum)
        return {};
    std::memcpy(&tile_bytes, blob.data(), sizeof tile_bytes);
    blob.remove_prefix(sizeof tile_bytes);
    if (tile_bytes > blob.size())
        return {};
    const Kept kept{blob.substr(0, tile_bytes), blob.substr(tile_bytes)};
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
    device.tiles().read(kept.tiles);
    store->saved_tiles_ = device.tiles().size();
    auto info = vk_struct<VkPipelineCacheCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_CACHE_CREATE_INFO);
    info.initialDataSize = kept.data.size();
    info.pInitialData = kept.data.data();
    store->reused_bytes_ = kept.data.size();
    SR_VK(device.vk().CreatePipelineCache(device.handle(), &info, device.vk().allocator(), &store->cache_));
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
    for (auto& [key, p] : pipelines_)
        destroy(p);
    if (first_) {
        first_->unsaved_seconds_ += unsaved_seconds_;
        return;
    }
    if (unsaved_seconds_ > 0 || device_.tiles().size() != saved_tiles_)
        save();
    if (cache_)
        device_.vk().DestroyPipelineCache(device_.handle(), cache_, device_.vk().allocator());
}

Result<std::vector<char>> PipelineStore::blob() const
{
    size_t bytes = 0;
    SR_VK(device_.vk().GetPipelineCacheData(device_.handle(), cache_, &bytes, nullptr));
    const std::string tiles = device_.tiles().text();
    const uint64_t tile_bytes = tiles.size();
    std::string kept(reinterpret_cast<const char*>(&tile_bytes), sizeof tile_bytes);
    kept += tiles;
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
    const auto bytes = blob();
    if (bytes && make_folder(fs::path(cache_path_).parent_path()))
        (void)write_file_atomically(cache_path_, std::as_bytes(std::span(*bytes)));
    saved_tiles_ = device_.tiles().size();
}

Result<const Pipeline*> PipelineStore::get(const KernelVariant& variant, const std::map<uint32_t, uint32_t>& constants)
{
    const auto key = std::make_pair(&variant, constants);
    if (const auto it = pipelines_.find(key); it != pipelines_.end())
        return &it->second;
    SR_CHECK(device_.check_cancelled());
    Pipeline p;
    const auto begin = std::chrono::steady_clock::now();
    if (Status made = make(variant, constants, p); !made) {
        destroy(p);
        return tl::make_unexpected(std::move(made).error());
    }
    save_by_and_by(std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
    return &(pipelines_[key] = p);
}

void PipelineStore::save_by_and_by(double seconds)
{
    unsaved_seconds_ += seconds;
    if (first_) // which is another thread's
        return;
    const bool first = pipelines_.empty() && reused_bytes_ == 0;
    if (!first && unsaved_seconds_ < kSaveAfterSeconds)
        return;
    save();
    unsaved_seconds_ = 0;
}

void PipelineStore::destroy(const Pipeline& p)
{
    device_.vk().DestroyPipeline(device_.handle(), p.pipeline, device_.vk().allocator());
    device_.vk().DestroyPipelineLayout(device_.handle(), p.layout, device_.vk().allocator());
    device_.vk().DestroyDescriptorSetLayout(device_.handle(), p.set_layout, device_.vk().allocator());
}

Status PipelineStore::make_layout(const KernelVariant& variant, Pipeline& out)
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
    SR_VK(device_.vk().CreateDescriptorSetLayout(device_.handle(), &set, device_.vk().allocator(), &out.set_layout));
    const VkPushConstantRange range{VK_SHADER_STAGE_COMPUTE_BIT, 0, variant.push_bytes};
    auto layout = vk_struct<VkPipelineLayoutCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO);
    layout.setLayoutCount = 1;
    layout.pSetLayouts = &out.set_layout;
    layout.pushConstantRangeCount = variant.push_bytes ? 1 : 0;
    layout.pPushConstantRanges = &range;
    SR_VK(device_.vk().CreatePipelineLayout(device_.handle(), &layout, device_.vk().allocator(), &out.layout));
    return {};
}

Status PipelineStore::make(const KernelVariant& variant, const std::map<uint32_t, uint32_t>& constants, Pipeline& out)
{
    SR_CHECK(make_layout(variant, out));
    auto code = vk_struct<VkShaderModuleCreateInfo>(VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO);
    code.codeSize = variant.code.size_bytes();
    code.pCode = variant.code.data();
    VkShaderModule module;
    SR_VK(device_.vk().CreateShaderModule(device_.handle(), &code, device_.vk().allocator(), &module));
    std::vector<VkSpecializationMapEntry> entries;
    std::vector<uint32_t> values;
    for (const auto& [id, value] : constants) {
        entries.push_back({id, uint32_t(values.size() * 4), 4});
        values.push_back(value);
    }
    auto subgroup = vk_struct<VkPipelineShaderStageRequiredSubgroupSizeCreateInfo>(
        VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_REQUIRED_SUBGROUP_SIZE_CREATE_INFO);
    subgroup.requiredSubgroupSize = device_.limits().matrix.subgroup;
    const bool matrices = variant.needs & kNeedsCooperativeMatrix;
    const VkSpecializationInfo specialization{uint32_t(entries.size()), entries.data(), values.size() * 4,
                                              values.data()};
    auto info = vk_struct<VkComputePipelineCreateInfo>(VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO);
    info.stage = {
        VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO,
        matrices ? &subgroup : nullptr,
        matrices ? VkPipelineShaderStageCreateFlags(VK_PIPELINE_SHADER_STAGE_CREATE_REQUIRE_FULL_SUBGROUPS_BIT) : 0,
        VK_SHADER_STAGE_COMPUTE_BIT,
        module,
        "main",
        &specialization};
    info.layout = out.layout;
    info.flags = VK_PIPELINE_CREATE_DISPATCH_BASE_BIT; // long passes are cut
    auto robust = vk_struct<VkPipelineRobustnessCreateInfoEXT>(VK_STRUCTURE_TYPE_PIPELINE_ROBUSTNESS_CREATE_INFO_EXT);
    robust.storageBuffers = robust.uniformBuffers = VK_PIPELINE_ROBUSTNESS_BUFFER_BEHAVIOR_ROBUST_BUFFER_ACCESS_EXT;
    if (device_.pipeline_robustness())
        info.pNext = &robust;
    const VkResult result = device_.vk().CreateComputePipelines(device_.handle(), cache_, 1, &info,
                                                                device_.vk().allocator(), &out.pipeline);
    device_.vk().DestroyShaderModule(device_.handle(), module, device_.vk().allocator());
    SR_VK(result);
    return {};
}

} // namespace semrover
