// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/device/device.h"

#include "runtime/base/diagnostics.h"
#include "runtime/device/command.h"
#include "runtime/device/cooperative_matrix.h"
#include "runtime/device/device_choice.h"
#include "runtime/device/device_fault.h"
#include "runtime/device/exportable.h"
#include "runtime/device/physical_device.h"
#include "runtime/device/pipeline.h"
#include "runtime/device/pipeline_statistics.h"
#include "runtime/device/profile.h"
#include "runtime/device/staging.h"
#include "runtime/graph/kernel.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>

namespace semrover {

namespace {

constexpr uint64_t kStagingBytes = 16ull << 20;
constexpr uint64_t kWaitNanoseconds = 600ull * 1000000000; // longer than any submit

std::string environment(const char* name)
{
    const char* value = std::getenv(name);
    return value ? value : "";
}

VKAPI_ATTR VkBool32 VKAPI_CALL on_validation(VkDebugUtilsMessageSeverityFlagBitsEXT, VkDebugUtilsMessageTypeFlagsEXT,
                                             const VkDebugUtilsMessengerCallbackDataEXT* data, void*)
{
    diagnose(fmt::format("validation: {}", data->pMessage));
    if (environment("SEMROVER_VALIDATION") == "fatal")
        std::abort();
    return VK_FALSE;
}

// points of timelines as a submit takes them
struct SemaphoreValues {
    std::vector<VkSemaphore> semaphores;
    std::vector<uint64_t> values;

