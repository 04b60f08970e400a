/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * The way of sr_gl that shares semaphores, where no driver here has them: memory is shared by the real drivers, and
 * semaphores by stand-ins. The application's way to Vulkan says that there is VK_KHR_external_semaphore_fd, and its
 * loader of GL that there is GL_EXT_semaphore_fd; what GL signals and waits for, this test signals and waits for on the
 * queue. Every semaphore is signalled and waited for in turns, and the bytes are those without GL.
 *
 *     capi_gl_semaphores MODEL */
#include "tests/support/capi_gl.h"

#include <fcntl.h>
#include <unistd.h>

static struct host host;

/* semaphores in the order that the library makes those to be exported, and what became of them */
enum { SEMAPHORES = 2 };
static VkSemaphore exported[SEMAPHORES];
static int exported_count, described, imported_count, deleted;
static int pending[SEMAPHORES]; /* signals that nobody has waited for */
static int signals[SEMAPHORES], waits[SEMAPHORES];

static int number_of(VkSemaphore semaphore)
{
    int i;
    for (i = 0; i < exported_count; ++i)
        if (exported[i] == semaphore)
            return i;
    return -1;
}

/* ---- Vulkan ---- */

static PFN_vkQueueSubmit real_submit;
static uint64_t library_waits, library_signals;

static VKAPI_ATTR VkResult VKAPI_CALL create_semaphore(VkDevice device, const VkSemaphoreCreateInfo* info,
                                                       const VkAllocationCallbacks* allocation, VkSemaphore* semaphore)
{
    VkSemaphoreCreateInfo plain = *info;
    const VkExportSemaphoreCreateInfo* wanted = info->pNext;
    VkResult result;
    if (!wanted || wanted->sType != VK_STRUCTURE_TYPE_EXPORT_SEMAPHORE_CREATE_INFO)
        return vkCreateSemaphore(device, info, allocation, semaphore);
    CHECK(wanted->handleTypes == VK_EXTERNAL_SEMAPHORE_HANDLE_TYPE_OPAQUE_FD_BIT && !wanted->pNext);
    plain.pNext = NULL;
    result = vkCreateSemaphore(device, &plain, allocation, semaphore);
    CHECK(result == VK_SUCCESS && exported_count < SEMAPHORES);
    exported[exported_count++] = *semaphore;
    return result;
}

/* a descriptor whose number is the semaphore's: the file behind it says nothing */
static int descriptor_of[SEMAPHORES];
static VKAPI_ATTR VkResult VKAPI_CALL get_semaphore_fd(VkDevice device, const VkSemaphoreGetFdInfoKHR* info,
                                                       int* descriptor)
{
    const int number = number_of(info->semaphore);
    CHECK(device == host.device && number >= 0);
    CHECK(info->handleType == VK_EXTERNAL_SEMAPHORE_HANDLE_TYPE_OPAQUE_FD_BIT);
    *descriptor = descriptor_of[number] = open("/dev/null", O_RDONLY);
    CHECK(*descriptor >= 0);
    ++described;
    return VK_SUCCESS;
}

static VKAPI_ATTR VkResult VKAPI_CALL submit(VkQueue queue, uint32_t count, const VkSubmitInfo* infos, VkFence fence)
{
    uint32_t i, s;
    for (i = 0; i < count; ++i) {
        for (s = 0; s < infos[i].waitSemaphoreCount; ++s) {
            const int number = number_of(infos[i].pWaitSemaphores[s]);
            if (number < 0)
                continue;
            CHECK(pending[number] == 1); /* GL has signalled it */
            --pending[number];
            ++library_waits;
        }
        for (s = 0; s < infos[i].signalSemaphoreCount; ++s) {
            const int number = number_of(infos[i].pSignalSemaphores[s]);
            if (number < 0)
                continue;
            CHECK(pending[number] == 0); /* GL has waited for the last one */
            ++pending[number];
            ++library_signals;
        }
    }
    return real_submit(queue, count, infos, fence);
}

static VKAPI_ATTR void VKAPI_CALL semaphore_properties(VkPhysicalDevice physical,
                                                       const VkPhysicalDeviceExternalSemaphoreInfo* info,
                                                       VkExternalSemaphoreProperties* properties)
{
    CHECK(physical == host.physical && info->handleType == VK_EXTERNAL_SEMAPHORE_HANDLE_TYPE_OPAQUE_FD_BIT);
    properties->externalSemaphoreFeatures = VK_EXTERNAL_SEMAPHORE_FEATURE_EXPORTABLE_BIT;
}

/* one more than there are */
static VKAPI_ATTR VkResult VKAPI_CALL device_extensions(VkPhysicalDevice physical, const char* layer, uint32_t* count,
                                                        VkExtensionProperties* all)
{
    uint32_t room = *count;
    VkResult result;
    if (!all) {
        result = vkEnumerateDeviceExtensionProperties(physical, layer, count, NULL);
        ++*count;
        return result;
    }
    *count = room - 1;
    result = vkEnumerateDeviceExtensionProperties(physical, layer, count, all);
    CHECK(result == VK_SUCCESS && *count < room);
    memset(&all[*count], 0, sizeof *all);
    strcpy(all[*count].extensionName, VK_KHR_EXTERNAL_SEMAPHORE_FD_EXTENSION_NAME);
    ++*count;
    return result;
}

static VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL device_call(VkDevice device, const char* name)
{
    if (!strcmp(name, "vkCreateSemaphore"))
        return (PFN_vkVoidFunction)create_semaphore;
    if (!strcmp(name, "vkGetSemaphoreFdKHR"))
        return (PFN_vkVoidFunction)get_semaphore_fd;
    if (strcmp(name, "vkQueueSubmit"))
        return vkGetDeviceProcAddr(device, name);
    real_submit = (PFN_vkQueueSubmit)vkGetDeviceProcAddr(device, name);
    return (PFN_vkVoidFunction)submit;
}

static VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL instance_call(VkInstance instance, const char* name)
{
    if (!strcmp(name, "vkGetDeviceProcAddr"))
        return (PFN_vkVoidFunction)device_call;
    if (!strcmp(name, "vkEnumerateDeviceExtensionProperties"))
        return (PFN_vkVoidFunction)device_extensions;
    if (!strcmp(name, "vkGetPhysicalDeviceExternalSemaphoreProperties"))
        return (PFN_vkVoidFunction)semaphore_properties;
    return vkGetInstanceProcAddr(instance, name);
}

/* ---- GL: names of semaphores are their numbers and one ---- */

static GLuint number_by_name[SEMAPHORES + 1];

static void gen_semaphores(GLsizei count, GLuint* names)
{
    CHECK(count == 1 && imported_count < SEMAPHORES);
    *names = (GLuint)++imported_count;
}

static void import_semaphore(GLuint name, GLenum type, GLint descriptor)
{
    int i;
    CHECK(name >= 1 && name <= SEMAPHORES && type == 0x9586);
    for (i = 0; i < SEMAPHORES; ++i)
        if (descriptor_of[i] == descriptor)
            number_by_name[name] = (GLuint)i;
    CHECK(close(descriptor) == 0); /* GL owns it */
}

static void delete_semaphores(GLsizei count, const GLuint* names)
{
    CHECK(count == 1 && names[0] >= 1 && names[0] <= SEMAPHORES);
    ++deleted;
}

static void queue_semaphore(int number, int signal)
{
    const VkPipelineStageFlags stage = VK_PIPELINE_STAGE_ALL_COMMANDS_BIT;
    VkSubmitInfo info = {0};
    info.sType = VK_STRUCTURE_TYPE_SUBMIT_INFO;
    info.pWaitDstStageMask = &stage;
    info.waitSemaphoreCount = signal ? 0 : 1;
    info.signalSemaphoreCount = signal ? 1 : 0;
    info.pWaitSemaphores = info.pSignalSemaphores = &exported[number];
    CHECK(vkQueueSubmit(host.queue, 1, &info, VK_NULL_HANDLE) == VK_SUCCESS);
}

/* a GL that is late: what it was told before has ended when the semaphore is signalled */
static void signal_semaphore(GLuint name, GLuint buffer_count, const GLuint* buffers, GLuint texture_count,
                             const GLuint* textures, const GLenum* layouts)
{
    const int number = (int)number_by_name[name];
    (void)textures;
    (void)layouts;
    CHECK(buffer_count >= 1 && buffers[0] && texture_count == 0);
    CHECK(pending[number] == 0);
    ((PFNGLFINISHPROC)eglGetProcAddress("glFinish"))();
    queue_semaphore(number, 1);
    ++pending[number];
    ++signals[number];
}

static void wait_semaphore(GLuint name, GLuint buffer_count, const GLuint* buffers, GLuint texture_count,
                           const GLuint* textures, const GLenum* layouts)
{
    const int number = (int)number_by_name[name];
    (void)textures;
    (void)layouts;
    CHECK(buffer_count >= 1 && buffers[0] && texture_count == 0);
    CHECK(pending[number] == 1);
    queue_semaphore(number, 0);
    CHECK(vkQueueWaitIdle(host.queue) == VK_SUCCESS);
    --pending[number];
    ++waits[number];
}

static void get_integer(GLenum name, GLint* value)
{
    test_glGetIntegerv(name, value);
    if (name == GL_NUM_EXTENSIONS)
        *value += 2;
}

static const GLubyte* get_string(GLenum name, GLuint index)
{
    const GLuint count = (GLuint)integer_of(GL_NUM_EXTENSIONS);
    if (name == GL_EXTENSIONS && index >= count)
        return (const GLubyte*)(index == count ? "GL_EXT_semaphore" : "GL_EXT_semaphore_fd");
    return ((PFNGLGETSTRINGIPROC)eglGetProcAddress("glGetStringi"))(name, index);
}

