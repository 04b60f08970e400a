// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/view/gpu.h"

#include "runtime/base/quote.h"

#include <array>
#include <charconv>
#include <vector>

namespace semrover::view {

Status checked(VkResult result, const char* what)
{
    if (result == VK_SUCCESS)
        return {};
    const bool memory = result == VK_ERROR_OUT_OF_HOST_MEMORY || result == VK_ERROR_OUT_OF_DEVICE_MEMORY;
    const ErrorCode code = result == VK_ERROR_DEVICE_LOST ? ErrorCode::device_lost
                           : memory                       ? ErrorCode::out_of_memory
                                                          : ErrorCode::no_device;
    return fail(code, "{} failed ({})", what, int(result));
}

Status checked(int status, const sr_context* context)
{
    if (status == SR_OK)
        return {};
    std::array<char, 1024> line{};
    sr_last_error(context, line.data(), line.size());
    return fail(ErrorCode(status), "{}", line.data());
}

Result<std::unique_ptr<Gpu>> Gpu::create(const GpuRequest& request)
{
    std::unique_ptr<Gpu> gpu(new Gpu);
    SR_CHECK(gpu->open_instance(request));
    SR_CHECK(gpu->pick_device(request.device));
    SR_CHECK(gpu->open_device());
    SR_CHECK(gpu->open_context(request.max_bytes));
    return gpu;
}

Gpu::~Gpu()
{
    sr_context_destroy(context_);
    if (device_) {
        vkDestroySemaphore(device_, timeline_, nullptr);
        vkDestroyCommandPool(device_, pool_, nullptr);
        vkDestroyDevice(device_, nullptr);
    }
    if (surface_)
        vkDestroySurfaceKHR(instance_, surface_, nullptr);
    if (instance_)
        vkDestroyInstance(instance_, nullptr);
}

Status Gpu::open_instance(const GpuRequest& request)
{
    const VkApplicationInfo app{.sType = VK_STRUCTURE_TYPE_APPLICATION_INFO,
                                .pNext = nullptr,
                                .pApplicationName = "semrover view",
                                .applicationVersion = 0,
                                .pEngineName = nullptr,
                                .engineVersion = 0,
                                .apiVersion = VK_API_VERSION_1_2};
    VkInstanceCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO;
    info.pApplicationInfo = &app;
    info.enabledExtensionCount = request.extension_count;
    info.ppEnabledExtensionNames = request.extensions;
    SR_CHECK(checked(vkCreateInstance(&info, nullptr, &instance_), "vkCreateInstance"));
    if (!request.make_surface)
        return {};
    return checked(request.make_surface(instance_, &surface_), "making the window's surface");
}

bool Gpu::find_family(VkPhysicalDevice physical)
{
    uint32_t count = 0;
    vkGetPhysicalDeviceQueueFamilyProperties(physical, &count, nullptr);
    std::vector<VkQueueFamilyProperties> families(count);
    vkGetPhysicalDeviceQueueFamilyProperties(physical, &count, families.data());
    const VkQueueFlags wanted = VK_QUEUE_GRAPHICS_BIT | VK_QUEUE_COMPUTE_BIT;
    for (family_ = 0; family_ < count; ++family_) {
        VkBool32 presents = surface_ == VK_NULL_HANDLE;
        if (surface_)
            vkGetPhysicalDeviceSurfaceSupportKHR(physical, family_, surface_, &presents);
        if ((families[family_].queueFlags & wanted) == wanted && presents)
            return true;
    }
    return false;
}

namespace {

// what the library lists, best first
Result<std::vector<sr_device_info>> listed_devices()
{
    std::vector<sr_device_info> devices(32);
    devices[0].struct_size = sizeof(sr_device_info);
    uint32_t count = uint32_t(devices.size());
    if (const sr_status status = sr_list_devices(devices.data(), &count); status != SR_ERR_PARTIAL)
        SR_CHECK(checked(status, static_cast<const sr_context*>(nullptr)));
    devices.resize(count);
    return devices;
}

bool is_asked_for(const sr_device_info& info, const std::string& asked)
{
    uint32_t index = 0;
    const auto [end, error] = std::from_chars(asked.data(), asked.data() + asked.size(), index);
    if (error == std::errc() && end == asked.data() + asked.size())
        return info.index == index;
    return std::string(info.name).find(asked) != std::string::npos;
}

Result<std::vector<VkPhysicalDevice>> physical_devices(VkInstance instance)
{
    uint32_t count = 0;
    SR_CHECK(checked(vkEnumeratePhysicalDevices(instance, &count, nullptr), "vkEnumeratePhysicalDevices"));
    std::vector<VkPhysicalDevice> devices(count);
    SR_CHECK(checked(vkEnumeratePhysicalDevices(instance, &count, devices.data()), "vkEnumeratePhysicalDevices"));
    return devices;
}

} // namespace

Status Gpu::pick_device(const std::string& asked)
{
    SR_TRY(const auto listed, listed_devices());
    SR_TRY(const auto devices, physical_devices(instance_));
    std::string found;
    for (const sr_device_info& info : listed) {
        found += (found.empty() ? "" : ", ") + printable(info.name);
        if (info.refusal[0] || !is_asked_for(info, asked))
            continue;
        for (VkPhysicalDevice physical : devices) {
            VkPhysicalDeviceProperties properties;
            vkGetPhysicalDeviceProperties(physical, &properties);
            if (std::string(properties.deviceName) == info.name && find_family(physical)) {
                physical_ = physical;
                return {};
            }
        }
    }
    return fail(ErrorCode::no_device, "no device{}{} that draws, computes{}; found: {}", asked.empty() ? "" : " ",
                asked.empty() ? "" : quote(asked), surface_ ? " and shows pictures in this window" : "",
                found.empty() ? "none" : found);
}

// with what the library needs enabled, and fp16 where it is there
Status Gpu::open_device()
{
    VkPhysicalDeviceVulkan12Features features{};
    features.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES;
    VkPhysicalDeviceFeatures2 all{};
    all.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2;
    all.pNext = &features;
    vkGetPhysicalDeviceFeatures2(physical_, &all);
    float16_ = features.shaderFloat16;
    features = {};
    features.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES;
    features.timelineSemaphore = VK_TRUE;
    features.shaderFloat16 = float16_;
    all.features = {};
    all.features.robustBufferAccess = VK_TRUE;

    const float priority = 1;
    VkDeviceQueueCreateInfo queue{};
    queue.sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO;
    queue.queueFamilyIndex = family_;
    queue.queueCount = 1;
    queue.pQueuePriorities = &priority;
    const char* swapchain = VK_KHR_SWAPCHAIN_EXTENSION_NAME;
    VkDeviceCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO;
    info.pNext = &all;
    info.queueCreateInfoCount = 1;
    info.pQueueCreateInfos = &queue;
    info.enabledExtensionCount = surface_ ? 1 : 0;
    info.ppEnabledExtensionNames = &swapchain;
    SR_CHECK(checked(vkCreateDevice(physical_, &info, nullptr, &device_), "vkCreateDevice"));
    vkGetDeviceQueue(device_, family_, 0, &queue_);

    VkCommandPoolCreateInfo pool{};
    pool.sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO;
    pool.flags = VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT;
    pool.queueFamilyIndex = family_;
    SR_CHECK(checked(vkCreateCommandPool(device_, &pool, nullptr, &pool_), "vkCreateCommandPool"));
    VkCommandBufferAllocateInfo commands{};
    commands.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO;
    commands.commandPool = pool_;
    commands.commandBufferCount = 1;
    SR_CHECK(checked(vkAllocateCommandBuffers(device_, &commands, &commands_), "vkAllocateCommandBuffers"));
    VkSemaphoreTypeCreateInfo type{};
    type.sType = VK_STRUCTURE_TYPE_SEMAPHORE_TYPE_CREATE_INFO;
    type.semaphoreType = VK_SEMAPHORE_TYPE_TIMELINE;
    VkSemaphoreCreateInfo semaphore{};
    semaphore.sType = VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO;
    semaphore.pNext = &type;
    return checked(vkCreateSemaphore(device_, &semaphore, nullptr, &timeline_), "vkCreateSemaphore");
}

Status Gpu::open_context(uint64_t max_bytes)
{
    sr_vulkan_device vulkan{};
    vulkan.struct_size = sizeof vulkan;
    vulkan.queue_family = family_;
    vulkan.instance = instance_;
    vulkan.physical_device = physical_;
    vulkan.device = device_;
    vulkan.queue = queue_;
    vulkan.shader_float16 = float16_;
    vulkan.robust_buffer_access = 1;
    sr_context_desc desc{};
    desc.struct_size = sizeof desc;
    desc.vulkan = &vulkan;
    desc.max_bytes = max_bytes;
    return checked(sr_context_create(&desc, &context_), static_cast<const sr_context*>(nullptr));
}

Status Gpu::run(const std::function<Status(VkCommandBuffer)>& record, VkSemaphore wait, VkSemaphore signal)
{
    VkCommandBufferBeginInfo begin{};
    begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
    SR_CHECK(checked(vkBeginCommandBuffer(commands_, &begin), "vkBeginCommandBuffer"));
    SR_CHECK(record(commands_));
    SR_CHECK(checked(vkEndCommandBuffer(commands_), "vkEndCommandBuffer"));
    const VkPipelineStageFlags stage = VK_PIPELINE_STAGE_ALL_COMMANDS_BIT;
    const uint64_t waited = 0, values[] = {++runs_, 0};
    const VkSemaphore signals[] = {timeline_, signal};
    VkTimelineSemaphoreSubmitInfo numbers{};
    numbers.sType = VK_STRUCTURE_TYPE_TIMELINE_SEMAPHORE_SUBMIT_INFO;
    numbers.waitSemaphoreValueCount = wait ? 1 : 0;
    numbers.pWaitSemaphoreValues = &waited;
    numbers.signalSemaphoreValueCount = signal ? 2 : 1;
    numbers.pSignalSemaphoreValues = values;
    VkSubmitInfo submit{};
    submit.sType = VK_STRUCTURE_TYPE_SUBMIT_INFO;
    submit.pNext = &numbers;
    submit.waitSemaphoreCount = wait ? 1 : 0;
    submit.pWaitSemaphores = &wait;
    submit.pWaitDstStageMask = &stage;
    submit.commandBufferCount = 1;
    submit.pCommandBuffers = &commands_;
    submit.signalSemaphoreCount = signal ? 2 : 1;
    submit.pSignalSemaphores = signals;
    SR_CHECK(checked(vkQueueSubmit(queue_, 1, &submit, VK_NULL_HANDLE), "vkQueueSubmit"));
    VkSemaphoreWaitInfo done{};
    done.sType = VK_STRUCTURE_TYPE_SEMAPHORE_WAIT_INFO;
    done.semaphoreCount = 1;
    done.pSemaphores = &timeline_;
    done.pValues = &runs_;
    return checked(vkWaitSemaphores(device_, &done, UINT64_MAX), "vkWaitSemaphores");
}

} // namespace semrover::view
