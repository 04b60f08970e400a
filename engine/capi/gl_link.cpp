// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/capi/gl_link.h"

#include "runtime/system/system.h"

#include <algorithm>

namespace semrover::capi {

namespace {

// note: llvmpipe wants more memory behind a buffer object than it has bytes, and else says that there is none
constexpr uint64_t kBehind = 256;

std::vector<GlName> buffers_of(std::span<const GlLink::Piece> pieces)
{
    std::vector<GlName> names;
    for (const GlLink::Piece& piece : pieces)
        names.push_back(piece.to->buffer);
    return names;
}

} // namespace

Result<std::unique_ptr<GlLink>> GlLink::create(Device& device, GlLoader loader, sr_gl_way best)
{
    std::unique_ptr<GlLink> link(new GlLink(device));
    SR_TRY(link->gl_, GlCalls::load(loader));
    SR_CHECK(link->gl_.take_errors("was set before sr_gl_create"));
    const GlStateKept kept(link->gl_);
    SR_CHECK(link->pick_way(loader, best == SR_GL_BEST ? SR_GL_SHARED : best));
    return link;
}

GlLink::~GlLink()
{
    if (drawn_name_)
        gl_.DeleteSemaphoresEXT(1, &drawn_name_);
    if (read_name_)
        gl_.DeleteSemaphoresEXT(1, &read_name_);
}

// a way that is refused leaves the next one; a device that is lost is an error all the same
Status GlLink::pick_way(GlLoader loader, sr_gl_way best)
{
    const auto is_fatal = [](const Error& e) { return e.code == ErrorCode::device_lost; };
    reason_ = "no better way was wanted (sr_gl_desc.best)";
    if (best < SR_GL_SHARED_MEMORY)
        return {};
    if (Status refused = refuse_memory(loader); !refused) {
        reason_ = refused.error().message;
        return is_fatal(refused.error()) ? refused : Status();
    }
    way_ = SR_GL_SHARED_MEMORY;
    if (best < SR_GL_SHARED)
        return {};
    if (Status refused = refuse_semaphores(loader); !refused) {
        reason_ = refused.error().message;
        return is_fatal(refused.error()) ? refused : Status();
    }
    way_ = SR_GL_SHARED;
    reason_.clear();
    return {};
}

Status GlLink::refuse_memory(GlLoader loader)
{
    if (!device_.exportable().memory)
        return fail(ErrorCode::no_device, "the device does not export memory by file descriptor, or the context was "
                                          "created without share_by_fd");
    for (const char* name : {"GL_EXT_memory_object", "GL_EXT_memory_object_fd"})
        if (!gl_.has_extension(name))
            return fail(ErrorCode::no_device, "GL does not have {}", name);
    SR_CHECK(gl_.load_memory(loader));
    SR_CHECK(compare_drivers());
    SR_TRY(commands_, CommandRing::create(device_));
    way_ = SR_GL_SHARED_MEMORY; // for the try
    const Status tried = try_memory();
    way_ = SR_GL_COPIES;
    return tried;
}

Status GlLink::compare_drivers() const
{
    const DriverIds ours = driver_ids(device_);
    DriverIds theirs;
    gl_.GetUnsignedBytevEXT(gl::kDriverUuid, theirs.driver.data());
    const GlInt count = gl_.integer(gl::kNumDeviceUuids);
    bool same = false;
    for (GlInt i = 0; i < count && !same; ++i) {
        gl_.GetUnsignedBytei_vEXT(gl::kDeviceUuid, uint32_t(i), theirs.device.data());
        same = ours == theirs;
    }
    SR_CHECK(gl_.take_errors("asking for the UUIDs of GL's device"));
    if (!same)
        return fail(ErrorCode::no_device, "GL and Vulkan have different devices or drivers: their UUIDs differ");
    return {};
}

// a few numbers through memory that both have
Status GlLink::try_memory()
{
    constexpr size_t kCount = 1024;
    std::array<uint32_t, kCount> sent{};
    for (size_t i = 0; i < kCount; ++i)
        sent[i] = uint32_t(i * 2654435761u);
    struct Rooms {
        GlLink& link;
        GlRoom shared;
        GlName plain = 0;
        ~Rooms()
        {
            link.drop(shared);
            if (plain)
                link.gl_.DeleteBuffers(1, &plain);
        }
    } rooms{*this, {}};
    SR_CHECK(make_room(rooms.shared, sizeof sent, true, "try of shared memory"));
    SR_CHECK(device_.write(rooms.shared.shared->slice(), std::as_bytes(std::span(sent))));
    gl_.GenBuffers(1, &rooms.plain);
    gl_.BindBuffer(gl::kCopyReadBuffer, rooms.shared.buffer);
    gl_.BindBuffer(gl::kCopyWriteBuffer, rooms.plain);
    gl_.BufferData(gl::kCopyWriteBuffer, sizeof sent, nullptr, gl::kStreamRead);
    gl_.CopyBufferSubData(gl::kCopyReadBuffer, gl::kCopyWriteBuffer, 0, 0, sizeof sent);
    const void* found = gl_.MapBufferRange(gl::kCopyWriteBuffer, 0, sizeof sent, gl::kMapRead);
    const bool same = found && std::equal(sent.begin(), sent.end(), static_cast<const uint32_t*>(found));
    if (found)
        (void)gl_.UnmapBuffer(gl::kCopyWriteBuffer);
    SR_CHECK(gl_.take_errors("reading shared memory"));
    if (!same)
        return fail(ErrorCode::no_device, "memory that both drivers say they share has other bytes in GL");
    return {};
}

Status GlLink::refuse_semaphores(GlLoader loader)
{
    if (!device_.exportable().semaphores)
        return fail(ErrorCode::no_device, "the device does not export semaphores by file descriptor");
    for (const char* name : {"GL_EXT_semaphore", "GL_EXT_semaphore_fd"})
        if (!gl_.has_extension(name))
            return fail(ErrorCode::no_device, "GL does not have {}", name);
    SR_CHECK(gl_.load_semaphores(loader));
    SR_CHECK(import_semaphore(drawn_, drawn_name_));
    return import_semaphore(read_, read_name_);
}

Status GlLink::import_semaphore(std::unique_ptr<ExportedSemaphore>& semaphore, GlName& name)
{
    SR_TRY(semaphore, ExportedSemaphore::create(device_));
    SR_TRY(const int descriptor, semaphore->descriptor());
    gl_.GenSemaphoresEXT(1, &name);
    gl_.ImportSemaphoreFdEXT(name, gl::kHandleTypeOpaqueFd, descriptor); // which is GL's now
    Status imported = gl_.take_errors("importing a semaphore");
    if (!imported)
        system::close_descriptor(descriptor);
    return imported;
}

Status GlLink::make_room(GlRoom& room, uint64_t bytes, bool named, const char* name)
{
    if (room.bytes >= bytes && (named || shares()) == (room.buffer != 0))
        return {};
    drop(room);
    if (shares())
        SR_CHECK(import_memory(room, bytes, name));
    else
        room.host.resize(bytes);
    if (named && !shares()) {
        gl_.GenBuffers(1, &room.buffer);
        gl_.BindBuffer(gl::kCopyWriteBuffer, room.buffer);
        gl_.BufferData(gl::kCopyWriteBuffer, ptrdiff_t(bytes), nullptr, gl::kDynamicDraw);
        SR_CHECK(gl_.take_errors("allocating a buffer object"));
    }
    room.bytes = bytes;
    return {};
}

Status GlLink::import_memory(GlRoom& room, uint64_t bytes, const char* name)
{
    SR_TRY(room.shared, Buffer::create(device_, bytes + kBehind, MemoryKind::exportable, name));
    const Buffer& buffer = *room.shared;
    shared_bytes_ += buffer.memory_bytes();
    SR_TRY(const int descriptor, buffer.descriptor());
    gl_.CreateMemoryObjectsEXT(1, &room.memory);
    if (buffer.dedicated()) {
        const GlInt yes = 1;
        gl_.MemoryObjectParameterivEXT(room.memory, gl::kDedicatedMemoryObject, &yes);
    }
    gl_.ImportMemoryFdEXT(room.memory, buffer.memory_bytes(), gl::kHandleTypeOpaqueFd, descriptor); // GL's now
    Status imported = gl_.take_errors("importing memory");
    if (!imported) {
        system::close_descriptor(descriptor);
        return imported;
    }
    gl_.GenBuffers(1, &room.buffer);
    gl_.BindBuffer(gl::kCopyWriteBuffer, room.buffer);
    gl_.BufferStorageMemEXT(gl::kCopyWriteBuffer, ptrdiff_t(bytes), room.memory, 0);
    return gl_.take_errors("making a buffer object of shared memory");
}

void GlLink::drop(GlRoom& room)
{
    if (room.shared) {
        gl_.Finish(); // it may still be read
        shared_bytes_ -= room.shared->memory_bytes();
    }
    if (room.buffer)
        gl_.DeleteBuffers(1, &room.buffer);
    if (room.memory)
        gl_.DeleteMemoryObjectsEXT(1, &room.memory);
    room = {};
}

Result<VkCommandBuffer> GlLink::begin()
{
    return commands_->begin();
}

Status GlLink::finish(VkCommandBuffer commands, std::span<const Piece> pieces)
{
    for (const Piece& piece : pieces) {
        const VkBuffer to = piece.to->shared->handle();
        record_external_target(device_, commands, piece.from, {.buffer = to});
        record_share(device_.vk(), commands, to, device_.queue_family());
    }
    if (way_ == SR_GL_SHARED_MEMORY) {
        gl_.Finish();
        SR_TRY(const uint64_t ticket, commands_->submit());
        return device_.wait(ticket);
    }
    const std::vector<GlName> buffers = buffers_of(pieces);
    const uint32_t count = uint32_t(buffers.size());
    gl_.SignalSemaphoreEXT(read_name_, count, buffers.data(), 0, nullptr, nullptr);
    gl_.Flush();
    SR_CHECK(gl_.take_errors("signalling a semaphore"));
    SR_CHECK(commands_->submit({.waits = {read_->point()}, .signals = {drawn_->point()}}));
    gl_.WaitSemaphoreEXT(drawn_name_, count, buffers.data(), 0, nullptr, nullptr);
    return gl_.take_errors("waiting for a semaphore");
}

Status GlLink::send(std::span<const Piece> pieces)
{
    if (!shares())
        return copy_to_host(pieces);
    SR_TRY(const VkCommandBuffer commands, begin());
    return finish(commands, pieces);
}

Status GlLink::copy_to_host(std::span<const Piece> pieces)
{
    for (const Piece& piece : pieces) {
        SR_CHECK(device_.read(piece.from, {piece.to->host.data(), size_t(piece.from.bytes)}));
        copied_bytes_ += piece.from.bytes;
    }
    return {};
}

Status GlLink::upload(const GlRoom& from, const GlTexture& to, const char* what)
{
    gl_.BindBuffer(gl::kPixelUnpackBuffer, shares() ? from.buffer : 0);
    gl_.BindTexture(gl::kTexture2D, to.name);
    gl_.TexSubImage2D(gl::kTexture2D, 0, 0, 0, GlInt(to.width), GlInt(to.height), to.format, to.type,
                      shares() ? nullptr : from.host.data());
    return gl_.take_errors(what);
}

Status GlLink::upload(const GlRoom& from, uint64_t bytes)
{
    if (shares())
        return {};
    gl_.BindBuffer(gl::kCopyWriteBuffer, from.buffer);
    gl_.BufferSubData(gl::kCopyWriteBuffer, 0, ptrdiff_t(bytes), from.host.data());
    return gl_.take_errors("filling a buffer object");
}

} // namespace semrover::capi
