// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// devices and contexts
#include "engine/capi/call.h"
#include "engine/capi/handles.h"
#include "runtime/base/diagnostics.h"
#include "runtime/device/physical_device.h"
#include "runtime/device/pipeline.h"

using namespace semrover;
using namespace semrover::capi;

namespace {

// of calls without a context; a thread sees its own
thread_local std::string thread_error;

sr_device_info info_of(const DeviceSummary& d)
{
    sr_device_info info{};
    info.index = d.index;
    info.memory_bytes = d.memory_bytes;
    copy_text(info.name, d.name);
    copy_text(info.driver, d.driver);
    copy_text(info.refusal, d.refusal);
    copy_text(info.type, d.type);
    copy_text(info.api, d.api);
    return info;
}

// the application's allocator as Buffer calls it
MemorySource memory_source(const sr_vulkan_device& v)
{
    MemorySource source;
    if (v.allocate_memory)
        source.allocate = [=](const MemoryRequest& r) -> Result<MemoryPiece> {
            const sr_memory_request request{sizeof request, r.type, r.bytes, r.alignment, r.mapped, 0};
            sr_memory_piece piece{};
            if (const sr_status status = v.allocate_memory(v.user, &request, &piece); status != SR_OK)
                return fail(ErrorCode(status), "the application's allocator returned {}", sr_status_name(status));
            return MemoryPiece{piece.memory, piece.offset, piece.mapped, piece.handle};
        };
    if (v.free_memory)
        source.release = [=](const MemoryPiece& p) {
            const sr_memory_piece piece{p.memory, p.offset, p.mapped, p.handle};
            v.free_memory(v.user, &piece);
        };
    return source;
}

Result<std::unique_ptr<Device>> adopt(const sr_vulkan_device& v, const DeviceOptions& options)
{
    if (v.reserved)
        return fail(ErrorCode::usage, "sr_vulkan_device: reserved is not 0");
    ExternalDevice external;
    external.get_instance_proc_addr = v.get_instance_proc_addr;
    external.instance = v.instance;
    external.physical = v.physical_device;
    external.device = v.device;
    external.queue = v.queue;
    external.queue_family = v.queue_family;
    external.work_queue = v.work_queue;
    external.work_queue_family = v.work_queue_family;
    external.float16 = v.shader_float16;
    external.cooperative_matrix = v.cooperative_matrix;
    external.robust_buffer_access = v.robust_buffer_access == 1;
    external.pipeline_robustness = v.pipeline_robustness == 1;
    external.exportable = {v.external_memory_fd == 1, v.external_semaphore_fd == 1};
    external.memory = memory_source(v);
    if (v.lock_queue)
        external.lock = [=] { v.lock_queue(v.user); };
    if (v.unlock_queue)
        external.unlock = [=] { v.unlock_queue(v.user); };
    return Device::adopt(external, options);
}

Result<std::unique_ptr<sr_context>> make_context(const sr_context_desc& desc)
{
    DeviceOptions options;
    options.max_bytes = desc.max_bytes;
    options.validation = desc.validation;
    options.select = desc.device ? desc.device : "";
    options.allocation = desc.allocation_callbacks;
    options.share_by_fd = desc.share_by_fd == 1;
    if (desc.share_by_fd > 1 || desc.reserved)
        return fail(ErrorCode::usage, "sr_context_desc: share_by_fd is 0 or 1, reserved 0");
    if (!desc.pipeline_cache != !desc.pipeline_cache_bytes)
        return fail(ErrorCode::usage, "sr_context_desc: pipeline_cache and its bytes come together");
    options.pipeline_cache = {static_cast<const std::byte*>(desc.pipeline_cache), size_t(desc.pipeline_cache_bytes)};
    auto context = std::make_unique<sr_context>();
    if (desc.vulkan) {
        if (desc.device || desc.validation || desc.share_by_fd)
            return fail(
                ErrorCode::usage,
                "sr_context_desc: device, validation and share_by_fd do not go with a device of the application's");
        SR_TRY(const sr_vulkan_device vulkan, read_struct(desc.vulkan, "sr_vulkan_device"));
        SR_TRY(context->device, adopt(vulkan, options));
    } else {
        SR_TRY(context->device, Device::create(options));
    }
    SR_TRY(context->drawing, Device::beside(*context->device));
    context->summary = summarize(context->device->vk(), context->device->instance(), context->device->physical(),
                                 context->device->index());
    return context;
}

Status list(sr_device_info* devices, uint32_t& count)
{
    SR_TRY(const auto all, list_devices());
    const uint32_t room = count;
    count = uint32_t(all.size());
    if (!devices)
        return {};
    const uint32_t stride = devices->struct_size;
    if (room && stride < 8)
        return fail(ErrorCode::usage, "sr_list_devices: struct_size of the first element is not set");
    count = std::min(room, count);
    for (uint32_t i = 0; i < count; ++i) {
        char* to = reinterpret_cast<char*>(devices) + size_t(i) * stride;
        write_struct(info_of(all[i]), to, stride);
        std::memcpy(to, &stride, 4);
    }
    if (count < all.size())
        return fail(ErrorCode::partial, "sr_list_devices: {} devices, room for {}", all.size(), room);
    return {};
}

} // namespace

