/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * A host that draws by OpenGL ES 3.0, without a window: the library draws splats into textures of the host's, in a GL
 * context that EGL made; a pass writes them into picture and z-buffer, and cubes are drawn with depth test.
 *
 *     gles_host MODEL FOLDER [FRAMES [WIDTH HEIGHT]]     writes FOLDER/000000.ppm and on */
#include "cubes.h"
#include "street.h"

#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <GLES3/gl3.h>
#include <math.h>
#include <semrover_gl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const float kNear = 0.2f, kFar = 200, kSky[3] = {0.62f, 0.74f, 0.86f};

/* one triangle that covers the picture */
static const char* const kSplatsVert =
    "#version 300 es\n"
    "void main() {\n"
    "    gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);\n"
    "}\n";

/* what sr_gl_draw drew, over a sky. Its first row is the top of the picture, GL's is the bottom */
static const char* const kSplatsFrag =
    "#version 300 es\n"
    "precision highp float;\n"
    "precision highp sampler2D;\n"
    "uniform sampler2D colors, depths; // r, g, b times alpha, alpha; metres: mean, median\n"
    "uniform vec3 sky;\n"
    "uniform vec2 planes; // near and far, metres\n"
    "out vec4 color;\n"
    "void main() {\n"
    "    ivec2 at = ivec2(gl_FragCoord.xy);\n"
    "    at.y = textureSize(colors, 0).y - 1 - at.y;\n"
    "    vec4 seen = texelFetch(colors, at, 0);\n"
    "    float metres = texelFetch(depths, at, 0).y;\n"
    "    float z = clamp(planes.y / (planes.y - planes.x) * (1.0 - planes.x / metres), 0.0, 1.0);\n"
    "    color = vec4(seen.rgb + (1.0 - seen.a) * sky, 1.0);\n"
    "    gl_FragDepth = seen.a < 0.5 ? 1.0 : z; // more hole than splat is sky\n"
    "}\n";

/* a cube without vertex buffers: six faces of two triangles, each face with a brightness */
static const char* const kCubeVert =
    "#version 300 es\n"
    "uniform vec4 rows[3]; // world to camera\n"
    "uniform vec4 lens;    // to clip space: scale of x and y, offset of x and y\n"
    "uniform vec2 planes;\n"
    "uniform vec4 cube; // centre, half an edge\n"
    "uniform vec3 paint;\n"
    "flat out vec3 color;\n"
    "const int corners[6] = int[](0, 1, 2, 2, 1, 3);\n"
    "void main() {\n"
    "    int face = gl_VertexID / 6, corner = corners[gl_VertexID % 6], axis = face % 3;\n"
    "    vec3 at;\n"
    "    at[axis] = face < 3 ? 1.0 : -1.0;\n"
    "    at[(axis + 1) % 3] = float(corner & 1) * 2.0 - 1.0;\n"
    "    at[(axis + 2) % 3] = float(corner >> 1) * 2.0 - 1.0;\n"
    "    vec4 world = vec4(cube.xyz + cube.w * at, 1.0);\n"
    "    vec3 camera = vec3(dot(rows[0], world), dot(rows[1], world), dot(rows[2], world));\n"
    "    vec2 up = vec2(1.0, -1.0) * (lens.xy * camera.xy + lens.zw * camera.z); // the camera's y points down\n"
    "    float z = planes.y / (planes.y - planes.x) * (camera.z - planes.x);\n"
    "    gl_Position = vec4(up, 2.0 * z - camera.z, camera.z);\n"
    "    color = paint * (axis == 2 ? 1.0 : axis == 0 ? 0.8 : 0.6);\n"
    "}\n";

static const char* const kCubeFrag = "#version 300 es\n"
                                     "precision highp float;\n"
                                     "flat in vec3 color;\n"
                                     "out vec4 drawn;\n"
                                     "void main() { drawn = vec4(color, 1.0); }\n";

