// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/device/physical_device.h"

#include "runtime/device/cooperative_matrix.h"
#include "runtime/graph/kernel.h"

#include <algorithm>
#include <cstring>
#include <mutex>
#include <new>

namespace semrover {

namespace {

// reported by `devices`; used where a kernel variant asks for them
constexpr const char* kOptionalExtensions[] = {"VK_KHR_cooperative_matrix",    "VK_NV_cooperative_matrix2",
                                               "VK_EXT_subgroup_size_control", "VK_EXT_memory_budget",
                                               "VK_EXT_device_fault",          "VK_KHR_pipeline_executable_properties"};

DeviceType device_type(VkPhysicalDeviceType type)
{
    switch (type) {
    case VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU:
        return DeviceType::discrete;
    case VK_PHYSICAL_DEVICE_TYPE_INTEGRATED_GPU:
        return DeviceType::integrated;
    case VK_PHYSICAL_DEVICE_TYPE_CPU:
        return DeviceType::cpu;
    default:
        return DeviceType::other;
    }
}

int rank(DeviceType type)
{
    switch (type) {
    case DeviceType::discrete:
        return 0;
    case DeviceType::integrated:
        return 1;
    case DeviceType::other:
        return 2;
    case DeviceType::cpu:
        return 3;
    }
    return 4;
}

uint32_t features_of(const VulkanCalls& vk, VkPhysicalDevice physical, const VkPhysicalDeviceVulkan11Properties& p11)
{
    auto f12 = vk_struct<VkPhysicalDeviceVulkan12Features>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES);
    auto features = vk_struct<VkPhysicalDeviceFeatures2>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, &f12);
    vk.GetPhysicalDeviceFeatures2(physical, &features);
    uint32_t found = 0;
    if (p11.subgroupSupportedStages & VK_SHADER_STAGE_COMPUTE_BIT) {
        if (p11.subgroupSupportedOperations & VK_SUBGROUP_FEATURE_ARITHMETIC_BIT)
            found |= kFeatureSubgroupArithmetic;
        if (p11.subgroupSupportedOperations & VK_SUBGROUP_FEATURE_BALLOT_BIT)
            found |= kFeatureSubgroupBallot;
        if (p11.subgroupSupportedOperations & VK_SUBGROUP_FEATURE_SHUFFLE_BIT)
            found |= kFeatureSubgroupShuffle;
        if (p11.subgroupSupportedOperations & VK_SUBGROUP_FEATURE_VOTE_BIT)
            found |= kFeatureSubgroupVote;
    }
    return f12.shaderFloat16 ? found | kFeatureFloat16 : found;
}

DeviceLimits limits_of(const VulkanCalls& vk, VkPhysicalDevice physical, const VkPhysicalDeviceProperties& p,
                       const VkPhysicalDeviceVulkan11Properties& p11)
{
    const VkPhysicalDeviceLimits& v = p.limits;
    DeviceLimits l;
    l.type = device_type(p.deviceType);
    l.subgroup_size = p11.subgroupSize;
    l.features = features_of(vk, physical, p11);
    l.max_shared_bytes = v.maxComputeSharedMemorySize;
    l.max_group_threads = v.maxComputeWorkGroupInvocations;
    l.max_groups =
        std::min({v.maxComputeWorkGroupCount[0], v.maxComputeWorkGroupCount[1], v.maxComputeWorkGroupCount[2]});
    l.max_storage_range = v.maxStorageBufferRange;
    l.max_texel_elements = v.maxTexelBufferElements;
    l.max_allocation = p11.maxMemoryAllocationSize;
    l.offset_alignment = uint32_t(std::max<uint64_t>(
        {256, v.minStorageBufferOffsetAlignment, v.minTexelBufferOffsetAlignment, v.nonCoherentAtomSize}));
    l.max_push_bytes = v.maxPushConstantsSize;
    l.max_storage_buffers = std::min(v.maxPerStageDescriptorStorageBuffers, v.maxDescriptorSetStorageBuffers);
    l.side_by_side = l.type != DeviceType::cpu;
    l.submit_seconds = l.type == DeviceType::cpu ? 0 : 0.1;
    return l;
}