namespace semrover::capi {

namespace {

thread_local const Turn* innermost = nullptr;

}

Turn::Turn(sr_context* context, Use use) noexcept : context_(context), use_(use)
{
    for (const Turn* outer = innermost; context && outer; outer = outer->outer_)
        if (outer->context_ == context)
            return;
    uint32_t now = context ? context->in_use.load() : 0;
    while (context && !(now & use) && !context->in_use.compare_exchange_weak(now, now | use)) {
    }
    taken_ = !(now & use);
    if (taken_)
        outer_ = std::exchange(innermost, this);
}

Turn::~Turn()
{
    if (!taken_)
        return;
    innermost = outer_;
    if (context_)
        context_->in_use &= ~uint32_t(use_);
}

sr_status Turn::refuse() noexcept
{
    return remember(nullptr, SR_ERR_USAGE,
                    line_of("another call is at work with this context: of another thread, or the one "
                            "whose callback this is"));
}

std::string line_of(const char* text) noexcept
{
    try {
        return text;
    } catch (const std::bad_alloc&) {
        return kNoHostMemory;
    }
}

sr_status remember(sr_context* context, sr_status status, std::string message) noexcept
{
    if (!context) {
        thread_error = std::move(message);
        return status;
    }
    const std::lock_guard lock(context->error_mutex);
    context->error = std::move(message);
    return status;
}

} // namespace semrover::capi

