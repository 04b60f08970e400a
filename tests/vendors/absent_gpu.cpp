// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
//
// A Vulkan layer over a driver whose GPU is not there: Mesa's RADV with RADV_FORCE_FAMILY compiles shaders for any AMD
// chip, but has neither memory nor a queue. Instance, physical device, layouts and pipelines are the driver's. The
// layer answers everything else itself: memory is zeros, submits end at once, nothing is computed. So a whole program
// plans, compiles and records for that chip.
//
// ABSENT_GPU_LOG: a file to which it adds one JSON object a line: one for each pipeline when it is made (hash of the
// SPIR-V, constants, seconds, the compiler's statistics), and one for each device when it goes: of each pipeline the
// dispatches and the workgroups of the smallest. ABSENT_GPU_ASSEMBLY: a folder for what
// VK_KHR_pipeline_executable_properties says of each pipeline's code.
#include "tests/vendors/layer.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fmt/format.h>
#include <map>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

namespace {

// ---- what is noted

struct PipelineNote {
    uint64_t code_hash;
    uint64_t dispatches = 0, fewest_groups = ~0ull;
};

struct Notes {
    std::mutex mutex;
    std::map<VkShaderModule, uint64_t> modules; // hash of the code
    std::map<VkPipeline, size_t> index;
    std::vector<PipelineNote> pipelines;
};
Notes notes;

uint64_t fnv1a(const void* data, size_t bytes)
{
    uint64_t hash = 0xcbf29ce484222325;
    for (size_t i = 0; i < bytes; ++i)
        hash = (hash ^ static_cast<const unsigned char*>(data)[i]) * 0x100000001b3;
    return hash;
}

void add_line(const std::string& line)
{
    const char* path = std::getenv("ABSENT_GPU_LOG");
    if (std::FILE* file = path ? std::fopen(path, "a") : nullptr) {
        fmt::print(file, "{}\n", line);
        std::fclose(file);
    }
}

// {"KEY": NUMBER, ...}
template <typename Map>
std::string json_of(const Map& numbers)
{
    std::string text;
    for (const auto& [name, value] : numbers)
        text += fmt::format("{}\"{}\": {}", text.empty() ? "" : ", ", name, value);
    return "{" + text + "}";
}

void note_recorded()
{
    std::string pipelines;
    for (const PipelineNote& p : notes.pipelines)
        if (p.dispatches)
            pipelines += fmt::format("{}[\"{:016x}\", {}, {}]", pipelines.empty() ? "" : ", ", p.code_hash,
                                     p.dispatches, p.fewest_groups);
    add_line(fmt::format("{{\"pipelines\": [{}]}}", pipelines));
    notes.pipelines.clear();
    notes.index.clear();
}

// ---- handles of what the driver does not have

template <typename Handle>
Handle new_handle()
{
    static uint64_t last = 0;
    last += 16;
    return reinterpret_cast<Handle>(last);
}

// the loader writes its table of functions into the first word
struct Commands {
    uintptr_t loader = 0x01CDC0DE; // ICD_LOADER_MAGIC
    VkPipeline bound = VK_NULL_HANDLE;
};

// memory of the device is never read: a byte stands for it
struct Memory {
    char* bytes;
    bool of_host;
};

struct Buffer {
    VkDeviceSize size;
    Memory* memory = nullptr;
    VkDeviceSize offset = 0;
};
std::mutex buffers_mutex;
std::map<VkBuffer, Buffer> buffers;
constexpr uint32_t kDeviceType = 0, kHostType = 1;
constexpr VkDeviceSize kAlignment = 256;

// ---- memory

VKAPI_ATTR void VKAPI_CALL get_memory(VkPhysicalDevice, VkPhysicalDeviceMemoryProperties* m)
{
    *m = {};
    m->memoryHeapCount = m->memoryTypeCount = 2;
    m->memoryHeaps[kDeviceType] = {24ull << 30, VK_MEMORY_HEAP_DEVICE_LOCAL_BIT};
    m->memoryHeaps[kHostType] = {16ull << 30, 0};
    m->memoryTypes[kDeviceType] = {VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT, kDeviceType};
    m->memoryTypes[kHostType] = {VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT |
                                     VK_MEMORY_PROPERTY_HOST_CACHED_BIT,
                                 kHostType};
}

VKAPI_ATTR VkResult VKAPI_CALL create_buffer(VkDevice, const VkBufferCreateInfo* info, const VkAllocationCallbacks*,
                                             VkBuffer* buffer)
{
    const std::lock_guard guard(buffers_mutex);
    *buffer = new_handle<VkBuffer>();
    buffers[*buffer] = {info->size};
    return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL destroy_buffer(VkDevice, VkBuffer buffer, const VkAllocationCallbacks*)
{
    const std::lock_guard guard(buffers_mutex);
    buffers.erase(buffer);
}

VKAPI_ATTR void VKAPI_CALL get_requirements(VkDevice, VkBuffer buffer, VkMemoryRequirements* r)
{
    const std::lock_guard guard(buffers_mutex);
    *r = {(buffers[buffer].size + kAlignment - 1) / kAlignment * kAlignment, kAlignment, 3};
}

VKAPI_ATTR VkResult VKAPI_CALL allocate_memory(VkDevice, const VkMemoryAllocateInfo* info, const VkAllocationCallbacks*,
                                               VkDeviceMemory* memory)
{
    const bool of_host = info->memoryTypeIndex == kHostType;
    auto* bytes = static_cast<char*>(std::calloc(of_host ? info->allocationSize : 1, 1));
    if (!bytes)
        return VK_ERROR_OUT_OF_HOST_MEMORY;
    *memory = reinterpret_cast<VkDeviceMemory>(new Memory{bytes, of_host});
    return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL free_memory(VkDevice, VkDeviceMemory memory, const VkAllocationCallbacks*)
{
    auto* m = reinterpret_cast<Memory*>(memory);
    if (m)
        std::free(m->bytes);
    delete m;
}

VKAPI_ATTR VkResult VKAPI_CALL bind_memory(VkDevice, VkBuffer buffer, VkDeviceMemory memory, VkDeviceSize offset)
{
    const std::lock_guard guard(buffers_mutex);
    buffers[buffer].memory = reinterpret_cast<Memory*>(memory);
    buffers[buffer].offset = offset;
    return VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL map_memory(VkDevice, VkDeviceMemory memory, VkDeviceSize offset, VkDeviceSize,
                                          VkMemoryMapFlags, void** data)
{
    *data = reinterpret_cast<Memory*>(memory)->bytes + offset;
    return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL unmap_memory(VkDevice, VkDeviceMemory) {}

// ---- what has a handle and no more

template <typename Info, typename Handle>
VKAPI_ATTR VkResult VKAPI_CALL create(VkDevice, const Info*, const VkAllocationCallbacks*, Handle* handle)
{
    const std::lock_guard guard(buffers_mutex);
    *handle = new_handle<Handle>();
    return VK_SUCCESS;
}

template <typename Handle>
VKAPI_ATTR void VKAPI_CALL destroy(VkDevice, Handle, const VkAllocationCallbacks*)
{
}

VKAPI_ATTR VkResult VKAPI_CALL allocate_sets(VkDevice, const VkDescriptorSetAllocateInfo* info, VkDescriptorSet* sets)
{
    const std::lock_guard guard(buffers_mutex);
    for (uint32_t i = 0; i < info->descriptorSetCount; ++i)
        sets[i] = new_handle<VkDescriptorSet>();
    return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL update_sets(VkDevice, uint32_t, const VkWriteDescriptorSet*, uint32_t,
                                       const VkCopyDescriptorSet*)
{
}

// ---- the queue: everything ends at once

VKAPI_ATTR VkResult VKAPI_CALL submit(VkQueue, uint32_t, const VkSubmitInfo*, VkFence)
{
    return VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL wait_semaphores(VkDevice, const VkSemaphoreWaitInfo*, uint64_t)
{
    return VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL get_counter(VkDevice, VkSemaphore, uint64_t* value)
{
    *value = ~0ull;
    return VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL get_query_results(VkDevice, VkQueryPool, uint32_t, uint32_t, size_t bytes, void* data,
                                                 VkDeviceSize, VkQueryResultFlags)
{
    std::memset(data, 0, bytes);
    return VK_SUCCESS;
}

// ---- command buffers

VKAPI_ATTR VkResult VKAPI_CALL allocate_commands(VkDevice, const VkCommandBufferAllocateInfo* info,
                                                 VkCommandBuffer* commands)
{
    for (uint32_t i = 0; i < info->commandBufferCount; ++i)
        commands[i] = reinterpret_cast<VkCommandBuffer>(new Commands); // as many as programs record: they stay
    return VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL begin_commands(VkCommandBuffer, const VkCommandBufferBeginInfo*)
{
    return VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL end_commands(VkCommandBuffer)
{
    return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL bind_pipeline(VkCommandBuffer commands, VkPipelineBindPoint, VkPipeline pipeline)
{
    reinterpret_cast<Commands*>(commands)->bound = pipeline;
}

VKAPI_ATTR void VKAPI_CALL bind_sets(VkCommandBuffer, VkPipelineBindPoint, VkPipelineLayout, uint32_t, uint32_t,
                                     const VkDescriptorSet*, uint32_t, const uint32_t*)
{
}

// of objects that the driver does not know
VKAPI_ATTR VkResult VKAPI_CALL set_name(VkDevice, const VkDebugUtilsObjectNameInfoEXT*)
{
    return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL begin_label(VkCommandBuffer, const VkDebugUtilsLabelEXT*) {}

VKAPI_ATTR void VKAPI_CALL end_label(VkCommandBuffer) {}

VKAPI_ATTR void VKAPI_CALL push_constants(VkCommandBuffer, VkPipelineLayout, VkShaderStageFlags, uint32_t, uint32_t,
                                          const void*)
{
}

VKAPI_ATTR void VKAPI_CALL dispatch(VkCommandBuffer commands, uint32_t x, uint32_t y, uint32_t z)
{
    const std::lock_guard guard(notes.mutex);
    const auto found = notes.index.find(reinterpret_cast<Commands*>(commands)->bound);
    if (found == notes.index.end())
        return;
    PipelineNote& p = notes.pipelines[found->second];
    ++p.dispatches;
    p.fewest_groups = std::min(p.fewest_groups, uint64_t(x) * y * z);
}

VKAPI_ATTR void VKAPI_CALL dispatch_base(VkCommandBuffer commands, uint32_t, uint32_t, uint32_t, uint32_t x, uint32_t y,
                                         uint32_t z)
{
    dispatch(commands, x, y, z);
}

VKAPI_ATTR void VKAPI_CALL barrier(VkCommandBuffer, VkPipelineStageFlags, VkPipelineStageFlags, VkDependencyFlags,
                                   uint32_t, const VkMemoryBarrier*, uint32_t, const VkBufferMemoryBarrier*, uint32_t,
                                   const VkImageMemoryBarrier*)
{
}

// what is read back is zeros; when it is recorded is early enough
VKAPI_ATTR void VKAPI_CALL copy_buffer(VkCommandBuffer, VkBuffer, VkBuffer to, uint32_t count,
                                       const VkBufferCopy* regions)
{
    const std::lock_guard guard(buffers_mutex);
    const Buffer& b = buffers[to];
    for (uint32_t i = 0; b.memory && b.memory->of_host && i < count; ++i)
        std::memset(b.memory->bytes + b.offset + regions[i].dstOffset, 0, regions[i].size);
}
VKAPI_ATTR void VKAPI_CALL fill_buffer(VkCommandBuffer, VkBuffer, VkDeviceSize, VkDeviceSize, uint32_t) {}
VKAPI_ATTR void VKAPI_CALL reset_queries(VkCommandBuffer, VkQueryPool, uint32_t, uint32_t) {}
VKAPI_ATTR void VKAPI_CALL write_timestamp(VkCommandBuffer, VkPipelineStageFlagBits, VkQueryPool, uint32_t) {}

// ---- pipelines: the driver's, with what its compiler says of them

VKAPI_ATTR VkResult VKAPI_CALL create_module(VkDevice device, const VkShaderModuleCreateInfo* info,
                                             const VkAllocationCallbacks* allocator, VkShaderModule* module)
{
    const VkResult result =
        driver.of_device<PFN_vkCreateShaderModule>("vkCreateShaderModule")(device, info, allocator, module);
    const std::lock_guard guard(notes.mutex);
    if (result == VK_SUCCESS)
        notes.modules[*module] = fnv1a(info->pCode, info->codeSize);
    return result;
}

std::map<uint32_t, uint32_t> constants_of(const VkSpecializationInfo* info)
{
    std::map<uint32_t, uint32_t> constants;
    for (uint32_t i = 0; info && i < info->mapEntryCount; ++i)
        std::memcpy(&constants[info->pMapEntries[i].constantID],
                    static_cast<const char*>(info->pData) + info->pMapEntries[i].offset, 4);
    return constants;
}

std::map<std::string, uint64_t> statistics_of(VkDevice device, VkPipeline pipeline)
{
    const auto get = driver.of_device<PFN_vkGetPipelineExecutableStatisticsKHR>("vkGetPipelineExecutableStatisticsKHR");
    const VkPipelineExecutableInfoKHR info{VK_STRUCTURE_TYPE_PIPELINE_EXECUTABLE_INFO_KHR, nullptr, pipeline, 0};
    uint32_t count = 0;
    if (get(device, &info, &count, nullptr) != VK_SUCCESS)
        return {};
    std::vector<VkPipelineExecutableStatisticKHR> all(count);
    for (auto& s : all)
        s.sType = VK_STRUCTURE_TYPE_PIPELINE_EXECUTABLE_STATISTIC_KHR;
    if (get(device, &info, &count, all.data()) != VK_SUCCESS)
        return {};
    std::map<std::string, uint64_t> statistics;
    for (const auto& s : all)
        statistics[s.name] = s.value.u64;
    return statistics;
}

void write_assembly(VkDevice device, VkPipeline pipeline, const std::string& path)
{
    const auto get = driver.of_device<PFN_vkGetPipelineExecutableInternalRepresentationsKHR>(
        "vkGetPipelineExecutableInternalRepresentationsKHR");
    const VkPipelineExecutableInfoKHR info{VK_STRUCTURE_TYPE_PIPELINE_EXECUTABLE_INFO_KHR, nullptr, pipeline, 0};
    uint32_t count = 0;
    if (get(device, &info, &count, nullptr) != VK_SUCCESS)
        return;
    std::vector<VkPipelineExecutableInternalRepresentationKHR> all(count);
    for (auto& r : all)
        r.sType = VK_STRUCTURE_TYPE_PIPELINE_EXECUTABLE_INTERNAL_REPRESENTATION_KHR;
    if (get(device, &info, &count, all.data()) != VK_SUCCESS)
        return;
    std::vector<std::string> texts(count);
    for (uint32_t i = 0; i < count; ++i) {
        texts[i].resize(all[i].dataSize);
        all[i].pData = texts[i].data();
    }
    std::FILE* file = std::fopen(path.c_str(), "w");
    if (!file)
        return;
    if (get(device, &info, &count, all.data()) == VK_SUCCESS)
        for (uint32_t i = 0; i < count; ++i)
            if (std::string_view(all[i].name) == "Assembly")
                std::fputs(texts[i].c_str(), file);
    std::fclose(file);
}

VKAPI_ATTR VkResult VKAPI_CALL create_pipelines(VkDevice device, VkPipelineCache, uint32_t count,
                                                const VkComputePipelineCreateInfo* infos,
                                                const VkAllocationCallbacks* allocator, VkPipeline* pipelines)
{
    const char* assembly = std::getenv("ABSENT_GPU_ASSEMBLY");
    for (uint32_t i = 0; i < count; ++i) {
        VkComputePipelineCreateInfo info = infos[i];
        info.flags |= VK_PIPELINE_CREATE_CAPTURE_STATISTICS_BIT_KHR;
        if (assembly)
            info.flags |= VK_PIPELINE_CREATE_CAPTURE_INTERNAL_REPRESENTATIONS_BIT_KHR;
        const auto begin = std::chrono::steady_clock::now();
        const auto make = driver.of_device<PFN_vkCreateComputePipelines>("vkCreateComputePipelines");
        if (const VkResult result = make(device, VK_NULL_HANDLE, 1, &info, allocator, &pipelines[i]))
            return result;
        const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
        const std::lock_guard guard(notes.mutex);
        notes.index[pipelines[i]] = notes.pipelines.size();
        notes.pipelines.push_back({notes.modules[info.stage.module]});
        add_line(fmt::format("{{\"code\": \"{:016x}\", \"constants\": {}, \"seconds\": {:.4f}, \"statistics\": {}}}",
                             notes.pipelines.back().code_hash, json_of(constants_of(info.stage.pSpecializationInfo)),
                             seconds.count(), json_of(statistics_of(device, pipelines[i]))));
        if (assembly)
            write_assembly(
                device, pipelines[i],
                fmt::format("{}/{:016x}-{}.s", assembly, notes.pipelines.back().code_hash, notes.pipelines.size()));
    }
    return VK_SUCCESS;
}

// ---- the device: with what its compiler says

VKAPI_ATTR VkResult VKAPI_CALL create_device(VkPhysicalDevice physical, const VkDeviceCreateInfo* info,
                                             const VkAllocationCallbacks* allocator, VkDevice* device)
{
    VkPhysicalDevicePipelineExecutablePropertiesFeaturesKHR statistics{
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PIPELINE_EXECUTABLE_PROPERTIES_FEATURES_KHR, const_cast<void*>(info->pNext),
        VK_TRUE};
    std::vector<const char*> extensions(info->ppEnabledExtensionNames,
                                        info->ppEnabledExtensionNames + info->enabledExtensionCount);
    const std::string_view name = VK_KHR_PIPELINE_EXECUTABLE_PROPERTIES_EXTENSION_NAME;
    if (std::ranges::count(extensions, name)) // with its feature: the program is to print them
        return create_next_device(physical, *info, *info, allocator, device);
    extensions.push_back(name.data());
    VkDeviceCreateInfo more = *info;
    more.pNext = &statistics;
    more.enabledExtensionCount = uint32_t(extensions.size());
    more.ppEnabledExtensionNames = extensions.data();
    return create_next_device(physical, *info, more, allocator, device);
}

VKAPI_ATTR void VKAPI_CALL destroy_device(VkDevice device, const VkAllocationCallbacks* allocator)
{
    note_recorded();
    driver.of_device<PFN_vkDestroyDevice>("vkDestroyDevice")(device, allocator);
}

// ---- the table of functions

PFN_vkVoidFunction ours(std::string_view name)
{
    static const std::map<std::string_view, PFN_vkVoidFunction> functions = {
        {"vkCreateDevice", any(create_device)},
        {"vkDestroyDevice", any(destroy_device)},
        {"vkGetPhysicalDeviceMemoryProperties", any(get_memory)},
        {"vkCreateBuffer", any(create_buffer)},
        {"vkDestroyBuffer", any(destroy_buffer)},
        {"vkGetBufferMemoryRequirements", any(get_requirements)},
        {"vkAllocateMemory", any(allocate_memory)},
        {"vkFreeMemory", any(free_memory)},
        {"vkBindBufferMemory", any(bind_memory)},
        {"vkMapMemory", any(map_memory)},
        {"vkUnmapMemory", any(unmap_memory)},
        {"vkCreateBufferView", any(create<VkBufferViewCreateInfo, VkBufferView>)},
        {"vkDestroyBufferView", any(destroy<VkBufferView>)},
        {"vkCreateSemaphore", any(create<VkSemaphoreCreateInfo, VkSemaphore>)},
        {"vkDestroySemaphore", any(destroy<VkSemaphore>)},
        {"vkCreateQueryPool", any(create<VkQueryPoolCreateInfo, VkQueryPool>)},
        {"vkDestroyQueryPool", any(destroy<VkQueryPool>)},
        {"vkCreateDescriptorPool", any(create<VkDescriptorPoolCreateInfo, VkDescriptorPool>)},
        {"vkDestroyDescriptorPool", any(destroy<VkDescriptorPool>)},
        {"vkAllocateDescriptorSets", any(allocate_sets)},
        {"vkUpdateDescriptorSets", any(update_sets)},
        {"vkCreateCommandPool", any(create<VkCommandPoolCreateInfo, VkCommandPool>)},
        {"vkDestroyCommandPool", any(destroy<VkCommandPool>)},
        {"vkAllocateCommandBuffers", any(allocate_commands)},
        {"vkBeginCommandBuffer", any(begin_commands)},
        {"vkEndCommandBuffer", any(end_commands)},
        {"vkQueueSubmit", any(submit)},
        {"vkWaitSemaphores", any(wait_semaphores)},
        {"vkGetSemaphoreCounterValue", any(get_counter)},
        {"vkGetQueryPoolResults", any(get_query_results)},
        {"vkSetDebugUtilsObjectNameEXT", any(set_name)},
        {"vkCmdBeginDebugUtilsLabelEXT", any(begin_label)},
        {"vkCmdEndDebugUtilsLabelEXT", any(end_label)},
        {"vkCmdBindPipeline", any(bind_pipeline)},
        {"vkCmdBindDescriptorSets", any(bind_sets)},
        {"vkCmdPushConstants", any(push_constants)},
        {"vkCmdDispatch", any(dispatch)},
        {"vkCmdDispatchBase", any(dispatch_base)},
        {"vkCmdPipelineBarrier", any(barrier)},
        {"vkCmdCopyBuffer", any(copy_buffer)},
        {"vkCmdFillBuffer", any(fill_buffer)},
        {"vkCmdResetQueryPool", any(reset_queries)},
        {"vkCmdWriteTimestamp", any(write_timestamp)},
        {"vkCreateShaderModule", any(create_module)},
        {"vkCreateComputePipelines", any(create_pipelines)},
    };
    const auto found = functions.find(name);
    return found == functions.end() ? nullptr : found->second;
}

} // namespace
