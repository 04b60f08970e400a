// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
//
// A Vulkan layer under which the FAILING_GPU_AT-th call of FAILING_GPU_CALL (vkQueueSubmit) fails with the VkResult
// FAILING_GPU_RESULT (-4, VK_ERROR_DEVICE_LOST). Calls of a device are counted anew for each; the first
// FAILING_GPU_DEVICES (1) devices of the process fail. A device that is lost stays so: each submit and each wait says
// it. What a call that fails leaves undefined is spoiled. FAILING_GPU_LOG names a file that gets a line for the
// failure, and at the end of the process one for each call that there was, with how often. Everything else is the
// driver's.
#include "tests/vendors/layer.h"

#include <array>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <type_traits>

namespace {

// every call that the runtime makes and that may fail: of an instance, and of a device
#define INSTANCE_CALLS(X)                                                                                              \
    X(CreateInstance) X(EnumeratePhysicalDevices) X(EnumerateDeviceExtensionProperties) X(CreateDevice)
#define DEVICE_CALLS(X)                                                                                                \
    X(AllocateCommandBuffers)                                                                                          \
    X(AllocateDescriptorSets) X(AllocateMemory) X(BeginCommandBuffer) X(BindBufferMemory) X(CreateBuffer)              \
        X(CreateBufferView) X(CreateCommandPool) X(CreateComputePipelines) X(CreateDescriptorPool)                     \
            X(CreateDescriptorSetLayout) X(CreatePipelineCache) X(CreatePipelineLayout) X(CreateQueryPool)             \
                X(CreateSemaphore) X(CreateShaderModule) X(EndCommandBuffer) X(GetPipelineCacheData)                   \
                    X(GetQueryPoolResults) X(GetSemaphoreCounterValue) X(MapMemory) X(QueueSubmit)                     \
                        X(ResetCommandBuffer) X(WaitSemaphores)
#define COUNTED(name) k##name,
enum Counted : size_t { INSTANCE_CALLS(COUNTED) DEVICE_CALLS(COUNTED) kCalls };
constexpr size_t kOfDevice = kCreateDevice + 1; // from here on
#undef COUNTED
#define NAMED(name) "vk" #name,
constexpr std::array<const char*, kCalls> kNames = {INSTANCE_CALLS(NAMED) DEVICE_CALLS(NAMED)};
#undef NAMED

const char* text_of(const char* variable, const char* otherwise)
{
    const char* text = std::getenv(variable);
    return text ? text : otherwise;
}

void log(const char* first, const char* name, int count)
{
    if (std::FILE* file = std::fopen(text_of("FAILING_GPU_LOG", "/dev/null"), "a")) {
        std::fprintf(file, "%s%s %d\n", first, name, count);
        std::fclose(file);
    }
}

// of all calls, in this process and since the device was made
struct Counts {
    std::array<std::atomic<int>, kCalls> all = {}, since = {};
    std::atomic<int> devices = 0;
    std::atomic<bool> lost = false;

    ~Counts()
    {
        for (size_t i = 0; i < kCalls; ++i)
            if (all[i])
                log("", kNames[i], all[i]);
    }
};
Counts counts;

// what the driver still runs ends first: it would write to memory that the program frees
VkResult lose()
{
    counts.lost = true;
    driver.of_device<PFN_vkDeviceWaitIdle>("vkDeviceWaitIdle")(driver.device);
    return VK_ERROR_DEVICE_LOST;
}

bool says_it_is_lost(size_t call)
{
    return call == kQueueSubmit || call == kWaitSemaphores || call == kGetSemaphoreCounterValue ||
           call == kGetQueryPoolResults;
}

// VK_SUCCESS: the driver is asked
VkResult failure(size_t call)
{
    static const char* const name = text_of("FAILING_GPU_CALL", "vkQueueSubmit");
    static const int at = std::atoi(text_of("FAILING_GPU_AT", "0"));
    static const auto result = VkResult(std::atoi(text_of("FAILING_GPU_RESULT", "-4")));
    static const int failing = std::atoi(text_of("FAILING_GPU_DEVICES", "1"));
    ++counts.all[call];
    const int count = ++counts.since[call];
    if (counts.lost && says_it_is_lost(call))
        return lose();
    if (counts.devices > failing || count != at || std::strcmp(kNames[call], name) != 0)
        return VK_SUCCESS;
    log("failed ", name, count);
    return result == VK_ERROR_DEVICE_LOST && says_it_is_lost(call) ? lose() : result;
}

// where a call would put a handle or an address: undefined if it makes one, null if it makes several
// (Vulkan 1.2, 2.9.3)
template <size_t call, typename T>
void spoil(T made)
{
    using Handle = std::remove_pointer_t<T>;
    constexpr bool several =
        call == kCreateComputePipelines || call == kAllocateCommandBuffers || call == kAllocateDescriptorSets;
    if constexpr (std::is_pointer_v<Handle> && !std::is_const_v<Handle>)
        if (made)
            *made = reinterpret_cast<Handle>(uintptr_t(several ? 0 : 0xbad0bad0bad0));
}

// asked for while the instance is made: later the loader gives the first layer's
std::array<PFN_vkVoidFunction, kOfDevice> next_of_instance = {};

template <size_t call, typename F>
struct Failing;
template <size_t call, typename... Arguments>
struct Failing<call, VkResult(VKAPI_PTR*)(Arguments...)> {
    using Function = VkResult(VKAPI_PTR*)(Arguments...);
    static VkResult real(Arguments... arguments)
    {
        if constexpr (call < kOfDevice)
            return reinterpret_cast<Function>(next_of_instance[call])(arguments...);
        else
            return driver.of_device<Function>(kNames[call])(arguments...);
    }
    static VKAPI_ATTR VkResult VKAPI_CALL run(Arguments... arguments)
    {
        const VkResult failed = failure(call);
        if (failed == VK_SUCCESS)
            return real(arguments...);
        if constexpr (call == kEndCommandBuffer) // which no longer records then, either
            real(arguments...);
        (spoil<call>(arguments), ...);
        return failed;
    }
};

template <>
VkResult Failing<kCreateInstance, PFN_vkCreateInstance>::real(const VkInstanceCreateInfo* info,
                                                              const VkAllocationCallbacks* allocator,
                                                              VkInstance* instance)
{
    const VkResult result = create_instance(info, allocator, instance);
    for (size_t i = 0; i < kOfDevice && result == VK_SUCCESS; ++i)
        next_of_instance[i] = driver.of_instance<PFN_vkVoidFunction>(kNames[i]);
    return result;
}

template <>
VkResult Failing<kCreateDevice, PFN_vkCreateDevice>::real(VkPhysicalDevice physical, const VkDeviceCreateInfo* info,
                                                          const VkAllocationCallbacks* allocator, VkDevice* device)
{
    const VkResult result = create_next_device(physical, *info, *info, allocator, device);
    if (result != VK_SUCCESS)
        return result;
    ++counts.devices;
    counts.lost = false;
    for (size_t i = kOfDevice; i < kCalls; ++i)
        counts.since[i] = 0;
    return result;
}

PFN_vkVoidFunction ours(std::string_view name)
{
#define OURS(called)                                                                                                   \
    if (name == "vk" #called)                                                                                          \
        return any(Failing<k##called, PFN_vk##called>::run);
    INSTANCE_CALLS(OURS)
    DEVICE_CALLS(OURS)
#undef OURS
    return nullptr;
}

} // namespace
