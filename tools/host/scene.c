/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0 */
#include "scene.h"

#include "cubes.h"

#include <math.h>
#include <string.h>

/* SPIR-V of the shaders beside this file */
static const uint32_t kSplatsVert[] = {
#include "splats.vert.inc"
};
static const uint32_t kSplatsFrag[] = {
#include "splats.frag.inc"
};
static const uint32_t kCubeVert[] = {
#include "cube.vert.inc"
};
static const uint32_t kCubeFrag[] = {
#include "cube.frag.inc"
};

/* as view.glsl has it */
struct push {
    float rows[12];
    float lens[4];
    float planes[4];
    float cube[4];
    float color[4];
};
static const VkShaderStageFlags kStages = VK_SHADER_STAGE_VERTEX_BIT | VK_SHADER_STAGE_FRAGMENT_BIT;
static const float kNear = 0.2f, kFar = 200, kSky[3] = {0.62f, 0.74f, 0.86f};

static void make_pass(struct scene* s, VkFormat format, VkImageLayout layout)
{
    const VkAttachmentDescription attachments[2] = {{.format = format,
                                                     .samples = VK_SAMPLE_COUNT_1_BIT,
                                                     .loadOp = VK_ATTACHMENT_LOAD_OP_DONT_CARE,
                                                     .storeOp = VK_ATTACHMENT_STORE_OP_STORE,
                                                     .finalLayout = layout},
                                                    {.format = VK_FORMAT_D32_SFLOAT,
                                                     .samples = VK_SAMPLE_COUNT_1_BIT,
                                                     .loadOp = VK_ATTACHMENT_LOAD_OP_DONT_CARE,
                                                     .storeOp = VK_ATTACHMENT_STORE_OP_DONT_CARE,
                                                     .finalLayout = VK_IMAGE_LAYOUT_DEPTH_STENCIL_ATTACHMENT_OPTIMAL}};
    const VkAttachmentReference color = {0, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL},
                                depth = {1, VK_IMAGE_LAYOUT_DEPTH_STENCIL_ATTACHMENT_OPTIMAL};
    const VkSubpassDescription subpass = {.pipelineBindPoint = VK_PIPELINE_BIND_POINT_GRAPHICS,
                                          .colorAttachmentCount = 1,
                                          .pColorAttachments = &color,
                                          .pDepthStencilAttachment = &depth};
    const VkPipelineStageFlags drawing = VK_PIPELINE_STAGE_COLOR_ATTACHMENT_OUTPUT_BIT |
                                         VK_PIPELINE_STAGE_EARLY_FRAGMENT_TESTS_BIT |
                                         VK_PIPELINE_STAGE_LATE_FRAGMENT_TESTS_BIT;
    const VkAccessFlags written = VK_ACCESS_COLOR_ATTACHMENT_WRITE_BIT | VK_ACCESS_DEPTH_STENCIL_ATTACHMENT_WRITE_BIT;
    /* after the frame before, and before copies of the picture */
    const VkSubpassDependency around[2] = {{.srcSubpass = VK_SUBPASS_EXTERNAL,
                                            .dstSubpass = 0,
                                            .srcStageMask = drawing | VK_PIPELINE_STAGE_TRANSFER_BIT,
                                            .dstStageMask = drawing,
                                            .srcAccessMask = written,
                                            .dstAccessMask = written | VK_ACCESS_DEPTH_STENCIL_ATTACHMENT_READ_BIT},
                                           {.srcSubpass = 0,
                                            .dstSubpass = VK_SUBPASS_EXTERNAL,
                                            .srcStageMask = VK_PIPELINE_STAGE_COLOR_ATTACHMENT_OUTPUT_BIT,
                                            .dstStageMask = VK_PIPELINE_STAGE_TRANSFER_BIT,
                                            .srcAccessMask = VK_ACCESS_COLOR_ATTACHMENT_WRITE_BIT,
                                            .dstAccessMask = VK_ACCESS_TRANSFER_READ_BIT}};
    const VkRenderPassCreateInfo info = {.sType = VK_STRUCTURE_TYPE_RENDER_PASS_CREATE_INFO,
                                         .attachmentCount = 2,
                                         .pAttachments = attachments,
                                         .subpassCount = 1,
                                         .pSubpasses = &subpass,
                                         .dependencyCount = 2,
                                         .pDependencies = around};
    check(vkCreateRenderPass(s->gpu->device, &info, NULL, &s->pass) == VK_SUCCESS, "vkCreateRenderPass");
}

