/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * GL contexts without a window for tests in C, and the functions of GL that they call: by EGL, as an application finds
 * them. */
#ifndef SEMROVER_TESTS_CAPI_EGL_H
#define SEMROVER_TESTS_CAPI_EGL_H

#include "engine/semrover_gl.h"
#include "tests/support/capi_vulkan.h"

#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <GLES3/gl32.h>

struct egl {
    EGLDisplay display;
    EGLContext context;
};

/* of Mesa, which needs no window system. api: EGL_OPENGL_ES_API or EGL_OPENGL_API */
static struct egl make_egl(EGLenum api, EGLint major, EGLint minor)
{
    const PFNEGLGETPLATFORMDISPLAYEXTPROC get_display =
        (PFNEGLGETPLATFORMDISPLAYEXTPROC)eglGetProcAddress("eglGetPlatformDisplayEXT");
    const EGLint wanted[] = {EGL_SURFACE_TYPE, 0, EGL_RENDERABLE_TYPE,
                             api == EGL_OPENGL_API ? EGL_OPENGL_BIT : EGL_OPENGL_ES3_BIT, EGL_NONE};
    const EGLint version[] = {EGL_CONTEXT_MAJOR_VERSION, major, EGL_CONTEXT_MINOR_VERSION, minor, EGL_NONE};
    struct egl made;
    EGLConfig config;
    EGLint count = 0;
    CHECK(get_display);
    made.display = get_display(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, NULL);
    CHECK(eglInitialize(made.display, NULL, NULL));
    CHECK(eglBindAPI(api) && eglChooseConfig(made.display, wanted, &config, 1, &count) && count == 1);
    made.context = eglCreateContext(made.display, config, EGL_NO_CONTEXT, version);
    CHECK(made.context != EGL_NO_CONTEXT);
    CHECK(eglMakeCurrent(made.display, EGL_NO_SURFACE, EGL_NO_SURFACE, made.context));
    return made;
}

static void destroy_egl(const struct egl* egl)
{
    CHECK(eglMakeCurrent(egl->display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT));
    CHECK(eglDestroyContext(egl->display, egl->context));
    CHECK(eglTerminate(egl->display));
}

/* the functions that a test calls; GL's and GLES's have the same names */
#define GL_FUNCTIONS(X)                                                                                                \
    X(PFNGLBINDBUFFERPROC, glBindBuffer)                                                                               \
    X(PFNGLBINDFRAMEBUFFERPROC, glBindFramebuffer)                                                                     \
    X(PFNGLBINDTEXTUREPROC, glBindTexture)                                                                             \
    X(PFNGLBUFFERDATAPROC, glBufferData)                                                                               \
    X(PFNGLCHECKFRAMEBUFFERSTATUSPROC, glCheckFramebufferStatus)                                                       \
    X(PFNGLCOPYBUFFERSUBDATAPROC, glCopyBufferSubData)                                                                 \
    X(PFNGLDELETEBUFFERSPROC, glDeleteBuffers)                                                                         \
    X(PFNGLDELETEFRAMEBUFFERSPROC, glDeleteFramebuffers)                                                               \
    X(PFNGLDELETETEXTURESPROC, glDeleteTextures)                                                                       \
    X(PFNGLENABLEPROC, glEnable)                                                                                       \
    X(PFNGLFRAMEBUFFERTEXTURE2DPROC, glFramebufferTexture2D)                                                           \
    X(PFNGLGENBUFFERSPROC, glGenBuffers)                                                                               \
    X(PFNGLGENFRAMEBUFFERSPROC, glGenFramebuffers)                                                                     \
    X(PFNGLGENTEXTURESPROC, glGenTextures)                                                                             \
    X(PFNGLGETERRORPROC, glGetError)                                                                                   \
    X(PFNGLGETINTEGERVPROC, glGetIntegerv)                                                                             \
    X(PFNGLMAPBUFFERRANGEPROC, glMapBufferRange)                                                                       \
    X(PFNGLPIXELSTOREIPROC, glPixelStorei)                                                                             \
    X(PFNGLREADPIXELSPROC, glReadPixels)                                                                               \
    X(PFNGLTEXIMAGE2DPROC, glTexImage2D)                                                                               \
    X(PFNGLTEXPARAMETERIPROC, glTexParameteri)                                                                         \
    X(PFNGLUNMAPBUFFERPROC, glUnmapBuffer)