static sr_gl_function find_function(const char* name)
{
    static const struct {
        const char* name;
        sr_gl_function function;
    } stand_ins[] = {{"glGenSemaphoresEXT", (sr_gl_function)gen_semaphores},
                     {"glImportSemaphoreFdEXT", (sr_gl_function)import_semaphore},
                     {"glDeleteSemaphoresEXT", (sr_gl_function)delete_semaphores},
                     {"glSignalSemaphoreEXT", (sr_gl_function)signal_semaphore},
                     {"glWaitSemaphoreEXT", (sr_gl_function)wait_semaphore},
                     {"glGetIntegerv", (sr_gl_function)get_integer},
                     {"glGetStringi", (sr_gl_function)get_string}};
    size_t i;
    for (i = 0; i < sizeof stand_ins / sizeof *stand_ins; ++i)
        if (!strcmp(name, stand_ins[i].name))
            return stand_ins[i].function;
    return eglGetProcAddress(name);
}

/* ---- the test ---- */

static sr_context* make_context(void)
{
    sr_vulkan_device vulkan = lent(&host);
    sr_context_desc desc;
    sr_context* context = NULL;
    vulkan.get_instance_proc_addr = instance_call;
    vulkan.external_memory_fd = vulkan.external_semaphore_fd = 1;
    memset(&desc, 0, sizeof desc);
    desc.struct_size = sizeof desc;
    desc.vulkan = &vulkan;
    CHECK_OK(NULL, sr_context_create(&desc, &context));
    return context;
}

/* buffers that came between two signals have the splats */
static void check_some_splats(const sr_gl_splats* splats)
{
    float* positions = malloc(splats->positions.bytes);
    uint32_t n, seen = 0;
    CHECK(positions && splats->count > 0);
    read_buffer(splats->positions.buffer, splats->positions.bytes, positions);
    for (n = 0; n < splats->count; ++n)
        seen += positions[4 * n + 3] > 0 && positions[4 * n + 2] > -0.1f && positions[4 * n + 2] < 2.6f;
    CHECK(seen > splats->count / 2);
    free(positions);
}

/* a draw that GL refuses leaves the semaphores in turns */
static void refuses_a_wrong_texture(sr_context* context, sr_gl* gl, sr_world* world)
{
    const struct textures t = make_textures(WIDTH, HEIGHT);
    sr_gl_draw_desc draw = gl_camera(1, &t);
    draw.unwaited = 1;
    draw.label = t.color.name;
    CHECK(sr_gl_draw(gl, world, &draw) == SR_ERR_USAGE && says(context, "uploading label"));
    delete_textures(&t);
}

/* draws that nobody waits for, one after the other, then splats and a step of the world */
static void draws_without_waiting(sr_context* context, sr_gl* gl, sr_world* world)
{
    const struct textures first = make_textures(WIDTH, HEIGHT), second = make_textures(WIDTH, HEIGHT);
    sr_gl_splats splats;
    sr_gl_draw_desc draw;
    int time;
    for (time = 0; time < 3; ++time) {
        draw = gl_camera(1, &first);
        draw.unwaited = time != 1;
        CHECK_OK(context, sr_gl_draw(gl, world, &draw));
        draw = gl_camera(2, &second);
        draw.unwaited = 1;
        CHECK_OK(context, sr_gl_draw(gl, world, &draw));
        memset(&splats, 0, sizeof splats);
        splats.struct_size = sizeof splats;
        CHECK_OK(context, sr_gl_get_splats(gl, world, &splats));
        check_some_splats(&splats);
        CHECK_OK(context, sr_world_step(world, 0, NULL));
        CHECK_OK(context, sr_world_check_draws(world));
        draw_without_gl(context, world, 1);
        check_textures(&first);
        draw_without_gl(context, world, 2);
        check_textures(&second);
    }
    delete_textures(&first);
    delete_textures(&second);
}

int main(int argc, char** argv)
{
    struct egl egl;
    sr_context* context;
    sr_world_desc desc;
    sr_world* world = NULL;
    sr_gl* gl;
    sr_gl_info info;
    CHECK(argc == 2);
    sr_set_diagnostic_callback(print_line, stderr);
    host = make_host_with(VK_KHR_EXTERNAL_MEMORY_FD_EXTENSION_NAME);
    egl = make_egl(EGL_OPENGL_ES_API, 3, 0);
    load_gl();
    context = make_context();
    gl = make_gl_with(context, SR_GL_BEST, find_function);
    info = info_of(gl);
    if (info.way != SR_GL_SHARED) {
        printf("skipped: %s\n", info.reason); /* memory cannot be shared here */
        return 77;
    }
    CHECK(!info.reason[0] && exported_count == 2 && described == 2 && imported_count == 2);
    desc = street_world();
    CHECK_OK(context, create_world(context, argv[1], &desc, &world));
    walk(context, world, 3, 3);
    refuses_a_wrong_texture(context, gl, world);
    draws_without_waiting(context, gl, world);
    CHECK(library_signals == 8 && library_waits == 8); /* seven draws, and the splats once */
    CHECK(signals[0] + signals[1] == 8 && waits[0] + waits[1] == 8 && !pending[0] && !pending[1]);
    CHECK(info_of(gl).copied_bytes == 0 && info_of(gl).shared_bytes > 0);
    sr_gl_destroy(gl);
    CHECK(deleted == 2);
    sr_world_destroy(world);
    sr_context_destroy(context);
    destroy_egl(&egl);
    destroy_host(&host);
    return 0;
}