static void make_framebuffers(struct scene* s, const VkImageView* views)
{
    uint32_t i;
    s->z = gpu_image(s->gpu, s->width, s->height, VK_FORMAT_D32_SFLOAT, VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT,
                     VK_IMAGE_ASPECT_DEPTH_BIT);
    for (i = 0; i < s->pictures; ++i) {
        const VkImageView attachments[2] = {views[i], s->z.view};
        const VkFramebufferCreateInfo info = {.sType = VK_STRUCTURE_TYPE_FRAMEBUFFER_CREATE_INFO,
                                              .renderPass = s->pass,
                                              .attachmentCount = 2,
                                              .pAttachments = attachments,
                                              .width = s->width,
                                              .height = s->height,
                                              .layers = 1};
        check(vkCreateFramebuffer(s->gpu->device, &info, NULL, &s->framebuffers[i]) == VK_SUCCESS,
              "vkCreateFramebuffer");
    }
}

/* the two buffers, and the descriptor set that shows them to splats.frag */
static void make_buffers(struct scene* s)
{
    const VkDevice device = s->gpu->device;
    const VkBufferUsageFlags usage = VK_BUFFER_USAGE_TRANSFER_DST_BIT | VK_BUFFER_USAGE_STORAGE_BUFFER_BIT;
    const VkDescriptorType storage = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
    const VkDescriptorSetLayoutBinding bindings[2] = {{0, storage, 1, VK_SHADER_STAGE_FRAGMENT_BIT, NULL},
                                                      {1, storage, 1, VK_SHADER_STAGE_FRAGMENT_BIT, NULL}};
    const VkDescriptorSetLayoutCreateInfo layout = {
        .sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO, .bindingCount = 2, .pBindings = bindings};
    const VkDescriptorPoolSize size = {storage, 2};
    const VkDescriptorPoolCreateInfo pool = {
        .sType = VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO, .maxSets = 1, .poolSizeCount = 1, .pPoolSizes = &size};
    VkDescriptorSetAllocateInfo set = {.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO,
                                       .descriptorSetCount = 1};
    VkDescriptorBufferInfo shown[2];
    VkWriteDescriptorSet write = {.sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET,
                                  .descriptorCount = 2,
                                  .descriptorType = storage,
                                  .pBufferInfo = shown};
    const VkDeviceSize pixels = (VkDeviceSize)s->width * s->height;
    s->color = gpu_buffer(s->gpu, pixels * 16, usage, 0);
    s->depth = gpu_buffer(s->gpu, pixels * 8, usage, 0);
    check(vkCreateDescriptorSetLayout(device, &layout, NULL, &s->set_layout) == VK_SUCCESS,
          "vkCreateDescriptorSetLayout");
    check(vkCreateDescriptorPool(device, &pool, NULL, &s->pool) == VK_SUCCESS, "vkCreateDescriptorPool");
    set.descriptorPool = s->pool;
    set.pSetLayouts = &s->set_layout;
    check(vkAllocateDescriptorSets(device, &set, &s->set) == VK_SUCCESS, "vkAllocateDescriptorSets");
    shown[0].buffer = s->color.buffer;
    shown[1].buffer = s->depth.buffer;
    shown[0].offset = shown[1].offset = 0;
    shown[0].range = shown[1].range = VK_WHOLE_SIZE;
    write.dstSet = s->set;
    vkUpdateDescriptorSets(device, 1, &write, 0, NULL);
}

static VkShaderModule module(const struct scene* s, const uint32_t* code, size_t bytes)
{
    const VkShaderModuleCreateInfo info = {
        .sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO, .codeSize = bytes, .pCode = code};
    VkShaderModule made;
    check(vkCreateShaderModule(s->gpu->device, &info, NULL, &made) == VK_SUCCESS, "vkCreateShaderModule");
    return made;
}