struct picture {
    GLsizei width, height;
    GLuint framebuffer, color, depth; /* what the host draws into */
    GLuint seen, metres;              /* what the library draws into: color and depth of the splats */
    GLuint splats, cubes;             /* programs */
};

/* everything ends the program with a line where it fails: this is a sample */
static void check(int fine, const char* what)
{
    if (fine)
        return;
    fprintf(stderr, "%s failed\n", what);
    exit(1);
}

static void check_sr(sr_status status, const sr_context* context)
{
    char line[512];
    if (status == SR_OK)
        return;
    sr_last_error(context, line, sizeof line);
    fprintf(stderr, "%s: %s\n", sr_status_name(status), line);
    exit((int)status);
}

/* a context of GLES 3.0 without a surface, on Mesa's platform without a window system or else the default display. A
 * host with a window makes its context current with a surface instead; the rest stays as it is */
static EGLDisplay open_egl(EGLContext* context)
{
    const PFNEGLGETPLATFORMDISPLAYEXTPROC get_display =
        (PFNEGLGETPLATFORMDISPLAYEXTPROC)eglGetProcAddress("eglGetPlatformDisplayEXT");
    const EGLint wanted[] = {EGL_SURFACE_TYPE, 0, EGL_RENDERABLE_TYPE, EGL_OPENGL_ES3_BIT, EGL_NONE};
    const EGLint version[] = {EGL_CONTEXT_MAJOR_VERSION, 3, EGL_CONTEXT_MINOR_VERSION, 0, EGL_NONE};
    EGLDisplay display = EGL_NO_DISPLAY;
    EGLConfig config;
    EGLint count = 0;
    if (get_display)
        display = get_display(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, NULL);
    if (display == EGL_NO_DISPLAY)
        display = eglGetDisplay(EGL_DEFAULT_DISPLAY);
    check(eglInitialize(display, NULL, NULL), "eglInitialize");
    check(eglBindAPI(EGL_OPENGL_ES_API), "eglBindAPI");
    check(eglChooseConfig(display, wanted, &config, 1, &count) && count == 1, "looking for a config of GLES 3");
    *context = eglCreateContext(display, config, EGL_NO_CONTEXT, version);
    check(*context != EGL_NO_CONTEXT, "eglCreateContext");
    check(eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, *context), "eglMakeCurrent");
    return display;
}

static GLuint compile(GLenum kind, const char* text)
{
    const GLuint shader = glCreateShader(kind);
    char log[1024] = "";
    GLint fine = 0;
    glShaderSource(shader, 1, &text, NULL);
    glCompileShader(shader);
    glGetShaderiv(shader, GL_COMPILE_STATUS, &fine);
    glGetShaderInfoLog(shader, sizeof log, NULL, log);
    check(fine, log);
    return shader;
}

static GLuint make_program(const char* vert, const char* frag)
{
    const GLuint program = glCreateProgram();
    const GLuint shaders[2] = {compile(GL_VERTEX_SHADER, vert), compile(GL_FRAGMENT_SHADER, frag)};
    GLint fine = 0;
    int i;
    for (i = 0; i < 2; ++i)
        glAttachShader(program, shaders[i]);
    glLinkProgram(program);
    glGetProgramiv(program, GL_LINK_STATUS, &fine);
    check(fine, "linking a program");
    for (i = 0; i < 2; ++i)
        glDeleteShader(shaders[i]);
    return program;
}

/* textures of 32-bit floats cannot be filtered in GLES 3.0 */
static GLuint make_texture(GLenum format, GLsizei width, GLsizei height)
{
    GLuint texture;
    glGenTextures(1, &texture);
    glBindTexture(GL_TEXTURE_2D, texture);
    glTexStorage2D(GL_TEXTURE_2D, 1, format, width, height);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    return texture;
}

