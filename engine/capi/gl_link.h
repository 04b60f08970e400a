// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/capi/gl_calls.h"
#include "runtime/device/exportable.h"
#include "runtime/device/external_copies.h"

// the way that bytes take from the device to a GL context
namespace semrover::capi {

// Bytes that GL sees: a buffer of the device's that is imported, or host memory beside a buffer object of GL's own.
struct GlRoom {
    uint64_t bytes = 0;
    std::unique_ptr<Buffer> shared;
    GlName memory = 0, buffer = 0;
    std::vector<std::byte> host;
};

struct GlTexture {
    GlName name = 0;
    uint32_t width = 0, height = 0;
    GlEnum format = 0, type = 0; // of its pixels, in the room
};

class GlLink {
  public:
    // asks both drivers, tries what they say, and takes the best way that is not better than `best`.
    // Errors: usage as GlCalls has them; device_lost
    static Result<std::unique_ptr<GlLink>> create(Device& device, GlLoader loader, sr_gl_way best);
    ~GlLink(); // rooms are dropped before
    GlLink(const GlLink&) = delete;
    GlLink& operator=(const GlLink&) = delete;

    const GlCalls& gl() const { return gl_; }
    sr_gl_way way() const { return way_; }
    const std::string& reason() const { return reason_; } // why it is no better one
    uint64_t shared_bytes() const { return shared_bytes_; }
    uint64_t copied_bytes() const { return copied_bytes_; }
    bool shares() const { return way_ != SR_GL_COPIES; }

    // At least as many bytes. named: GL needs a buffer object, also where bytes are copied. Errors: out_of_memory
    Status make_room(GlRoom& room, uint64_t bytes, bool named, const char* name);
    void drop(GlRoom& room);

    // Copies what lies on the device into rooms; what GL does afterwards sees it. Where memory is shared, commands
    // that begin() gave may draw before.
    struct Piece {
        BufferSlice from;
        GlRoom* to = nullptr;
    };
    Result<VkCommandBuffer> begin(); // of a way that shares
    Status finish(VkCommandBuffer commands, std::span<const Piece> pieces);
    Status send(std::span<const Piece> pieces);

    // from the beginning of a room, within a GlStateKept. what: in the error
    Status upload(const GlRoom& from, const GlTexture& to, const char* what);
    Status upload(const GlRoom& from, uint64_t bytes); // to its own buffer object; nothing where memory is shared

  private:
    explicit GlLink(Device& device) : device_(device) {}
    Status pick_way(GlLoader loader, sr_gl_way best);
    Status refuse_memory(GlLoader loader);     // an error says why it cannot be shared
    Status refuse_semaphores(GlLoader loader); // likewise
    Status compare_drivers() const;
    Status try_memory();
    Status import_memory(GlRoom& room, uint64_t bytes, const char* name);
    Status import_semaphore(std::unique_ptr<ExportedSemaphore>& semaphore, GlName& name);
    Status copy_to_host(std::span<const Piece> pieces);

    Device& device_;
    GlCalls gl_;
    sr_gl_way way_ = SR_GL_COPIES;
    std::string reason_;
    uint64_t shared_bytes_ = 0, copied_bytes_ = 0;
    std::unique_ptr<CommandRing> commands_;
    std::unique_ptr<ExportedSemaphore> drawn_, read_; // by the device, by GL
    GlName drawn_name_ = 0, read_name_ = 0;
};

} // namespace semrover::capi