extern "C" {

uint32_t sr_abi_version(void)
{
    return SR_ABI_VERSION;
}

const char* sr_version(void)
{
    return SEMROVER_VERSION;
}

const char* sr_status_name(sr_status status)
{
    switch (status) {
    case SR_OK:
        return "SR_OK";
    case SR_ERR_USAGE:
        return "SR_ERR_USAGE";
    case SR_ERR_BAD_INPUT:
        return "SR_ERR_BAD_INPUT";
    case SR_ERR_NO_DEVICE:
        return "SR_ERR_NO_DEVICE";
    case SR_ERR_OUT_OF_MEMORY:
        return "SR_ERR_OUT_OF_MEMORY";
    case SR_ERR_DEVICE_LOST:
        return "SR_ERR_DEVICE_LOST";
    case SR_ERR_PARTIAL:
        return "SR_ERR_PARTIAL";
    case SR_NOT_YET:
        return "SR_NOT_YET";
    case SR_ERR_INTERNAL:
        return "SR_ERR_INTERNAL";
    case SR_ERR_INTERRUPTED:
        return "SR_ERR_INTERRUPTED";
    default:
        return "unknown";
    }
}

size_t sr_last_error(const sr_context* context, char* buffer, size_t size)
{
    std::unique_lock<std::mutex> lock;
    if (context)
        lock = std::unique_lock(context->error_mutex);
    const std::string& text = context ? context->error : thread_error;
    if (buffer && size) {
        const size_t count = std::min(text.size(), size - 1);
        std::memcpy(buffer, text.data(), count);
        buffer[count] = 0;
    }
    return text.size();
}

void sr_set_diagnostic_callback(void (*callback)(void* user, const char* line), void* user)
{
    set_diagnostic_callback(callback, user);
}

sr_status sr_list_devices(sr_device_info* devices, uint32_t* count)
{
    return guarded(nullptr, [&]() -> Status {
        if (!count)
            return fail(ErrorCode::usage, "sr_list_devices: count is NULL");
        return list(devices, *count);
    });
}

sr_status sr_context_create(const sr_context_desc* desc, sr_context** context)
{
    return guarded(nullptr, [&]() -> Status {
        if (!context)
            return fail(ErrorCode::usage, "sr_context_create: context is NULL");
        *context = nullptr;
        sr_context_desc known{};
        if (desc) {
            SR_TRY(known, read_struct(desc, "sr_context_desc"));
        }
        SR_TRY(auto made, make_context(known));
        *context = made.release();
        return {};
    });
}

void sr_context_destroy(sr_context* context)
{
    bool alone = !context;
    if (context)
        alone = Turn(context, kAlone).taken();
    if (alone)
        delete context;
    else
        Turn::refuse();
}

sr_status sr_context_get_device(sr_context* context, sr_device_info* device)
{
    return guarded<kAnyTime>(context, [&]() -> Status {
        if (!context || !device || device->struct_size < 8)
            return fail(ErrorCode::usage, "sr_context_get_device: NULL, or struct_size is not set");
        write_struct(info_of(context->summary), device, device->struct_size);
        return {};
    });
}

sr_status sr_context_get_memory(sr_context* context, sr_memory_info* memory)
{
    return guarded<kAnyTime>(context, [&]() -> Status {
        if (!context || !memory || memory->struct_size < 8)
            return fail(ErrorCode::usage, "sr_context_get_memory: NULL, or struct_size is not set");
        sr_memory_info info{};
        info.used_bytes = context->device->allocated_bytes();
        info.peak_bytes = context->device->peak_bytes();
        info.budget_bytes = context->device->budget();
        write_struct(info, memory, memory->struct_size);
        return {};
    });
}

sr_status sr_context_get_pipeline_cache(sr_context* context, void* data, uint64_t* bytes)
{
    return guarded(context, [&]() -> Status {
        if (!context || !bytes)
            return fail(ErrorCode::usage, "sr_context_get_pipeline_cache: NULL");
        SR_TRY(const std::vector<char> blob, context->device->pipelines().blob());
        const uint64_t room = std::exchange(*bytes, blob.size());
        if (!data)
            return {};
        if (room < blob.size())
            return fail(ErrorCode::partial, "sr_context_get_pipeline_cache: {} bytes, room for {}", blob.size(), room);
        std::memcpy(data, blob.data(), blob.size());
        return {};
    });
}

} // extern "C"

// "0.1.0" as SR_VERSION has it
static constexpr uint32_t number_of(std::string_view version)
{
    uint32_t number = 0, part = 0;
    for (const char c : version)
        if (c == '.')
            number = (number + std::exchange(part, 0)) * 100;
        else
            part = part * 10 + uint32_t(c - '0');
    return number + part;
}
static_assert(number_of(SEMROVER_VERSION) == SR_VERSION);

// the layout that programs were built against: a change here is a new ABI
static_assert(sizeof(sr_device_info) == 816 && offsetof(sr_device_info, memory_bytes) == 808);
static_assert(sizeof(sr_vulkan_device) == 136 && offsetof(sr_vulkan_device, robust_buffer_access) == 76);
static_assert(sizeof(sr_context_desc) == 72 && offsetof(sr_context_desc, max_bytes) == 32);
static_assert(sizeof(sr_memory_info) == 32);
static_assert(sizeof(sr_memory_request) == 32 && sizeof(sr_memory_piece) == 32);