/* triangles without vertex buffers, into picture and z-buffer */
static VkPipeline make_pipeline(const struct scene* s, VkShaderModule vert, VkShaderModule frag, VkCompareOp depth)
{
    const VkPipelineShaderStageCreateInfo stages[2] = {{.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO,
                                                        .stage = VK_SHADER_STAGE_VERTEX_BIT,
                                                        .module = vert,
                                                        .pName = "main"},
                                                       {.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO,
                                                        .stage = VK_SHADER_STAGE_FRAGMENT_BIT,
                                                        .module = frag,
                                                        .pName = "main"}};
    const VkPipelineVertexInputStateCreateInfo none = {.sType =
                                                           VK_STRUCTURE_TYPE_PIPELINE_VERTEX_INPUT_STATE_CREATE_INFO};
    const VkPipelineInputAssemblyStateCreateInfo triangles = {
        .sType = VK_STRUCTURE_TYPE_PIPELINE_INPUT_ASSEMBLY_STATE_CREATE_INFO,
        .topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST};
    const VkViewport viewport = {0, 0, (float)s->width, (float)s->height, 0, 1};
    const VkRect2D scissor = {{0, 0}, {s->width, s->height}};
    const VkPipelineViewportStateCreateInfo all = {.sType = VK_STRUCTURE_TYPE_PIPELINE_VIEWPORT_STATE_CREATE_INFO,
                                                   .viewportCount = 1,
                                                   .pViewports = &viewport,
                                                   .scissorCount = 1,
                                                   .pScissors = &scissor};
    const VkPipelineRasterizationStateCreateInfo raster = {
        .sType = VK_STRUCTURE_TYPE_PIPELINE_RASTERIZATION_STATE_CREATE_INFO, .lineWidth = 1};
    const VkPipelineMultisampleStateCreateInfo single = {.sType =
                                                             VK_STRUCTURE_TYPE_PIPELINE_MULTISAMPLE_STATE_CREATE_INFO,
                                                         .rasterizationSamples = VK_SAMPLE_COUNT_1_BIT};
    const VkPipelineDepthStencilStateCreateInfo tested = {
        .sType = VK_STRUCTURE_TYPE_PIPELINE_DEPTH_STENCIL_STATE_CREATE_INFO,
        .depthTestEnable = VK_TRUE,
        .depthWriteEnable = VK_TRUE,
        .depthCompareOp = depth};
    const VkPipelineColorBlendAttachmentState written = {.colorWriteMask = 0xf};
    const VkPipelineColorBlendStateCreateInfo blend = {.sType =
                                                           VK_STRUCTURE_TYPE_PIPELINE_COLOR_BLEND_STATE_CREATE_INFO,
                                                       .attachmentCount = 1,
                                                       .pAttachments = &written};
    const VkGraphicsPipelineCreateInfo info = {.sType = VK_STRUCTURE_TYPE_GRAPHICS_PIPELINE_CREATE_INFO,
                                               .stageCount = 2,
                                               .pStages = stages,
                                               .pVertexInputState = &none,
                                               .pInputAssemblyState = &triangles,
                                               .pViewportState = &all,
                                               .pRasterizationState = &raster,
                                               .pMultisampleState = &single,
                                               .pDepthStencilState = &tested,
                                               .pColorBlendState = &blend,
                                               .layout = s->layout,
                                               .renderPass = s->pass};
    VkPipeline made;
    check(vkCreateGraphicsPipelines(s->gpu->device, VK_NULL_HANDLE, 1, &info, NULL, &made) == VK_SUCCESS,
          "vkCreateGraphicsPipelines");
    vkDestroyShaderModule(s->gpu->device, vert, NULL);
    vkDestroyShaderModule(s->gpu->device, frag, NULL);
    return made;
}