    explicit SemaphoreValues(std::span<const TimelinePoint> points)
    {
        for (const TimelinePoint& p : points)
            add(p);
    }
    void add(const TimelinePoint& point)
    {
        semaphores.push_back(point.semaphore);
        values.push_back(point.value);
    }
    uint32_t count() const { return uint32_t(values.size()); }
};

} // namespace

Device::Device() = default;

Result<std::unique_ptr<Device>> Device::create(const DeviceOptions& options)
{
    std::unique_ptr<Device> d(new Device());
    d->take_allocation(options);
    SR_CHECK(d->create_instance(options));
    SR_TRY(const auto physical, physical_devices(d->vk_, d->instance_));
    std::vector<DeviceSummary> summaries;
    for (size_t i = 0; i < physical.size(); ++i)
        summaries.push_back(summarize(d->vk_, d->instance_, physical[i], uint32_t(i)));
    SR_TRY(d->index_, choose_device(summaries, options.select, options.require_gpu, std::getenv));
    d->physical_ = physical[d->index_];
    SR_CHECK(d->create_device(options, summaries[d->index_].limits.matrix.m != 0));
    SR_CHECK(d->finish(options));
    return d;
}

Result<std::unique_ptr<Device>> Device::adopt(const ExternalDevice& external, const DeviceOptions& options)
{
    if (!external.instance || !external.physical || !external.device || !external.queue)
        return fail(ErrorCode::usage,
                    "a device of the application's needs instance, physical device, device and queue");
    std::unique_ptr<Device> d(new Device());
    d->owned_ = false;
    d->take_allocation(options);
    SR_CHECK(d->vk_.load_instance(external.get_instance_proc_addr, external.instance));
    SR_CHECK(d->vk_.load_device(external.device));
    d->vk_.SetDebugUtilsObjectNameEXT = nullptr; // the application does not say whether it enabled debug names
    d->vk_.CmdBeginDebugUtilsLabelEXT = nullptr;
    d->vk_.CmdEndDebugUtilsLabelEXT = nullptr;
    if (!is_compute_family(d->vk_, external.physical, external.queue_family))
        return fail(ErrorCode::usage, "queue family {} of the application's device has no compute",
                    external.queue_family);
    if (external.work_queue && !is_compute_family(d->vk_, external.physical, external.work_queue_family))
        return fail(ErrorCode::usage, "family {} of the work queue of the application's device has no compute",
                    external.work_queue_family);
    if (!external.robust_buffer_access && !external.pipeline_robustness)
        return fail(ErrorCode::usage, "a device of the application's needs robustBufferAccess or pipelineRobustness, "
                                      "and to say so: files decide what shaders read");
    if (external.cooperative_matrix && !external.float16)
        return fail(ErrorCode::usage, "a device with cooperative matrices needs shaderFloat16, and to say so");
    if (bool(external.lock) != bool(external.unlock))
        return fail(ErrorCode::usage, "a device of the application's needs both of lock and unlock, or neither");
    if (bool(external.memory.allocate) != bool(external.memory.release))
        return fail(ErrorCode::usage,
                    "a device of the application's needs both of allocate_memory and free_memory, or neither");
    d->instance_ = external.instance;
    d->physical_ = external.physical;
    d->device_ = external.device;
    d->queue_ = d->beside_ = {external.queue, external.queue_family, external.lock, external.unlock};
    if (external.work_queue)
        d->queue_ = {external.work_queue, external.work_queue_family};
    d->memory_source_ = external.memory;
    d->exportable_ = external.exportable;
    d->pipeline_robustness_ = external.pipeline_robustness;
    SR_CHECK(d->finish(options));
    // what the hardware could do is not what the application enabled
    if (!external.cooperative_matrix)
        d->limits_.features &= ~uint32_t(kFeatureCooperativeMatrix);
    if (!external.float16)
        d->limits_.features &= ~uint32_t(kFeatureFloat16);
    return d;
}

Status Device::create_instance(const DeviceOptions& options)
{
    const bool validation = options.validation || !environment("SEMROVER_VALIDATION").empty();
    SR_TRY(instance_,
           vk_.allocator() ? semrover::create_instance(validation, vk_.allocator()) : process_instance(validation));
    SR_CHECK(vk_.load_instance(nullptr, instance_));
    if (!validation)
        return {};
    auto info = vk_struct<VkDebugUtilsMessengerCreateInfoEXT>(VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT);
    info.messageSeverity =
        VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT | VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT;
    info.messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT;
    info.pfnUserCallback = on_validation;
    const auto create = reinterpret_cast<PFN_vkCreateDebugUtilsMessengerEXT>(
        vk_.GetInstanceProcAddr(instance_, "vkCreateDebugUtilsMessengerEXT"));
    if (const VkResult result = create(instance_, &info, vk_.allocator(), &messenger_); result != VK_SUCCESS) {
        messenger_ = VK_NULL_HANDLE;
        return tl::make_unexpected(vk_error(result, "vkCreateDebugUtilsMessengerEXT"));
    }
    return {};
}

Status Device::create_device(const DeviceOptions& options, bool matrices)
{
    SR_TRY(queue_.family, compute_queue_family(vk_, physical_));
    const float priority = 1;
    auto queue = vk_struct<VkDeviceQueueCreateInfo>(VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO);
    queue.queueFamilyIndex = queue_.family;
    queue.queueCount = 1;
    queue.pQueuePriorities = &priority;
    auto have = vk_struct<VkPhysicalDeviceVulkan12Features>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES);
    auto available = vk_struct<VkPhysicalDeviceFeatures2>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, &have);
    vk_.GetPhysicalDeviceFeatures2(physical_, &available);
    auto f12 = vk_struct<VkPhysicalDeviceVulkan12Features>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES);
    f12.timelineSemaphore = VK_TRUE;
    f12.shaderFloat16 = have.shaderFloat16;
    auto features = vk_struct<VkPhysicalDeviceFeatures2>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, &f12);
    std::vector<const char*> extensions;
    // gathers use indices that came from files: out of bounds must not leave the buffer
    auto robust = vk_struct<VkPhysicalDevicePipelineRobustnessFeaturesEXT>(
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PIPELINE_ROBUSTNESS_FEATURES_EXT);
    pipeline_robustness_ = has_pipeline_robustness(vk_, physical_);
    if (pipeline_robustness_) {
        robust.pipelineRobustness = VK_TRUE;
        robust.pNext = std::exchange(features.pNext, &robust);
        extensions.push_back(VK_EXT_PIPELINE_ROBUSTNESS_EXTENSION_NAME);
    } else {
        features.features.robustBufferAccess = available.features.robustBufferAccess;
    }
    if (has_extension(vk_, physical_, "VK_KHR_portability_subset")) // must be enabled where there is one: MoltenVK's
        extensions.push_back("VK_KHR_portability_subset");
    if (options.share_by_fd) {
        exportable_ = exportable_of(vk_, physical_);
        if (exportable_.memory)
            extensions.push_back(VK_KHR_EXTERNAL_MEMORY_FD_EXTENSION_NAME);
        if (exportable_.semaphores)
            extensions.push_back(VK_KHR_EXTERNAL_SEMAPHORE_FD_EXTENSION_NAME);
    }
    auto faults = vk_struct<VkPhysicalDeviceFaultFeaturesEXT>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FAULT_FEATURES_EXT);
    if (tells_faults(vk_, physical_)) {
        faults.deviceFault = VK_TRUE;
        faults.pNext = std::exchange(features.pNext, &faults);
        extensions.push_back(VK_EXT_DEVICE_FAULT_EXTENSION_NAME);
    }
    auto statistics = vk_struct<VkPhysicalDevicePipelineExecutablePropertiesFeaturesKHR>(
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PIPELINE_EXECUTABLE_PROPERTIES_FEATURES_KHR);
    pipeline_statistics_ = options.pipeline_statistics && has_pipeline_statistics(vk_, physical_);
    if (pipeline_statistics_) {
        statistics.pipelineExecutableInfo = VK_TRUE;
        statistics.pNext = std::exchange(features.pNext, &statistics);
        extensions.push_back(VK_KHR_PIPELINE_EXECUTABLE_PROPERTIES_EXTENSION_NAME);
    }
    MatrixFeatures matrix;
    if (matrices) {
        f12.vulkanMemoryModel = VK_TRUE;
        f12.vulkanMemoryModelDeviceScope = VK_TRUE; // once there is a memory model, atomics of any shader need it
        f12.pNext = matrix.chain();
        extensions.insert(extensions.end(),
                          {VK_KHR_COOPERATIVE_MATRIX_EXTENSION_NAME, VK_EXT_SUBGROUP_SIZE_CONTROL_EXTENSION_NAME});
    }
    auto info = vk_struct<VkDeviceCreateInfo>(VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO, &features);
    info.queueCreateInfoCount = 1;
    info.pQueueCreateInfos = &queue;
    info.enabledExtensionCount = uint32_t(extensions.size());
    info.ppEnabledExtensionNames = extensions.data();
    SR_VK_MAKE(device_, vk_.CreateDevice(physical_, &info, vk_.allocator(), &device_));
    SR_CHECK(vk_.load_device(device_));
    vk_.GetDeviceQueue(device_, queue_.family, 0, &queue_.queue);
    beside_ = queue_;
    return {};
}