#define DECLARE(type, name) static type test_##name;
GL_FUNCTIONS(DECLARE)
#undef DECLARE

static void load_gl(void)
{
#define LOAD(type, name)                                                                                               \
    test_##name = (type)eglGetProcAddress(#name);                                                                      \
    CHECK(test_##name);
    GL_FUNCTIONS(LOAD)
#undef LOAD
}

static GLint integer_of(GLenum name)
{
    GLint value = -1;
    test_glGetIntegerv(name, &value);
    return value;
}

struct texture {
    GLuint name;
    GLsizei width, height;
    GLenum format, type; /* as it is read */
};

static struct texture make_texture(GLsizei width, GLsizei height, GLenum internal, GLenum format, GLenum type)
{
    const struct texture made = {0, width, height, format == GL_RG_INTEGER ? GL_RGBA_INTEGER : GL_RGBA, type};
    struct texture texture = made;
    test_glGenTextures(1, &texture.name);
    test_glBindTexture(GL_TEXTURE_2D, texture.name);
    test_glTexImage2D(GL_TEXTURE_2D, 0, (GLint)internal, width, height, 0, format, type, NULL);
    test_glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    test_glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    test_glBindTexture(GL_TEXTURE_2D, 0);
    CHECK(test_glGetError() == GL_NO_ERROR);
    return texture;
}

/* all texels with four channels, the first row of texels first */
static void read_texture(const struct texture* texture, void* texels)
{
    GLuint framebuffer = 0;
    const GLint before = integer_of(GL_READ_FRAMEBUFFER_BINDING);
    test_glGenFramebuffers(1, &framebuffer);
    test_glBindFramebuffer(GL_READ_FRAMEBUFFER, framebuffer);
    test_glFramebufferTexture2D(GL_READ_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, texture->name, 0);
    CHECK(test_glCheckFramebufferStatus(GL_READ_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE);
    test_glReadPixels(0, 0, texture->width, texture->height, texture->format, texture->type, texels);
    test_glBindFramebuffer(GL_READ_FRAMEBUFFER, (GLuint)before);
    test_glDeleteFramebuffers(1, &framebuffer);
    CHECK(test_glGetError() == GL_NO_ERROR);
}

/* the first bytes of a buffer object, by a copy that can be mapped */
static void read_buffer(GLuint buffer, size_t bytes, void* to)
{
    const GLint from = integer_of(GL_COPY_READ_BUFFER_BINDING), into = integer_of(GL_COPY_WRITE_BUFFER_BINDING);
    GLuint copy = 0;
    const void* mapped;
    test_glGenBuffers(1, &copy);
    test_glBindBuffer(GL_COPY_READ_BUFFER, buffer);
    test_glBindBuffer(GL_COPY_WRITE_BUFFER, copy);
    test_glBufferData(GL_COPY_WRITE_BUFFER, (GLsizeiptr)bytes, NULL, GL_STREAM_READ);
    test_glCopyBufferSubData(GL_COPY_READ_BUFFER, GL_COPY_WRITE_BUFFER, 0, 0, (GLsizeiptr)bytes);
    mapped = test_glMapBufferRange(GL_COPY_WRITE_BUFFER, 0, (GLsizeiptr)bytes, GL_MAP_READ_BIT);
    CHECK(mapped);
    memcpy(to, mapped, bytes);
    CHECK(test_glUnmapBuffer(GL_COPY_WRITE_BUFFER));
    test_glBindBuffer(GL_COPY_READ_BUFFER, (GLuint)from);
    test_glBindBuffer(GL_COPY_WRITE_BUFFER, (GLuint)into);
    test_glDeleteBuffers(1, &copy);
    CHECK(test_glGetError() == GL_NO_ERROR);
}

#endif
