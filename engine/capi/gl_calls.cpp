// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/capi/gl_calls.h"

#include <cstdio>
#include <cstring>

namespace semrover::capi {

namespace {

template <typename Call>
Status set(Call& call, GlLoader loader, const char* name)
{
    call = reinterpret_cast<Call>(loader(name));
    if (!call)
        return fail(ErrorCode::usage, "the application's loader does not have {}", name);
    return {};
}

// "OpenGL ES 3.2 Mesa 22.3.6", "4.5 (Core Profile) Mesa 22.3.6"
Status read_version(GlCalls& gl)
{
    const auto* text = reinterpret_cast<const char*>(gl.GetString(gl::kVersion));
    if (!text)
        return fail(ErrorCode::usage, "sr_gl_create: no GL context is current on this thread");
    constexpr const char* kPrefix = "OpenGL ES ";
    gl.es = !std::strncmp(text, kPrefix, std::strlen(kPrefix));
    if (std::sscanf(gl.es ? text + std::strlen(kPrefix) : text, "%u.%u", &gl.major, &gl.minor) != 2)
        return fail(ErrorCode::usage, "sr_gl_create: '{}' is no version of GL", text);
    if (gl.major < 3 || (!gl.es && gl.major == 3 && gl.minor < 1))
        return fail(ErrorCode::usage, "sr_gl_create: needs GL 3.1 or GLES 3.0, the current context is '{}'", text);
    return {};
}

} // namespace

Result<GlCalls> GlCalls::load(GlLoader loader)
{
    GlCalls c;
    SR_CHECK(set(c.GetString, loader, "glGetString"));
    SR_CHECK(read_version(c));
#define SR_LOAD(result, name, parameters) SR_CHECK(set(c.name, loader, "gl" #name));
    SR_GL_CALLS(SR_LOAD)
    return c;
}

Status GlCalls::load_memory(GlLoader loader)
{
    GlCalls& c = *this;
    SR_GL_MEMORY_CALLS(SR_LOAD)
    return {};
}

Status GlCalls::load_semaphores(GlLoader loader)
{
    GlCalls& c = *this;
    SR_GL_SEMAPHORE_CALLS(SR_LOAD)
#undef SR_LOAD
    return {};
}

bool GlCalls::has_extension(const char* name) const
{
    const GlInt count = integer(gl::kNumExtensions);
    for (GlInt i = 0; i < count; ++i) {
        const auto* one = reinterpret_cast<const char*>(GetStringi(gl::kExtensions, uint32_t(i)));
        if (one && !std::strcmp(one, name))
            return true;
    }
    return false;
}

GlInt GlCalls::integer(GlEnum name) const
{
    GlInt value = 0;
    GetIntegerv(name, &value);
    return value;
}

Status GlCalls::take_errors(const char* what) const
{
    const GlEnum first = GetError();
    if (!first)
        return {};
    for (int i = 0; i < 16 && GetError(); ++i) // a context that is lost says so for ever
        ;
    return fail(first == gl::kOutOfMemory ? ErrorCode::out_of_memory : ErrorCode::usage, "GL error 0x{:04x}: {}", first,
                what);
}

GlStateKept::GlStateKept(const GlCalls& calls)
    : gl_(calls), pixel_store_{{gl::kUnpackAlignment, 0},
                               {gl::kUnpackRowLength, 0},
                               {gl::kUnpackSkipRows, 0},
                               {gl::kUnpackSkipPixels, 0},
                               {gl::kUnpackSwapBytes, 0}},
      buffers_{{gl::kPixelUnpackBuffer, gl_.integer(gl::kPixelUnpackBufferBinding)},
               {gl::kCopyReadBuffer, gl_.integer(gl::kCopyReadBuffer)},
               {gl::kCopyWriteBuffer, gl_.integer(gl::kCopyWriteBuffer)}},
      texture_(GlName(gl_.integer(gl::kTextureBinding2D)))
{
    for (Kept& k : pixel_store_) {
        if (gl_.es && k.name == gl::kUnpackSwapBytes) // which is desktop GL's
            continue;
        k.value = gl_.integer(k.name);
        gl_.PixelStorei(k.name, k.name == gl::kUnpackAlignment ? 4 : 0);
    }
}

GlStateKept::~GlStateKept()
{
    for (const Kept& k : pixel_store_)
        if (!gl_.es || k.name != gl::kUnpackSwapBytes)
            gl_.PixelStorei(k.name, k.value);
    for (const Kept& k : buffers_)
        gl_.BindBuffer(k.name, GlName(k.value));
    gl_.BindTexture(gl::kTexture2D, texture_);
}

} // namespace semrover::capi