void Device::take_allocation(const DeviceOptions& options)
{
    if (options.allocation)
        vk_.allocation = *options.allocation;
}

Status Device::check_cancelled() const
{
    if (cancelled_ && cancelled_())
        return fail(ErrorCode::interrupted, "interrupted");
    return {};
}

Status Device::finish(const DeviceOptions& options)
{
    const DeviceSummary summary = summarize(vk_, instance_, physical_, 0);
    if (!summary.refusal.empty())
        return fail(ErrorCode::no_device, "device '{}' cannot be used: {}", summary.name, summary.refusal);
    name_ = summary.name;
    driver_ = summary.driver;
    limits_ = summary.limits;
    const Exportable can = exportable_of(vk_, physical_); // an application may have enabled what cannot be exported
    exportable_.memory = exportable_.memory && can.memory && vk_.GetMemoryFdKHR;
    exportable_.semaphores = exportable_.semaphores && can.semaphores && vk_.GetSemaphoreFdKHR;
    budget_ = options.max_bytes;
    cancelled_ = options.cancelled;
    autotunes_ = options.autotune;
    if (owned_)
        SR_CHECK(override_limits(limits_, environment("SEMROVER_LIMITS")));
    SR_CHECK(override_limits(limits_, options.limits));
    VkPhysicalDeviceProperties properties;
    vk_.GetPhysicalDeviceProperties(physical_, &properties);
    timestamp_ns_ = has_timestamps(vk_, physical_, queue_.family) ? properties.limits.timestampPeriod : 0;
    families_ = {queue_.family};
    if (beside_.family != queue_.family)
        families_.push_back(beside_.family);
    SR_CHECK(make_objects());
    SR_TRY(pipelines_, PipelineStore::create(*this, options.pipeline_cache));
    return {};
}

