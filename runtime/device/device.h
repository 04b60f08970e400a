// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/device/memory.h"
#include "runtime/device/vulkan_calls.h"
#include "runtime/graph/autotuner.h"
#include "runtime/graph/cost_model.h"
#include "runtime/graph/limits.h"

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

namespace semrover {

class PipelineStore;
class Profile;
class Staging;

struct DeviceOptions {
    std::string select = {};  // choose_device()
    bool require_gpu = false; // no_device rather than a CPU
    std::string limits = {};  // override_limits(); also from SEMROVER_LIMITS
    uint64_t max_bytes = 0;   // refuse to allocate more device memory than this; 0: no budget
    // Asked before a pipeline is compiled and before work is submitted; true: those calls fail with
    // ErrorCode::interrupted. From any thread that uses the device.
    std::function<bool()> cancelled = {};
    bool validation = false; // Khronos validation with synchronization checks; also SEMROVER_VALIDATION=1 or =fatal
    // PipelineStore::blob() of an earlier process, read while the device is made; with an application's device, or with
    // a blob, no file is kept
    std::span<const std::byte> pipeline_cache = {};
    // for every Vulkan object, read while the device is made; null: the driver's own
    const VkAllocationCallbacks* allocation = nullptr;
    bool autotune = true;             // executables try alternatives in their first runs, where a device has a watchdog
    bool pipeline_statistics = false; // pipelines keep what the driver says of their code, where it does, for a Profile
    bool share_by_fd =
        false; // enables what Exportable needs, where there is it; an application's device says what it has
};

// what other APIs can be given by file descriptor
struct Exportable {
    bool memory = false, semaphores = false;
};

// A device that belongs to the application; it outlives the engine. No file is kept and no variable of the environment
// read for it.
struct ExternalDevice {
    PFN_vkGetInstanceProcAddr get_instance_proc_addr = nullptr; // its way to Vulkan; null: the loader's
    VkInstance instance = VK_NULL_HANDLE;
    VkPhysicalDevice physical = VK_NULL_HANDLE;
    VkDevice device = VK_NULL_HANDLE; // Vulkan 1.2 with timelineSemaphore enabled
    VkQueue queue = VK_NULL_HANDLE;   // with compute
    uint32_t queue_family = 0;
    VkQueue work_queue = VK_NULL_HANDLE; // another one, that nobody else uses: beside() has `queue` then. None: `queue`
    uint32_t work_queue_family = 0;
    // one of them is enabled, as it must be: files decide what is read
    bool robust_buffer_access = false;            // for all shaders of the device
    bool pipeline_robustness = false;             // VK_EXT_pipeline_robustness: for ours
    bool float16 = false;                         // shaderFloat16 is enabled too
    bool cooperative_matrix = false;              // and MatrixFeatures, with the memory model for all of the device
    std::function<void()> lock = {}, unlock = {}; // around every use of `queue`; may be empty
    Exportable exportable = {};                   // its extensions are enabled
    MemorySource memory = {};                     // instead of vkAllocateMemory
};

// A value of a timeline semaphore: to wait for before a submit begins, or to signal when it has ended.
struct TimelinePoint {
    VkSemaphore semaphore = VK_NULL_HANDLE;
    uint64_t value = 0;
};
struct TimelinePoints {
    std::vector<TimelinePoint> waits, signals;
};

// some bytes of one of the slices that are read
struct ReadPiece {
    size_t slice = 0; // which of them
    uint64_t at = 0;  // where in it they begin, a multiple of 16
    std::span<const std::byte> bytes;
};
using PieceSink = std::function<void(const ReadPiece&)>;

// bytes that crossed the border between host and device: to the host, from the host
struct HostBytes {
    uint64_t read = 0, written = 0;
};

struct DeviceSummary {
    uint32_t index = 0;
    std::string name, driver, type, api;
    std::string uuid;          // 8-4-4-4-12 hexadecimal digits; NVIDIA's tools write GPU- before it
    std::string pci;           // "0000:3b:00.0"; empty where the driver does not say
    uint32_t vendor = 0;       // as PCI has it: 0x10de is NVIDIA
    uint64_t memory_bytes = 0; // largest device-local heap
    DeviceLimits limits;
    std::vector<std::string> extensions; // the optional ones that matter: cooperative matrices and the like
    std::string refusal;                 // why the engine cannot run on it; empty if it can
};

// A queue of a device, its memory, and what is kept for both. By one thread at a time; see beside().
class Device {
  public:
    static Result<std::unique_ptr<Device>> create(const DeviceOptions& options);
    static Result<std::unique_ptr<Device>> adopt(const ExternalDevice& external, const DeviceOptions& options);
    // The same device for another thread: with tickets, copies and pipelines of its own, on the application's `queue`.
    // What is allocated counts together, and one may read the other's memory. `first` outlives it.
    static Result<std::unique_ptr<Device>> beside(Device& first);
    ~Device();
    Device(const Device&) = delete;
    Device& operator=(const Device&) = delete;