static void make_picture(struct picture* p, GLsizei width, GLsizei height)
{
    p->width = width;
    p->height = height;
    p->color = make_texture(GL_RGBA8, width, height);
    p->depth = make_texture(GL_DEPTH_COMPONENT32F, width, height);
    p->seen = make_texture(GL_RGBA32F, width, height);
    p->metres = make_texture(GL_RG32F, width, height);
    glGenFramebuffers(1, &p->framebuffer);
    glBindFramebuffer(GL_FRAMEBUFFER, p->framebuffer);
    glFramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, p->color, 0);
    glFramebufferTexture2D(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_TEXTURE_2D, p->depth, 0);
    check(glCheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE, "making a framebuffer");
    p->splats = make_program(kSplatsVert, kSplatsFrag);
    p->cubes = make_program(kCubeVert, kCubeFrag);
}

static void free_picture(const struct picture* p)
{
    const GLuint textures[4] = {p->color, p->depth, p->seen, p->metres};
    glDeleteProgram(p->splats);
    glDeleteProgram(p->cubes);
    glDeleteFramebuffers(1, &p->framebuffer);
    glDeleteTextures(4, textures);
}

/* what a camera at `position` sees that looks `yaw` radians to the left of x, 90 degrees across */
static sr_gl_draw_desc look(const struct picture* p, const double position[3], double yaw)
{
    /* x right, y down, z forward */
    const double axes[3][3] = {{sin(yaw), -cos(yaw), 0}, {0, 0, -1}, {cos(yaw), sin(yaw), 0}};
    sr_gl_draw_desc draw = {.struct_size = sizeof draw, .color = p->seen, .depth = p->metres};
    int row, column;
    draw.width = (uint32_t)p->width;
    draw.height = (uint32_t)p->height;
    draw.fx = draw.fy = draw.cx = p->width / 2.0;
    draw.cy = p->height / 2.0;
    for (row = 0; row < 3; ++row) {
        double* to = draw.world_to_camera + 4 * row;
        for (column = 0; column < 3; ++column) {
            to[column] = axes[row][column];
            to[3] -= axes[row][column] * position[column];
        }
    }
    return draw;
}

/* splats into picture and z-buffer */
static void draw_splats(const struct picture* p)
{
    glUseProgram(p->splats);
    glUniform1i(glGetUniformLocation(p->splats, "colors"), 0);
    glUniform1i(glGetUniformLocation(p->splats, "depths"), 1);
    glUniform3fv(glGetUniformLocation(p->splats, "sky"), 1, kSky);
    glUniform2f(glGetUniformLocation(p->splats, "planes"), kNear, kFar);
    glActiveTexture(GL_TEXTURE1);
    glBindTexture(GL_TEXTURE_2D, p->metres);
    glActiveTexture(GL_TEXTURE0);
    glBindTexture(GL_TEXTURE_2D, p->seen);
    glDepthFunc(GL_ALWAYS);
    glDrawArrays(GL_TRIANGLES, 0, 3);
}

static void draw_cubes(const struct picture* p, const sr_gl_draw_desc* draw)
{
    float rows[12];
    size_t i;
    for (i = 0; i < 12; ++i)
        rows[i] = (float)draw->world_to_camera[i];
    glUseProgram(p->cubes);
    glUniform4fv(glGetUniformLocation(p->cubes, "rows"), 3, rows);
    glUniform4f(glGetUniformLocation(p->cubes, "lens"), (float)(2 * draw->fx / draw->width),
                (float)(2 * draw->fy / draw->height), (float)(2 * draw->cx / draw->width - 1),
                (float)(2 * draw->cy / draw->height - 1));
    glUniform2f(glGetUniformLocation(p->cubes, "planes"), kNear, kFar);
    glDepthFunc(GL_LESS);
    for (i = 0; i < sizeof cubes / sizeof *cubes; ++i) {
        const float* center = cubes[i].center;
        glUniform4f(glGetUniformLocation(p->cubes, "cube"), center[0], center[1], center[2], cubes[i].half);
        glUniform3fv(glGetUniformLocation(p->cubes, "paint"), 1, cubes[i].color);
        glDrawArrays(GL_TRIANGLES, 0, 36);
    }
}