std::string refusal(const VulkanCalls& vk, VkPhysicalDevice physical, const VkPhysicalDeviceProperties& p)
{
    if (p.apiVersion < VK_API_VERSION_1_2)
        return fmt::format("needs Vulkan 1.2, has {}.{}", VK_API_VERSION_MAJOR(p.apiVersion),
                           VK_API_VERSION_MINOR(p.apiVersion));
    auto f12 = vk_struct<VkPhysicalDeviceVulkan12Features>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES);
    auto features = vk_struct<VkPhysicalDeviceFeatures2>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, &f12);
    vk.GetPhysicalDeviceFeatures2(physical, &features);
    if (!f12.timelineSemaphore)
        return "has no timeline semaphores";
    return compute_queue_family(vk, physical) ? "" : "has no compute queue";
}

// enumerate(&count, extensions): as Vulkan's two functions do, of an instance or of a device. Throws std::bad_alloc
// where the driver has no memory, as where we have none: what it does not list then is not absent
template <typename Enumerate>
bool lists(const char* name, Enumerate enumerate)
{
    uint32_t count = 0;
    VkResult result = enumerate(&count, nullptr);
    std::vector<VkExtensionProperties> all(count);
    if (result == VK_SUCCESS)
        result = enumerate(&count, all.data());
    if (result == VK_ERROR_OUT_OF_HOST_MEMORY || result == VK_ERROR_OUT_OF_DEVICE_MEMORY)
        throw std::bad_alloc();
    return result == VK_SUCCESS &&
           std::ranges::any_of(all, [&](const auto& e) { return !std::strcmp(e.extensionName, name); });
}

bool has_instance_extension(const char* name)
{
    return lists(name, [](uint32_t* count, VkExtensionProperties* all) {
        return vkEnumerateInstanceExtensionProperties(nullptr, count, all);
    });
}

} // namespace

std::string api_version_text(uint32_t version)
{
    return fmt::format("{}.{}.{}", VK_API_VERSION_MAJOR(version), VK_API_VERSION_MINOR(version),
                       VK_API_VERSION_PATCH(version));
}

Result<VkInstance> create_instance(bool validation, const VkAllocationCallbacks* allocation)
{
    auto app = vk_struct<VkApplicationInfo>(VK_STRUCTURE_TYPE_APPLICATION_INFO);
    app.pApplicationName = app.pEngineName = "semrover";
    app.apiVersion = VK_API_VERSION_1_2;
    auto info = vk_struct<VkInstanceCreateInfo>(VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO);
    info.pApplicationInfo = &app;
    const VkValidationFeatureEnableEXT enables[] = {VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT};
    auto features = vk_struct<VkValidationFeaturesEXT>(VK_STRUCTURE_TYPE_VALIDATION_FEATURES_EXT);
    features.enabledValidationFeatureCount = 1;
    features.pEnabledValidationFeatures = enables;
    std::vector<const char*> extensions;
    if (validation) {
        info.pNext = &features;
        info.enabledLayerCount = 1;
        info.ppEnabledLayerNames = &kValidationLayer;
        extensions.push_back(VK_EXT_VALIDATION_FEATURES_EXTENSION_NAME);
    }
    if (validation || has_instance_extension(VK_EXT_DEBUG_UTILS_EXTENSION_NAME)) // debug_names.h
        extensions.push_back(VK_EXT_DEBUG_UTILS_EXTENSION_NAME);
    if (has_instance_extension(VK_KHR_PORTABILITY_ENUMERATION_EXTENSION_NAME)) { // MoltenVK is not listed without
        info.flags |= VK_INSTANCE_CREATE_ENUMERATE_PORTABILITY_BIT_KHR;
        extensions.push_back(VK_KHR_PORTABILITY_ENUMERATION_EXTENSION_NAME);
    }
    info.enabledExtensionCount = uint32_t(extensions.size());
    info.ppEnabledExtensionNames = extensions.data();
    VkInstance instance;
    const VkResult result = vkCreateInstance(&info, allocation, &instance);
    if (result == VK_ERROR_LAYER_NOT_PRESENT)
        return fail(ErrorCode::no_device, "{} is not installed (Debian: vulkan-validationlayers)", kValidationLayer);
    if (result == VK_ERROR_OUT_OF_HOST_MEMORY)
        return tl::make_unexpected(vk_error(result, "vkCreateInstance"));
    if (result != VK_SUCCESS)
        return fail(ErrorCode::no_device, "no Vulkan driver: {}; install one (Debian: mesa-vulkan-drivers)",
                    vk_result_name(result));
    return instance;
}

Result<VkInstance> process_instance(bool validation)
{
    static std::mutex mutex;
    static VkInstance instances[2] = {};
    const std::lock_guard guard(mutex);
    VkInstance& instance = instances[validation];
    if (!instance) {
        SR_TRY(instance, create_instance(validation));
    }
    return instance;
}