Result<std::unique_ptr<Device>> Device::beside(Device& first)
{
    std::unique_ptr<Device> d(new Device());
    d->owned_ = false;
    d->vk_ = first.vk_;
    d->instance_ = first.instance_;
    d->physical_ = first.physical_;
    d->device_ = first.device_;
    d->queue_ = first.beside_;
    d->beside_ = first.queue_;
    d->families_ = first.families_;
    d->index_ = first.index_;
    d->exportable_ = first.exportable_;
    d->pipeline_robustness_ = first.pipeline_robustness_;
    d->pipeline_statistics_ = first.pipeline_statistics_;
    d->memory_source_ = first.memory_source_;
    d->cancelled_ = first.cancelled_;
    d->limits_ = first.limits_;
    d->autotunes_ = false; // what it chose would not be kept
    d->name_ = first.name_;
    d->driver_ = first.driver_;
    d->timestamp_ns_ = has_timestamps(d->vk_, d->physical_, d->queue_.family) ? first.timestamp_ns_ : 0;
    d->memory_ = first.memory_;
    d->budget_ = first.budget_;
    SR_CHECK(d->make_objects());
    d->pipelines_ = PipelineStore::beside(*d, *first.pipelines_);
    return d;
}

Status Device::make_objects()
{
    auto type = vk_struct<VkSemaphoreTypeCreateInfo>(VK_STRUCTURE_TYPE_SEMAPHORE_TYPE_CREATE_INFO);
    type.semaphoreType = VK_SEMAPHORE_TYPE_TIMELINE;
    auto semaphore = vk_struct<VkSemaphoreCreateInfo>(VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO, &type);
    SR_VK_MAKE(timeline_, vk_.CreateSemaphore(device_, &semaphore, vk_.allocator(), &timeline_));
    return {};
}

Device::~Device()
{
    if (device_ && timeline_)
        (void)wait(ticket_); // a lost device has nothing left to wait for
    pipelines_.reset();
    staging_.reset();
    if (timeline_)
        vk_.DestroySemaphore(device_, timeline_, vk_.allocator());
    if (!owned_)
        return;
    if (device_)
        vk_.DestroyDevice(device_, vk_.allocator());
    if (messenger_)
        reinterpret_cast<PFN_vkDestroyDebugUtilsMessengerEXT>(vk_.GetInstanceProcAddr(
            instance_, "vkDestroyDebugUtilsMessengerEXT"))(instance_, messenger_, vk_.allocator());
    if (instance_ && vk_.allocator()) // else the process keeps it
        vk_.DestroyInstance(instance_, vk_.allocator());
}

Status Device::account(uint64_t bytes, const char* what)
{
    const uint64_t used = memory_->used += bytes;
    if (budget_ && used > budget_) {
        memory_->used -= bytes;
        return fail(ErrorCode::out_of_memory, "{}: {} bytes do not fit: {} in use, `max_bytes` {}", what, bytes,
                    used - bytes, budget_);
    }
    for (uint64_t peak = memory_->peak; peak < used && !memory_->peak.compare_exchange_weak(peak, used);)
        ;
    return {};
}

Result<uint64_t> Device::submit(std::span<const VkCommandBuffer> commands, const TimelinePoints& points)
{
    const std::lock_guard guard(*queue_.mutex);
    const uint64_t value = ticket_ + 1;
    SemaphoreValues waits(points.waits), signals(points.signals);
    signals.add({timeline_, value});
    auto timeline = vk_struct<VkTimelineSemaphoreSubmitInfo>(VK_STRUCTURE_TYPE_TIMELINE_SEMAPHORE_SUBMIT_INFO);
    timeline.waitSemaphoreValueCount = waits.count();
    timeline.pWaitSemaphoreValues = waits.values.data();
    timeline.signalSemaphoreValueCount = signals.count();
    timeline.pSignalSemaphoreValues = signals.values.data();
    const std::vector<VkPipelineStageFlags> stages(waits.count(), VK_PIPELINE_STAGE_ALL_COMMANDS_BIT);
    auto info = vk_struct<VkSubmitInfo>(VK_STRUCTURE_TYPE_SUBMIT_INFO, &timeline);
    info.waitSemaphoreCount = waits.count();
    info.pWaitSemaphores = waits.semaphores.data();
    info.pWaitDstStageMask = stages.data();
    info.commandBufferCount = uint32_t(commands.size());
    info.pCommandBuffers = commands.data();
    info.signalSemaphoreCount = signals.count();
    info.pSignalSemaphores = signals.semaphores.data();
    if (queue_.lock)
        queue_.lock();
    const VkResult result = vk_.QueueSubmit(queue_.queue, 1, &info, VK_NULL_HANDLE);
    if (queue_.unlock)
        queue_.unlock();
    if (result != VK_SUCCESS)
        return tl::make_unexpected(device_error(vk_, device_, result, "vkQueueSubmit"));
    return ticket_ = value;
}