static void draw_frame(const struct picture* p, const sr_gl_draw_desc* draw)
{
    glBindFramebuffer(GL_FRAMEBUFFER, p->framebuffer);
    glViewport(0, 0, p->width, p->height);
    glEnable(GL_DEPTH_TEST);
    draw_splats(p);
    draw_cubes(p, draw);
    check(glGetError() == GL_NO_ERROR, "drawing a frame");
}

static void write_ppm(const char* folder, uint32_t number, const struct picture* p)
{
    const size_t row = (size_t)p->width * 4;
    unsigned char* pixels = malloc(row * (size_t)p->height);
    char path[1024];
    FILE* file;
    GLsizei x, y;
    check(pixels != NULL, "allocating the pixels");
    glReadPixels(0, 0, p->width, p->height, GL_RGBA, GL_UNSIGNED_BYTE, pixels);
    snprintf(path, sizeof path, "%s/%06u.ppm", folder, (unsigned)number);
    file = fopen(path, "wb");
    check(file != NULL, path);
    fprintf(file, "P6 %d %d 255\n", (int)p->width, (int)p->height);
    for (y = p->height; y-- > 0;) /* GL's last row is the top */
        for (x = 0; x < p->width; ++x)
            fwrite(pixels + (size_t)y * row + 4 * (size_t)x, 1, 3, file);
    check(fclose(file) == 0, path);
    free(pixels);
}

static sr_gl* make_gl(sr_context* context)
{
    const sr_gl_desc desc = {.struct_size = sizeof desc, .get_proc_address = eglGetProcAddress};
    static const char* const names[4] = {"", "copies", "shared memory", "shared memory and semaphores"};
    sr_gl_info info = {.struct_size = sizeof info};
    sr_gl* gl = NULL;
    check_sr(sr_gl_create(context, &desc, &gl), context);
    check_sr(sr_gl_get_info(gl, &info), context);
    printf("%s; %s%s%s\n", (const char*)glGetString(GL_RENDERER), names[info.way], info.reason[0] ? ": " : "",
           info.reason);
    return gl;
}

/* all that is wanted around the camera; a game takes one step a frame instead */
static void generate(sr_context* context, sr_world* world, const double position[3])
{
    const double forward[3] = {1, 0, 0};
    uint32_t done = 0;
    check_sr(sr_world_focus(world, position, forward, 18), context);
    while (!done)
        check_sr(sr_world_step(world, 20000, &done), context);
}

int main(int argc, char** argv)
{
    const uint32_t frames = argc > 3 ? (uint32_t)atoi(argv[3]) : 3;
    const int width = argc > 5 ? atoi(argv[4]) : 320, height = argc > 5 ? atoi(argv[5]) : 200;
    const sr_context_desc desc = {.struct_size = sizeof desc, .share_by_fd = 1};
    EGLContext egl_context;
    EGLDisplay display;
    sr_context* context = NULL;
    sr_world* world;
    sr_gl* gl;
    struct picture picture;
    uint32_t n;
    if (argc < 3) {
        fprintf(stderr, "usage: %s MODEL FOLDER [FRAMES [WIDTH HEIGHT]]\n", argv[0]);
        return 2;
    }
    display = open_egl(&egl_context);
    check_sr(sr_context_create(&desc, &context), NULL);
    gl = make_gl(context);
    make_picture(&picture, width, height);
    check_sr(make_street(context, argv[1], &world), context);
    for (n = 0; n < frames; ++n) {
        const double position[3] = {1 + 0.5 * n, 0, 1.7};
        const sr_gl_draw_desc draw = look(&picture, position, 0.1);
        generate(context, world, position);
        check_sr(sr_gl_draw(gl, world, &draw), context);
        draw_frame(&picture, &draw);
        write_ppm(argv[2], n, &picture);
    }
    printf("%u frames of %d x %d\n", (unsigned)frames, width, height);
    free_picture(&picture);
    sr_gl_destroy(gl);
    sr_world_destroy(world);
    sr_context_destroy(context);
    check(eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT), "eglMakeCurrent");
    eglDestroyContext(display, egl_context);
    eglTerminate(display);
    return 0;
}