Result<std::vector<VkPhysicalDevice>> physical_devices(const VulkanCalls& vk, VkInstance instance)
{
    uint32_t count = 0;
    SR_VK(vk.EnumeratePhysicalDevices(instance, &count, nullptr));
    std::vector<VkPhysicalDevice> all(count);
    SR_VK(vk.EnumeratePhysicalDevices(instance, &count, all.data()));
    std::stable_sort(all.begin(), all.end(), [&](VkPhysicalDevice a, VkPhysicalDevice b) {
        VkPhysicalDeviceProperties pa, pb;
        vk.GetPhysicalDeviceProperties(a, &pa);
        vk.GetPhysicalDeviceProperties(b, &pb);
        return rank(device_type(pa.deviceType)) < rank(device_type(pb.deviceType));
    });
    return all;
}

bool has_extension(const VulkanCalls& vk, VkPhysicalDevice physical, const char* name)
{
    return lists(name, [&](uint32_t* count, VkExtensionProperties* all) {
        return vk.EnumerateDeviceExtensionProperties(physical, nullptr, count, all);
    });
}

bool has_pipeline_robustness(const VulkanCalls& vk, VkPhysicalDevice physical)
{
    if (!has_extension(vk, physical, VK_EXT_PIPELINE_ROBUSTNESS_EXTENSION_NAME))
        return false;
    auto robust = vk_struct<VkPhysicalDevicePipelineRobustnessFeaturesEXT>(
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PIPELINE_ROBUSTNESS_FEATURES_EXT);
    auto features = vk_struct<VkPhysicalDeviceFeatures2>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, &robust);
    vk.GetPhysicalDeviceFeatures2(physical, &features);
    return robust.pipelineRobustness;
}

namespace {

std::vector<VkQueueFamilyProperties> queue_families(const VulkanCalls& vk, VkPhysicalDevice physical)
{
    uint32_t count = 0;
    vk.GetPhysicalDeviceQueueFamilyProperties(physical, &count, nullptr);
    std::vector<VkQueueFamilyProperties> families(count);
    vk.GetPhysicalDeviceQueueFamilyProperties(physical, &count, families.data());
    return families;
}

} // namespace

bool is_compute_family(const VulkanCalls& vk, VkPhysicalDevice physical, uint32_t family)
{
    const auto families = queue_families(vk, physical);
    return family < families.size() && (families[family].queueFlags & VK_QUEUE_COMPUTE_BIT);
}

bool has_timestamps(const VulkanCalls& vk, VkPhysicalDevice physical, uint32_t family)
{
    const auto families = queue_families(vk, physical);
    return family < families.size() && families[family].timestampValidBits > 0;
}

Result<uint32_t> compute_queue_family(const VulkanCalls& vk, VkPhysicalDevice physical)
{
    const auto families = queue_families(vk, physical);
    const auto is_compute = [](const auto& f) { return (f.queueFlags & VK_QUEUE_COMPUTE_BIT) != 0; };
    // one that draws nothing, where there is one: a desktop draws beside it
    auto found = std::ranges::find_if(families, [&](const auto& f) {
        return is_compute(f) && !(f.queueFlags & VK_QUEUE_GRAPHICS_BIT) && f.timestampValidBits > 0;
    });
    if (found == families.end())
        found = std::ranges::find_if(families, is_compute);
    if (found != families.end())
        return uint32_t(found - families.begin());
    return fail(ErrorCode::no_device, "the device has no compute queue");
}

namespace {

std::string uuid_text(const uint8_t (&bytes)[VK_UUID_SIZE])
{
    std::string text;
    for (size_t i = 0; i < VK_UUID_SIZE; ++i)
        text += fmt::format("{}{:02x}", i == 4 || i == 6 || i == 8 || i == 10 ? "-" : "", bytes[i]);
    return text;
}

std::string pci_text(const VulkanCalls& vk, VkPhysicalDevice physical)
{
    if (!has_extension(vk, physical, VK_EXT_PCI_BUS_INFO_EXTENSION_NAME))
        return "";
    auto pci = vk_struct<VkPhysicalDevicePCIBusInfoPropertiesEXT>(
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PCI_BUS_INFO_PROPERTIES_EXT);
    auto p = vk_struct<VkPhysicalDeviceProperties2>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, &pci);
    vk.GetPhysicalDeviceProperties2(physical, &p);
    return fmt::format("{:04x}:{:02x}:{:02x}.{}", pci.pciDomain, pci.pciBus, pci.pciDevice, pci.pciFunction);
}

