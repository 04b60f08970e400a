// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/semrover_gl.h"
#include "runtime/base/result.h"

#include <cstddef>

// What is called of OpenGL and OpenGL ES, found by the application's loader: no header or library of theirs is needed
namespace semrover::capi {

using GlName = uint32_t; // of a buffer, texture, memory object or semaphore; 0: none
using GlEnum = uint32_t;
using GlInt = int32_t;

namespace gl {
constexpr GlEnum kVersion = 0x1F02, kExtensions = 0x1F03, kNumExtensions = 0x821D;
constexpr GlEnum kTexture2D = 0x0DE1, kTextureBinding2D = 0x8069;
constexpr GlEnum kPixelUnpackBuffer = 0x88EC, kPixelUnpackBufferBinding = 0x88EF;
constexpr GlEnum kCopyReadBuffer = 0x8F36, kCopyWriteBuffer = 0x8F37; // also the names of their bindings
constexpr GlEnum kUnpackSwapBytes = 0x0CF0, kUnpackRowLength = 0x0CF2, kUnpackSkipRows = 0x0CF3,
                 kUnpackSkipPixels = 0x0CF4, kUnpackAlignment = 0x0CF5;
constexpr GlEnum kRgba = 0x1908, kRg = 0x8227, kRgInteger = 0x8228;
constexpr GlEnum kUnsignedByte = 0x1401, kUnsignedInt = 0x1405, kFloat = 0x1406;
constexpr GlEnum kDynamicDraw = 0x88E8, kStreamRead = 0x88E1;
constexpr GlEnum kMapRead = 1;
constexpr GlEnum kOutOfMemory = 0x0505;
constexpr GlEnum kDedicatedMemoryObject = 0x9581, kHandleTypeOpaqueFd = 0x9586, kNumDeviceUuids = 0x9596,
                 kDeviceUuid = 0x9597, kDriverUuid = 0x9598;
} // namespace gl

// result, name without "gl", parameters
#define SR_GL_CALLS(X)                                                                                                 \
    X(const unsigned char*, GetString, (GlEnum name))                                                                  \
    X(const unsigned char*, GetStringi, (GlEnum name, uint32_t index))                                                 \
    X(GlEnum, GetError, (void))                                                                                        \
    X(void, GetIntegerv, (GlEnum name, GlInt * value))                                                                 \
    X(void, GenBuffers, (GlInt count, GlName * names))                                                                 \
    X(void, DeleteBuffers, (GlInt count, const GlName* names))                                                         \
    X(void, BindBuffer, (GlEnum target, GlName buffer))                                                                \
    X(void, BufferData, (GlEnum target, ptrdiff_t bytes, const void* data, GlEnum usage))                              \
    X(void, BufferSubData, (GlEnum target, ptrdiff_t offset, ptrdiff_t bytes, const void* data))                       \
    X(void, CopyBufferSubData, (GlEnum from, GlEnum to, ptrdiff_t from_at, ptrdiff_t to_at, ptrdiff_t bytes))          \
    X(void*, MapBufferRange, (GlEnum target, ptrdiff_t offset, ptrdiff_t bytes, GlEnum access))                        \
    X(unsigned char, UnmapBuffer, (GlEnum target))                                                                     \
    X(void, BindTexture, (GlEnum target, GlName texture))                                                              \
    X(void, TexSubImage2D,                                                                                             \
      (GlEnum target, GlInt level, GlInt x, GlInt y, GlInt width, GlInt height, GlEnum format, GlEnum type,            \
       const void* pixels))                                                                                            \
    X(void, PixelStorei, (GlEnum name, GlInt value))                                                                   \
    X(void, Flush, (void))                                                                                             \
    X(void, Finish, (void))
// GL_EXT_memory_object, GL_EXT_memory_object_fd
#define SR_GL_MEMORY_CALLS(X)                                                                                          \
    X(void, GetUnsignedBytevEXT, (GlEnum name, uint8_t * bytes))                                                       \
    X(void, GetUnsignedBytei_vEXT, (GlEnum name, uint32_t index, uint8_t * bytes))                                     \
    X(void, CreateMemoryObjectsEXT, (GlInt count, GlName * names))                                                     \
    X(void, DeleteMemoryObjectsEXT, (GlInt count, const GlName* names))                                                \
    X(void, MemoryObjectParameterivEXT, (GlName memory, GlEnum name, const GlInt* values))                             \
    X(void, ImportMemoryFdEXT, (GlName memory, uint64_t bytes, GlEnum type, GlInt descriptor))                         \
    X(void, BufferStorageMemEXT, (GlEnum target, ptrdiff_t bytes, GlName memory, uint64_t offset))
// GL_EXT_semaphore, GL_EXT_semaphore_fd
#define SR_GL_SEMAPHORE_CALLS(X)                                                                                       \
    X(void, GenSemaphoresEXT, (GlInt count, GlName * names))                                                           \
    X(void, DeleteSemaphoresEXT, (GlInt count, const GlName* names))                                                   \
    X(void, ImportSemaphoreFdEXT, (GlName semaphore, GlEnum type, GlInt descriptor))                                   \
    X(void, WaitSemaphoreEXT,                                                                                          \
      (GlName semaphore, uint32_t buffer_count, const GlName* buffers, uint32_t texture_count, const GlName* textures, \
       const GlEnum* layouts))                                                                                         \
    X(void, SignalSemaphoreEXT,                                                                                        \
      (GlName semaphore, uint32_t buffer_count, const GlName* buffers, uint32_t texture_count, const GlName* textures, \
       const GlEnum* layouts))

using GlLoader = sr_gl_function (*)(const char* name);

struct GlCalls {
#define SR_DECLARE(result, name, parameters) result(*name) parameters = nullptr;
    SR_GL_CALLS(SR_DECLARE)
    SR_GL_MEMORY_CALLS(SR_DECLARE)
    SR_GL_SEMAPHORE_CALLS(SR_DECLARE)
#undef SR_DECLARE
    bool es = false;
    uint32_t major = 0, minor = 0;

    // Errors: usage without a context that is current, for one that is too old, or where a function is missing
    static Result<GlCalls> load(GlLoader loader);
    Status load_memory(GlLoader loader); // after load(); likewise the next. Errors: usage
    Status load_semaphores(GlLoader loader);

    bool has_extension(const char* name) const;
    GlInt integer(GlEnum name) const;
    // Clears error flags. Errors: usage, out_of_memory, where one was set. what: was done
    Status take_errors(const char* what) const;
};

// What calls bind and set for their uploads, and put back at the end.
class GlStateKept {
  public:
    explicit GlStateKept(const GlCalls& calls);
    ~GlStateKept();
    GlStateKept(const GlStateKept&) = delete;
    GlStateKept& operator=(const GlStateKept&) = delete;

  private:
    struct Kept {
        GlEnum name;
        GlInt value;
    };
    const GlCalls& gl_;
    Kept pixel_store_[5];
    Kept buffers_[3];
    GlName texture_ = 0;
};

} // namespace semrover::capi