    const DeviceLimits& limits() const { return limits_; }
    const std::string& name() const { return name_; }
    const std::string& driver() const { return driver_; }
    uint32_t index() const { return index_; } // in list_devices(); 0 for an application's
    VkDevice handle() const { return device_; }
    const VulkanCalls& vk() const { return vk_; }
    bool owned() const { return owned_; }                             // not an application's
    bool pipeline_robustness() const { return pipeline_robustness_; } // pipelines ask for it, and the device does not
    bool pipeline_statistics() const { return pipeline_statistics_; } // pipelines capture them
    VkInstance instance() const { return instance_; }
    VkPhysicalDevice physical() const { return physical_; }
    uint32_t queue_family() const { return queue_.family; }
    // of all queues that use its memory: one, or two
    const std::vector<uint32_t>& families() const { return families_; }
    double timestamp_ns() const { return timestamp_ns_; } // of a unit; 0: the queue has none
    const Exportable& exportable() const { return exportable_; }
    const MemorySource& memory_source() const { return memory_source_; }
    CostModel& costs() { return costs_; }
    TuningCache& tuning() { return tuning_; } // kept with the pipeline cache
    bool autotunes() const { return autotunes_; }
    PipelineStore& pipelines() { return *pipelines_; }

    // synchronous copies, after everything submitted so far; through staging where the host cannot see the memory
    Status write(const BufferSlice& to, std::span<const std::byte> bytes);
    // The same piecewise, for memory that nothing has used yet: where the caller puts all of `to`, of most_room() bytes
    // at most, until the next call. Waits for nothing but room; finish_writes() for all of it. drop_writes(): what was
    // put and not finished is not written.
    Result<std::span<std::byte>> room(const BufferSlice& to);
    uint64_t most_room() const;
    Status finish_writes();
    void drop_writes();
    Status read(const BufferSlice& from, std::span<std::byte> bytes);
    // Hands the slices to the sink, one after the other, in pieces that are good until it returns. The sink takes them
    // from memory that the device wrote, so this saves a copy, and the device copies the next piece meanwhile.
    Status read(std::span<const BufferSlice> from, const PieceSink& sink);
    Status clear(const BufferSlice& slice);
    // what went through them, and through rings of read-backs
    const HostBytes& host_bytes() const { return host_bytes_; }
    void count_read(uint64_t bytes) { host_bytes_.read += bytes; }

    Status check_cancelled() const; // interrupted, where DeviceOptions::cancelled says so

    // queue: a ticket is a value of one timeline semaphore
    Result<uint64_t> submit(std::span<const VkCommandBuffer> commands, const TimelinePoints& points = {});
    Status wait(uint64_t ticket);
    Result<bool> finished(uint64_t ticket) const; // without waiting
    uint64_t last_ticket() const { return ticket_; }
    TimelinePoint next_point() const { return {timeline_, ticket_ + 1}; } // that the next submit reaches
    Result<bool> reached(const TimelinePoint& point) const;               // of any timeline, without waiting

    // device memory in use, counted at allocation; from any thread
    Status account(uint64_t bytes, const char* what);
    void release(uint64_t bytes) { memory_->used -= bytes; }
    uint64_t allocated_bytes() const { return memory_->used; }
    uint64_t peak_bytes() const { return memory_->peak; }
    void reset_peak() { memory_->peak = memory_->used.load(); }
    uint64_t budget() const { return budget_; }

    void set_profile(std::shared_ptr<Profile> profile) { profile_ = std::move(profile); }
    Profile* profile() { return profile_.get(); }

  private:
    struct Queue {
        VkQueue queue = VK_NULL_HANDLE;
        uint32_t family = 0;
        std::function<void()> lock = {}, unlock = {};
        std::shared_ptr<std::mutex> mutex = std::make_shared<std::mutex>();
    };
    struct MemoryCount {
        std::atomic<uint64_t> used = 0, peak = 0;
    };
    Device();
    void take_allocation(const DeviceOptions& options);
    Status create_instance(const DeviceOptions& options);
    Status create_device(const DeviceOptions& options, bool matrices); // enables cooperative matrices
    Status finish(const DeviceOptions& options);
    Status make_objects(); // that each thread has its own of
    Result<Staging*> staging();

    VulkanCalls vk_;
    VkInstance instance_ = VK_NULL_HANDLE;
    VkDebugUtilsMessengerEXT messenger_ = VK_NULL_HANDLE;
    VkPhysicalDevice physical_ = VK_NULL_HANDLE;
    VkDevice device_ = VK_NULL_HANDLE;
    Queue queue_, beside_; // ours, and that of beside(): maybe the same
    std::vector<uint32_t> families_;
    uint32_t index_ = 0;
    bool owned_ = true;
    bool pipeline_robustness_ = false;
    bool pipeline_statistics_ = false;
    Exportable exportable_;
    MemorySource memory_source_;
    std::function<bool()> cancelled_;
    VkSemaphore timeline_ = VK_NULL_HANDLE;
    uint64_t ticket_ = 0;
    std::unique_ptr<Staging> staging_;
    std::unique_ptr<PipelineStore> pipelines_;
    std::shared_ptr<Profile> profile_;
    HostBytes host_bytes_;
    DeviceLimits limits_;
    CostModel costs_;
    TuningCache tuning_;
    bool autotunes_ = true;
    std::string name_, driver_;
    double timestamp_ns_ = 1;
    std::shared_ptr<MemoryCount> memory_ = std::make_shared<MemoryCount>();
    uint64_t budget_ = 0;
};

// all physical devices, best first (discrete > integrated > other > CPU, then the loader's order)
Result<std::vector<DeviceSummary>> list_devices();

} // namespace semrover