static void make_pipelines(struct scene* s)
{
    const VkPushConstantRange range = {kStages, 0, sizeof(struct push)};
    const VkPipelineLayoutCreateInfo layout = {.sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO,
                                               .setLayoutCount = 1,
                                               .pSetLayouts = &s->set_layout,
                                               .pushConstantRangeCount = 1,
                                               .pPushConstantRanges = &range};
    check(vkCreatePipelineLayout(s->gpu->device, &layout, NULL, &s->layout) == VK_SUCCESS, "vkCreatePipelineLayout");
    s->splats = make_pipeline(s, module(s, kSplatsVert, sizeof kSplatsVert), module(s, kSplatsFrag, sizeof kSplatsFrag),
                              VK_COMPARE_OP_ALWAYS);
    s->cubes = make_pipeline(s, module(s, kCubeVert, sizeof kCubeVert), module(s, kCubeFrag, sizeof kCubeFrag),
                             VK_COMPARE_OP_LESS);
}

void scene_create(struct scene* s, const struct gpu* gpu, const VkImageView* views, uint32_t pictures, VkFormat format,
                  VkImageLayout layout, uint32_t width, uint32_t height)
{
    check(pictures <= MOST_PICTURES, "making room for the pictures");
    memset(s, 0, sizeof *s);
    s->gpu = gpu;
    s->width = width;
    s->height = height;
    s->pictures = pictures;
    make_pass(s, format, layout);
    make_framebuffers(s, views);
    make_buffers(s);
    make_pipelines(s);
}

void scene_destroy(struct scene* s)
{
    const VkDevice device = s->gpu->device;
    uint32_t i;
    vkDestroyPipeline(device, s->splats, NULL);
    vkDestroyPipeline(device, s->cubes, NULL);
    vkDestroyPipelineLayout(device, s->layout, NULL);
    vkDestroyDescriptorPool(device, s->pool, NULL);
    vkDestroyDescriptorSetLayout(device, s->set_layout, NULL);
    for (i = 0; i < s->pictures; ++i)
        vkDestroyFramebuffer(device, s->framebuffers[i], NULL);
    vkDestroyRenderPass(device, s->pass, NULL);
    gpu_free_image(s->gpu, &s->z);
    gpu_free_buffer(s->gpu, &s->color);
    gpu_free_buffer(s->gpu, &s->depth);
}

void scene_look(const struct scene* s, const double position[3], double yaw, sr_draw_desc* draw)
{
    /* x right, y down, z forward */
    const double right[3] = {sin(yaw), -cos(yaw), 0}, down[3] = {0, 0, -1}, forward[3] = {cos(yaw), sin(yaw), 0};
    const double* axes[3] = {right, down, forward};
    int row, column;
    memset(draw, 0, sizeof *draw);
    draw->struct_size = sizeof *draw;
    draw->width = s->width;
    draw->height = s->height;
    draw->fx = draw->fy = draw->cx = s->width / 2.0;
    draw->cy = s->height / 2.0;
    for (row = 0; row < 3; ++row) {
        double* to = draw->world_to_camera + 4 * row;
        for (column = 0; column < 3; ++column) {
            to[column] = axes[row][column];
            to[3] -= axes[row][column] * position[column];
        }
    }
    draw->color.buffer = s->color.buffer;
    draw->depth.buffer = s->depth.buffer;
}

static struct push view_of(const struct scene* s, const sr_draw_desc* draw)
{
    struct push push;
    int i;
    memset(&push, 0, sizeof push);
    for (i = 0; i < 12; ++i)
        push.rows[i] = (float)draw->world_to_camera[i];
    push.lens[0] = (float)(2 * draw->fx / s->width);
    push.lens[1] = (float)(2 * draw->fy / s->height);
    push.lens[2] = (float)(2 * draw->cx / s->width - 1);
    push.lens[3] = (float)(2 * draw->cy / s->height - 1);
    push.planes[0] = kNear;
    push.planes[1] = kFar;
    push.planes[2] = (float)s->width;
    memcpy(push.color, kSky, sizeof kSky);
    return push;
}

static void draw_cubes(const struct scene* s, struct push push, VkCommandBuffer commands)
{
    size_t i;
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, s->cubes);
    for (i = 0; i < sizeof cubes / sizeof *cubes; ++i) {
        memcpy(push.cube, cubes[i].center, sizeof cubes[i].center);
        push.cube[3] = cubes[i].half;
        memcpy(push.color, cubes[i].color, sizeof cubes[i].color);
        vkCmdPushConstants(commands, s->layout, kStages, 0, sizeof push, &push);
        vkCmdDraw(commands, 36, 1, 0, 0);
    }
}