Status Device::wait(uint64_t ticket)
{
    auto info = vk_struct<VkSemaphoreWaitInfo>(VK_STRUCTURE_TYPE_SEMAPHORE_WAIT_INFO);
    info.semaphoreCount = 1;
    info.pSemaphores = &timeline_;
    info.pValues = &ticket;
    const VkResult result = vk_.WaitSemaphores(device_, &info, kWaitNanoseconds);
    if (result == VK_TIMEOUT)
        return fail(ErrorCode::device_lost, "device '{}' did not finish a submit within {} s", name_,
                    kWaitNanoseconds / 1000000000);
    if (result != VK_SUCCESS)
        return tl::make_unexpected(device_error(vk_, device_, result, "vkWaitSemaphores"));
    return {};
}

Result<bool> Device::finished(uint64_t ticket) const
{
    return reached({timeline_, ticket});
}

Result<bool> Device::reached(const TimelinePoint& point) const
{
    uint64_t value = 0;
    SR_VK(vk_.GetSemaphoreCounterValue(device_, point.semaphore, &value));
    return value >= point.value;
}

Result<Staging*> Device::staging()
{
    if (!staging_) {
        SR_TRY(staging_, Staging::create(*this, std::min(kStagingBytes, limits_.max_allocation)));
    }
    return staging_.get();
}

Status Device::write(const BufferSlice& to, std::span<const std::byte> bytes)
{
    SR_ASSERT(bytes.size() <= to.bytes, "{} bytes written to a slice of {}", bytes.size(), to.bytes);
    SR_CHECK(wait(ticket_));
    host_bytes_.written += bytes.size();
    if (std::byte* mapped = to.buffer->mapped()) {
        if (!bytes.empty())
            std::memcpy(mapped + to.offset, bytes.data(), bytes.size());
        return {};
    }
    SR_TRY(Staging * window, staging());
    SR_CHECK(window->write(to, bytes));
    return wait(ticket_);
}

uint64_t Device::most_room() const
{
    return std::min(kStagingBytes, limits_.max_allocation) / 2;
}

Result<std::span<std::byte>> Device::room(const BufferSlice& to)
{
    host_bytes_.written += to.bytes;
    if (std::byte* mapped = to.buffer->mapped())
        return std::span(mapped + to.offset, to.bytes);
    SR_TRY(Staging * window, staging());
    return window->room(to);
}

Status Device::finish_writes()
{
    if (staging_)
        SR_CHECK(staging_->flush());
    return wait(ticket_);
}

void Device::drop_writes()
{
    if (staging_)
        staging_->drop();
}

Status Device::read(const BufferSlice& from, std::span<std::byte> bytes)
{
    SR_ASSERT(bytes.size() <= from.bytes, "{} bytes read from a slice of {}", bytes.size(), from.bytes);
    const BufferSlice some = from.part(0, bytes.size());
    return read({&some, 1}, [&](const ReadPiece& piece) {
        std::memcpy(bytes.data() + piece.at, piece.bytes.data(), piece.bytes.size());
    });
}

Status Device::read(std::span<const BufferSlice> from, const PieceSink& sink)
{
    SR_CHECK(wait(ticket_));
    bool cached = true;
    for (const BufferSlice& slice : from) {
        host_bytes_.read += slice.bytes;
        cached = cached && slice.buffer->mapped() && slice.buffer->cached();
    }
    if (!cached) {
        SR_TRY(Staging * window, staging());
        return window->read(from, sink);
    }
    for (size_t i = 0; i < from.size(); ++i)
        if (from[i].bytes)
            sink({i, 0, {from[i].buffer->mapped() + from[i].offset, from[i].bytes}});
    return {};
}

Status Device::clear(const BufferSlice& slice)
{
    SR_CHECK(wait(ticket_));
    if (std::byte* mapped = slice.buffer->mapped()) {
        std::memset(mapped + slice.offset, 0, slice.bytes);
        return {};
    }
    SR_TRY(Staging * window, staging());
    SR_CHECK(window->clear(slice));
    return wait(ticket_);
}

} // namespace semrover