// multiprocessors, compute units or cores, by what a vendor calls them; 0: it does not say
uint32_t compute_units(const VulkanCalls& vk, VkPhysicalDevice physical)
{
    const auto query = [&](const char* extension, auto& properties) {
        if (!has_extension(vk, physical, extension))
            return;
        auto p = vk_struct<VkPhysicalDeviceProperties2>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, &properties);
        vk.GetPhysicalDeviceProperties2(physical, &p);
    };
    auto nv = vk_struct<VkPhysicalDeviceShaderSMBuiltinsPropertiesNV>(
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SHADER_SM_BUILTINS_PROPERTIES_NV);
    auto amd = vk_struct<VkPhysicalDeviceShaderCorePropertiesAMD>(
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SHADER_CORE_PROPERTIES_AMD);
    auto arm = vk_struct<VkPhysicalDeviceShaderCoreBuiltinsPropertiesARM>(
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SHADER_CORE_BUILTINS_PROPERTIES_ARM);
    query(VK_NV_SHADER_SM_BUILTINS_EXTENSION_NAME, nv);
    query(VK_AMD_SHADER_CORE_PROPERTIES_EXTENSION_NAME, amd);
    query(VK_ARM_SHADER_CORE_BUILTINS_EXTENSION_NAME, arm);
    return nv.shaderSMCount + amd.shaderEngineCount * amd.shaderArraysPerEngineCount * amd.computeUnitsPerShaderArray +
           arm.shaderCoreCount;
}

} // namespace

DeviceSummary summarize(const VulkanCalls& vk, VkInstance instance, VkPhysicalDevice physical, uint32_t index)
{
    auto p12 = vk_struct<VkPhysicalDeviceVulkan12Properties>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_PROPERTIES);
    auto p11 =
        vk_struct<VkPhysicalDeviceVulkan11Properties>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_1_PROPERTIES, &p12);
    auto p = vk_struct<VkPhysicalDeviceProperties2>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, &p11);
    vk.GetPhysicalDeviceProperties2(physical, &p);
    static constexpr const char* kTypes[] = {"cpu", "integrated", "discrete", "other"};
    DeviceSummary s;
    s.index = index;
    s.name = p.properties.deviceName;
    s.driver = fmt::format("{} {}", p12.driverName, p12.driverInfo);
    s.type = kTypes[int(device_type(p.properties.deviceType))];
    s.api = api_version_text(p.properties.apiVersion);
    s.uuid = uuid_text(p11.deviceUUID);
    s.pci = pci_text(vk, physical);
    s.vendor = p.properties.vendorID;
    s.refusal = refusal(vk, physical, p.properties);
    s.limits = limits_of(vk, physical, p.properties, p11);
    s.limits.matrix = matrix_shape(vk, instance, physical);
    if (const uint32_t units = compute_units(vk, physical))
        s.limits.compute_units = units;
    if (s.limits.matrix.m)
        s.limits.features |= kFeatureCooperativeMatrix;
    if (s.limits.matrix.half_sums)
        s.limits.features |= kFeatureHalfSums;
    VkPhysicalDeviceMemoryProperties memory;
    vk.GetPhysicalDeviceMemoryProperties(physical, &memory);
    for (uint32_t i = 0; i < memory.memoryHeapCount; ++i)
        if (memory.memoryHeaps[i].flags & VK_MEMORY_HEAP_DEVICE_LOCAL_BIT)
            s.memory_bytes = std::max<uint64_t>(s.memory_bytes, memory.memoryHeaps[i].size);
    for (const char* extension : kOptionalExtensions)
        if (has_extension(vk, physical, extension))
            s.extensions.push_back(extension);
    return s;
}

Result<std::vector<DeviceSummary>> list_devices()
{
    SR_TRY(const VkInstance instance, process_instance(false));
    VulkanCalls vk;
    SR_CHECK(vk.load_instance(nullptr, instance));
    auto all = physical_devices(vk, instance);
    std::vector<DeviceSummary> out;
    if (all)
        for (size_t i = 0; i < all->size(); ++i)
            out.push_back(summarize(vk, instance, (*all)[i], uint32_t(i)));
    if (!all)
        return tl::make_unexpected(all.error());
    return out;
}

} // namespace semrover