struct calls scene_calls[CALLS] = {{.name = "sr_world_focus"},          {.name = "sr_world_edit"},
                                   {.name = "sr_world_record_updates"}, {.name = "sr_world_record"},
                                   {.name = "sr_world_check_draws"},    {.name = "waiting for frame n - 2"},
                                   {.name = "from frame to frame"}};

/* the library's part ends with a barrier, so that all that follows may read the buffers */
static void record_splats(const struct scene* s, sr_world* world, const sr_draw_desc* draw, const sr_semaphore* done,
                          VkCommandBuffer commands)
{
    double since = clock_now();
    sr_status whole;
    check_sr(sr_world_record_updates(world, commands, done), s->gpu->context);
    calls_add(&scene_calls[CALL_UPDATES], since);
    since = clock_now();
    whole = sr_world_check_draws(world);
    calls_add(&scene_calls[CALL_CHECK], since);
    if (whole != SR_ERR_PARTIAL) /* else this picture has more room than one before */
        check_sr(whole, s->gpu->context);
    since = clock_now();
    check_sr(sr_world_record(world, draw, commands), s->gpu->context);
    calls_add(&scene_calls[CALL_RECORD], since);
}

/* no splats: all is sky */
static void clear_buffers(const struct scene* s, VkCommandBuffer commands)
{
    const VkMemoryBarrier barrier = {.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER,
                                     .srcAccessMask = VK_ACCESS_MEMORY_WRITE_BIT,
                                     .dstAccessMask = VK_ACCESS_MEMORY_READ_BIT | VK_ACCESS_MEMORY_WRITE_BIT};
    const VkPipelineStageFlags all = VK_PIPELINE_STAGE_ALL_COMMANDS_BIT;
    vkCmdPipelineBarrier(commands, all, all, 0, 1, &barrier, 0, NULL, 0, NULL);
    vkCmdFillBuffer(commands, s->color.buffer, 0, VK_WHOLE_SIZE, 0);
    vkCmdFillBuffer(commands, s->depth.buffer, 0, VK_WHOLE_SIZE, 0);
    vkCmdPipelineBarrier(commands, all, all, 0, 1, &barrier, 0, NULL, 0, NULL);
}

void scene_record(const struct scene* s, sr_world* world, const sr_draw_desc* draw, const sr_semaphore* done,
                  uint32_t picture, VkCommandBuffer commands)
{
    const VkRenderPassBeginInfo begin = {.sType = VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO,
                                         .renderPass = s->pass,
                                         .framebuffer = s->framebuffers[picture],
                                         .renderArea = {{0, 0}, {s->width, s->height}}};
    const struct push push = view_of(s, draw);
    if (world)
        record_splats(s, world, draw, done, commands);
    else
        clear_buffers(s, commands);
    vkCmdBeginRenderPass(commands, &begin, VK_SUBPASS_CONTENTS_INLINE);
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, s->splats);
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, s->layout, 0, 1, &s->set, 0, NULL);
    vkCmdPushConstants(commands, s->layout, kStages, 0, sizeof push, &push);
    vkCmdDraw(commands, 3, 1, 0, 0);
    draw_cubes(s, push, commands);
    vkCmdEndRenderPass(commands);
}

void scene_copy(const struct scene* s, VkImage picture, const struct buffer* pixels, VkCommandBuffer commands)
{
    const VkBufferImageCopy region = {.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1},
                                      .imageExtent = {s->width, s->height, 1}};
    const VkMemoryBarrier seen = {.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER,
                                  .srcAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT,
                                  .dstAccessMask = VK_ACCESS_HOST_READ_BIT};
    vkCmdCopyImageToBuffer(commands, picture, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, pixels->buffer, 1, &region);
    vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_PIPELINE_STAGE_HOST_BIT, 0, 1, &seen, 0, NULL, 0,
                         NULL);
}
