// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/view/shading.h"

namespace semrover::view {

namespace {

// SPIR-V of the shaders beside this file
const uint32_t kVert[] = {
#include "picture.vert.inc"
};
const uint32_t kFrag[] = {
#include "picture.frag.inc"
};

static_assert(sizeof(Look) == 100);

Result<VkShaderModule> shader(VkDevice device, const uint32_t* code, size_t bytes)
{
    VkShaderModuleCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO;
    info.codeSize = bytes;
    info.pCode = code;
    VkShaderModule made = VK_NULL_HANDLE;
    SR_CHECK(checked(vkCreateShaderModule(device, &info, nullptr, &made), "vkCreateShaderModule"));
    return made;
}

VkPipelineShaderStageCreateInfo stage(VkShaderStageFlagBits of, VkShaderModule module)
{
    VkPipelineShaderStageCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
    info.stage = of;
    info.module = module;
    info.pName = "main";
    return info;
}

} // namespace

Result<std::unique_ptr<Shading>> Shading::create(Gpu& gpu)
{
    std::unique_ptr<Shading> shading(new Shading(gpu));
    SR_CHECK(shading->make_pass());
    SR_CHECK(shading->make_set_layout());
    SR_CHECK(shading->make_pipeline());
    return shading;
}

Shading::~Shading()
{
    const VkDevice device = gpu_.device();
    vkDestroyPipeline(device, pipeline_, nullptr);
    vkDestroyPipelineLayout(device, layout_, nullptr);
    vkDestroyDescriptorPool(device, pool_, nullptr);
    vkDestroyDescriptorSetLayout(device, set_layout_, nullptr);
    vkDestroyRenderPass(device, pass_, nullptr);
}

Status Shading::make_pass()
{
    VkAttachmentDescription attachment{};
    attachment.format = VK_FORMAT_R8G8B8A8_UNORM;
    attachment.samples = VK_SAMPLE_COUNT_1_BIT;
    attachment.loadOp = VK_ATTACHMENT_LOAD_OP_DONT_CARE;
    attachment.storeOp = VK_ATTACHMENT_STORE_OP_STORE;
    attachment.finalLayout = VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL;
    const VkAttachmentReference color{0, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL};
    VkSubpassDescription subpass{};
    subpass.pipelineBindPoint = VK_PIPELINE_BIND_POINT_GRAPHICS;
    subpass.colorAttachmentCount = 1;
    subpass.pColorAttachments = &color;
    // after copies of the picture before, and before copies of this one
    const VkPipelineStageFlags drawn = VK_PIPELINE_STAGE_COLOR_ATTACHMENT_OUTPUT_BIT;
    const VkPipelineStageFlags copied = VK_PIPELINE_STAGE_TRANSFER_BIT;
    const std::array<VkSubpassDependency, 2> around = {
        {{VK_SUBPASS_EXTERNAL, 0, copied | drawn, drawn, 0, VK_ACCESS_COLOR_ATTACHMENT_WRITE_BIT, 0},
         {0, VK_SUBPASS_EXTERNAL, drawn, copied, VK_ACCESS_COLOR_ATTACHMENT_WRITE_BIT, VK_ACCESS_TRANSFER_READ_BIT,
          0}}};
    VkRenderPassCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_RENDER_PASS_CREATE_INFO;
    info.attachmentCount = 1;
    info.pAttachments = &attachment;
    info.subpassCount = 1;
    info.pSubpasses = &subpass;
    info.dependencyCount = uint32_t(around.size());
    info.pDependencies = around.data();
    return checked(vkCreateRenderPass(gpu_.device(), &info, nullptr, &pass_), "vkCreateRenderPass");
}

Status Shading::make_set_layout()
{
    std::array<VkDescriptorSetLayoutBinding, kShadedBuffers> bindings{};
    for (uint32_t b = 0; b < kShadedBuffers; ++b)
        bindings[b] = {b, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1, VK_SHADER_STAGE_FRAGMENT_BIT, nullptr};
    VkDescriptorSetLayoutCreateInfo layout{};
    layout.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO;
    layout.bindingCount = kShadedBuffers;
    layout.pBindings = bindings.data();
    SR_CHECK(checked(vkCreateDescriptorSetLayout(gpu_.device(), &layout, nullptr, &set_layout_),
                     "vkCreateDescriptorSetLayout"));
    const VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, kShadedBuffers};
    VkDescriptorPoolCreateInfo pool{};
    pool.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO;
    pool.maxSets = 1;
    pool.poolSizeCount = 1;
    pool.pPoolSizes = &size;
    return checked(vkCreateDescriptorPool(gpu_.device(), &pool, nullptr, &pool_), "vkCreateDescriptorPool");
}

Status Shading::make_pipeline()
{
    const VkDevice device = gpu_.device();
    const VkPushConstantRange range{VK_SHADER_STAGE_FRAGMENT_BIT, 0, sizeof(Look)};
    VkPipelineLayoutCreateInfo layout{};
    layout.sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO;
    layout.setLayoutCount = 1;
    layout.pSetLayouts = &set_layout_;
    layout.pushConstantRangeCount = 1;
    layout.pPushConstantRanges = &range;
    SR_CHECK(checked(vkCreatePipelineLayout(device, &layout, nullptr, &layout_), "vkCreatePipelineLayout"));

    SR_TRY(const VkShaderModule vert, shader(device, kVert, sizeof kVert));
    SR_TRY(const VkShaderModule frag, shader(device, kFrag, sizeof kFrag));
    const std::array<VkPipelineShaderStageCreateInfo, 2> stages = {stage(VK_SHADER_STAGE_VERTEX_BIT, vert),
                                                                   stage(VK_SHADER_STAGE_FRAGMENT_BIT, frag)};
    VkPipelineVertexInputStateCreateInfo none{};
    none.sType = VK_STRUCTURE_TYPE_PIPELINE_VERTEX_INPUT_STATE_CREATE_INFO;
    VkPipelineInputAssemblyStateCreateInfo triangles{};
    triangles.sType = VK_STRUCTURE_TYPE_PIPELINE_INPUT_ASSEMBLY_STATE_CREATE_INFO;
    triangles.topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST;
    VkPipelineViewportStateCreateInfo one{};
    one.sType = VK_STRUCTURE_TYPE_PIPELINE_VIEWPORT_STATE_CREATE_INFO;
    one.viewportCount = one.scissorCount = 1;
    VkPipelineRasterizationStateCreateInfo raster{};
    raster.sType = VK_STRUCTURE_TYPE_PIPELINE_RASTERIZATION_STATE_CREATE_INFO;
    raster.lineWidth = 1;
    VkPipelineMultisampleStateCreateInfo single{};
    single.sType = VK_STRUCTURE_TYPE_PIPELINE_MULTISAMPLE_STATE_CREATE_INFO;
    single.rasterizationSamples = VK_SAMPLE_COUNT_1_BIT;
    VkPipelineColorBlendAttachmentState written{};
    written.colorWriteMask = 0xf;
    VkPipelineColorBlendStateCreateInfo blend{};
    blend.sType = VK_STRUCTURE_TYPE_PIPELINE_COLOR_BLEND_STATE_CREATE_INFO;
    blend.attachmentCount = 1;
    blend.pAttachments = &written;
    const std::array<VkDynamicState, 2> states = {VK_DYNAMIC_STATE_VIEWPORT, VK_DYNAMIC_STATE_SCISSOR};
    VkPipelineDynamicStateCreateInfo dynamic{};
    dynamic.sType = VK_STRUCTURE_TYPE_PIPELINE_DYNAMIC_STATE_CREATE_INFO;
    dynamic.dynamicStateCount = uint32_t(states.size());
    dynamic.pDynamicStates = states.data();
    VkGraphicsPipelineCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_GRAPHICS_PIPELINE_CREATE_INFO;
    info.stageCount = uint32_t(stages.size());
    info.pStages = stages.data();
    info.pVertexInputState = &none;
    info.pInputAssemblyState = &triangles;
    info.pViewportState = &one;
    info.pRasterizationState = &raster;
    info.pMultisampleState = &single;
    info.pColorBlendState = &blend;
    info.pDynamicState = &dynamic;
    info.layout = layout_;
    info.renderPass = pass_;
    const VkResult made = vkCreateGraphicsPipelines(device, VK_NULL_HANDLE, 1, &info, nullptr, &pipeline_);
    vkDestroyShaderModule(device, vert, nullptr);
    vkDestroyShaderModule(device, frag, nullptr);
    return checked(made, "vkCreateGraphicsPipelines");
}

Result<VkDescriptorSet> Shading::set(const std::array<VkBuffer, kShadedBuffers>& buffers)
{
    SR_CHECK(checked(vkResetDescriptorPool(gpu_.device(), pool_, 0), "vkResetDescriptorPool"));
    VkDescriptorSetAllocateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO;
    info.descriptorPool = pool_;
    info.descriptorSetCount = 1;
    info.pSetLayouts = &set_layout_;
    VkDescriptorSet set = VK_NULL_HANDLE;
    SR_CHECK(checked(vkAllocateDescriptorSets(gpu_.device(), &info, &set), "vkAllocateDescriptorSets"));
    std::array<VkDescriptorBufferInfo, kShadedBuffers> shown{};
    for (uint32_t b = 0; b < kShadedBuffers; ++b)
        shown[b] = {buffers[b], 0, VK_WHOLE_SIZE};
    VkWriteDescriptorSet write{};
    write.sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET;
    write.dstSet = set;
    write.descriptorCount = kShadedBuffers;
    write.descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
    write.pBufferInfo = shown.data();
    vkUpdateDescriptorSets(gpu_.device(), 1, &write, 0, nullptr);
    return set;
}

void Shading::record(VkCommandBuffer commands, VkDescriptorSet set, const Look& look) const
{
    const VkViewport viewport{0, 0, float(look.size[0]), float(look.size[1]), 0, 1};
    const VkRect2D scissor{{0, 0}, {look.size[0], look.size[1]}};
    vkCmdSetViewport(commands, 0, 1, &viewport);
    vkCmdSetScissor(commands, 0, 1, &scissor);
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline_);
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, layout_, 0, 1, &set, 0, nullptr);
    vkCmdPushConstants(commands, layout_, VK_SHADER_STAGE_FRAGMENT_BIT, 0, sizeof look, &look);
    vkCmdDraw(commands, 3, 1, 0, 0);
}

} // namespace semrover::view
