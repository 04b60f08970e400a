// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/device/executable.h"

#include "runtime/device/command.h"
#include "runtime/device/debug_names.h"
#include "runtime/device/pipeline.h"
#include "runtime/device/profile.h"

#include <chrono>

namespace semrover {

Result<std::unique_ptr<Executable>> Executable::create(Device& device, const Graph& graph)
{
    SR_TRY(Plan plan, make_plan(graph, device.costs()));
    return create(device, std::move(plan));
}

Result<std::unique_ptr<Executable>> Executable::create(Device& device, Plan plan)
{
    std::unique_ptr<Executable> p(new Executable(device, std::move(plan)));
    p->measuring_ = device.limits().submit_seconds > 0 && device.timestamp_ns() > 0 && !p->plan_.passes.empty();
    SR_CHECK(p->choose_alternatives());
    SR_CHECK(p->allocate());
    SR_CHECK(p->get_pipelines());
    SR_CHECK(p->make_sets());
    SR_CHECK(p->make_queries());
    SR_CHECK(p->record());
    return p;
}

Executable::~Executable()
{
    (void)device_.wait(device_.last_ticket()); // command buffers may be in flight; a lost device is reported elsewhere
    for (VkBufferView view : views_)
        device_.vk().DestroyBufferView(device_.handle(), view, device_.vk().allocator());
    if (queries_)
        device_.vk().DestroyQueryPool(device_.handle(), queries_, device_.vk().allocator());
    if (descriptors_)
        device_.vk().DestroyDescriptorPool(device_.handle(), descriptors_, device_.vk().allocator());
    if (commands_pool_)
        device_.vk().DestroyCommandPool(device_.handle(), commands_pool_, device_.vk().allocator());
}

Status Executable::choose_alternatives()
{
    if (!measuring_ || !device_.autotunes())
        return {};
    SR_TRY(autotuner_, Autotuner::begin(plan_, device_.limits(), device_.tuning()));
    if (autotuner_.changed())
        stage::submits(plan_, device_.limits(), device_.costs().seconds(plan_));
    return {};
}

Status Executable::allocate()
{
    for (uint64_t bytes : plan_.blocks) {
        SR_TRY(auto block, Buffer::create(device_, bytes, MemoryKind::device, "graph arena"));
        blocks_.push_back(std::move(block));
    }
    return {};
}

// Vulkan wants a buffer at every binding, also at one that the shader does not use: of those that are given, one that
// is read or written as it
const PassBinding& Executable::stand_in(const Pass& pass, size_t binding)
{
    const auto alike = [&](const PassBinding& b) { return b.given() && b.access == pass.bindings[binding].access; };
    const auto found = std::ranges::find_if(pass.bindings, alike);
    return found == pass.bindings.end() ? *std::ranges::find_if(pass.bindings, &PassBinding::given) : *found;
}

std::pair<VkBuffer, uint64_t> Executable::locate(const PassBinding& b) const
{
    const Resource& r = plan_.resources[b.resource];
    SR_ASSERT(!r.external || r.memory.buffer, "'{}' has no memory: the graph was only good for planning", r.name);
    if (r.external)
        return {r.memory.buffer->handle(), r.memory.offset + b.offset};
    const Placement& p = plan_.placements[b.resource];
    return {blocks_[p.block]->handle(), p.offset + b.offset};
}

Status Executable::get_pipelines()
{
    SR_TRY(pipelines_, device_.pipelines().get(plan_.passes));
    return {};
}

Status Executable::make_sets()
{
    uint32_t storage = 0, texel = 0;
    std::vector<VkDescriptorSetLayout> layouts;
    for (size_t i = 0; i < plan_.passes.size(); ++i) {
        layouts.push_back(pipelines_[i]->set_layout);
        for (const PassBinding& b : plan_.passes[i].bindings)
            ++(b.kind == BindingKind::texel ? texel : storage);
    }
    if (plan_.passes.empty())
        return {};
    const VkDescriptorPoolSize sizes[] = {{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, std::max(storage, 1u)},
                                          {VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER, std::max(texel, 1u)}};
    auto pool = vk_struct<VkDescriptorPoolCreateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO);
    pool.maxSets = uint32_t(layouts.size());
    pool.poolSizeCount = 2;
    pool.pPoolSizes = sizes;
    SR_VK_MAKE(descriptors_,
               device_.vk().CreateDescriptorPool(device_.handle(), &pool, device_.vk().allocator(), &descriptors_));
    auto allocate = vk_struct<VkDescriptorSetAllocateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO);
    allocate.descriptorPool = descriptors_;
    allocate.descriptorSetCount = uint32_t(layouts.size());
    allocate.pSetLayouts = layouts.data();
    sets_.resize(layouts.size());
    SR_VK(device_.vk().AllocateDescriptorSets(device_.handle(), &allocate, sets_.data()));
    for (size_t i = 0; i < plan_.passes.size(); ++i)
        SR_CHECK(bind(plan_.passes[i], sets_[i]));
    return {};
}

Status Executable::bind(const Pass& pass, VkDescriptorSet set)
{
    const size_t n = pass.bindings.size();
    std::vector<VkWriteDescriptorSet> writes(n,
                                             vk_struct<VkWriteDescriptorSet>(VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET));
    std::vector<VkDescriptorBufferInfo> buffers(n);
    std::vector<VkBufferView> views(n);
    for (size_t i = 0; i < n; ++i) {
        const PassBinding& b = pass.bindings[i].given() ? pass.bindings[i] : stand_in(pass, i);
        const auto [buffer, offset] = locate(b);
        SR_ASSERT(offset % device_.limits().offset_alignment == 0, "{}: '{}' starts at byte {}", pass.kernel->name,
                  b.name, offset);
        writes[i].dstSet = set;
        writes[i].dstBinding = pass.variant->bindings[i].binding;
        writes[i].descriptorCount = 1;
        if (pass.bindings[i].kind == BindingKind::texel) {
            auto info = vk_struct<VkBufferViewCreateInfo>(VK_STRUCTURE_TYPE_BUFFER_VIEW_CREATE_INFO);
            info.buffer = buffer;
            info.format = VK_FORMAT_R32G32B32A32_UINT;
            info.offset = offset;
            info.range = b.bytes / 16 * 16;
            VkBufferView& view = views_.emplace_back(); // which has a place before it is made
            SR_VK_MAKE(view, device_.vk().CreateBufferView(device_.handle(), &info, device_.vk().allocator(), &view));
            views[i] = view;
            writes[i].descriptorType = VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER;
            writes[i].pTexelBufferView = &views[i];
        } else {
            buffers[i] = {buffer, offset, b.bytes};
            writes[i].descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
            writes[i].pBufferInfo = &buffers[i];
        }
    }
    device_.vk().UpdateDescriptorSets(device_.handle(), uint32_t(n), writes.data(), 0, nullptr);
    return {};
}

Status Executable::make_queries()
{
    if (!device_.profile() && !measuring_)
        return {};
    auto queries = vk_struct<VkQueryPoolCreateInfo>(VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO);
    queries.queryType = VK_QUERY_TYPE_TIMESTAMP;
    queries.queryCount = uint32_t(plan_.dispatches.size() * 2);
    SR_VK_MAKE(queries_, device_.vk().CreateQueryPool(device_.handle(), &queries, device_.vk().allocator(), &queries_));
    return {};
}

Status Executable::record()
{
    auto pool = vk_struct<VkCommandPoolCreateInfo>(VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO);
    pool.queueFamilyIndex = device_.queue_family();
    SR_VK_MAKE(commands_pool_,
               device_.vk().CreateCommandPool(device_.handle(), &pool, device_.vk().allocator(), &commands_pool_));
    commands_.resize(plan_.submits);
    recorded_ = commands_.empty();
    if (recorded_)
        return {};
    auto allocate = vk_struct<VkCommandBufferAllocateInfo>(VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO);
    allocate.commandPool = commands_pool_;
    allocate.commandBufferCount = plan_.submits;
    SR_VK(device_.vk().AllocateCommandBuffers(device_.handle(), &allocate, commands_.data()));
    for (uint32_t i = 0; i < plan_.submits; ++i)
        SR_CHECK(record_submit(i));
    recorded_ = true;
    return {};
}

Status Executable::record_submit(uint32_t index)
{
    const VkCommandBuffer commands = commands_[index];
    SR_CHECK(begin_commands(device_.vk(), commands, false));
    record_passes(commands, index, queries_ != VK_NULL_HANDLE);
    SR_VK(device_.vk().EndCommandBuffer(commands));
    return {};
}

void Executable::record_into(VkCommandBuffer commands) const
{
    for (uint32_t i = 0; i < plan_.submits; ++i)
        record_passes(commands, i, false);
}

void Executable::record_passes(VkCommandBuffer commands, uint32_t submit, bool timed) const
{
    uint32_t level = ~0u;
    for (size_t i = 0; i < plan_.dispatches.size(); ++i) {
        if (plan_.dispatches[i].submit != submit)
            continue;
        const Pass& pass = plan_.passes[plan_.dispatches[i].pass];
        if (level != ~0u && pass.level != level)
            record_barrier(device_.vk(), commands);
        level = pass.level;
        record_dispatch(commands, i, timed);
    }
    record_final_barrier(device_.vk(), commands);
}

// a pass, and what it reads and writes outside of the graph, such as its weights
std::string Executable::label_of(const Pass& pass) const
{
    std::string label = pass.name();
    for (const PassBinding& b : pass.bindings)
        if (b.given() && plan_.resources[b.resource].external)
            label += fmt::format(" {}", plan_.resources[b.resource].name);
    return label;
}

void Executable::record_dispatch(VkCommandBuffer commands, size_t index, bool timed) const
{
    const Dispatch& d = plan_.dispatches[index];
    const Pass& pass = plan_.passes[d.pass];
    const Pipeline& pipeline = *pipelines_[d.pass];
    const DebugLabel label(device_.vk(), commands, label_of(pass));
    device_.vk().CmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline.pipeline);
    device_.vk().CmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline.layout, 0, 1, &sets_[d.pass],
                                       0, nullptr);
    if (!pass.push.empty())
        device_.vk().CmdPushConstants(commands, pipeline.layout, VK_SHADER_STAGE_COMPUTE_BIT, 0,
                                      uint32_t(pass.push.size()), pass.push.data());
    const uint32_t query = uint32_t(index * 2);
    if (timed) {
        device_.vk().CmdResetQueryPool(commands, queries_, query, 2);
        device_.vk().CmdWriteTimestamp(commands, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, queries_, query);
    }
    if (d.base[0] || d.base[1] || d.base[2])
        device_.vk().CmdDispatchBase(commands, d.base[0], d.base[1], d.base[2], d.count[0], d.count[1], d.count[2]);
    else
        device_.vk().CmdDispatch(commands, d.count[0], d.count[1], d.count[2]);
    if (timed)
        device_.vk().CmdWriteTimestamp(commands, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, queries_, query + 1);
}

Result<uint64_t> Executable::submit()
{
    SR_CHECK(device_.check_cancelled());
    if (recorded_ && measuring_ && runs_ > 0)
        SR_CHECK(schedule_again());
    if (!recorded_)
        SR_CHECK(record_again());
    const auto begin = std::chrono::steady_clock::now();
    uint64_t ticket = device_.last_ticket();
    for (const VkCommandBuffer& commands : commands_) {
        SR_TRY(ticket, device_.submit({&commands, 1}));
    }
    host_us_ += std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - begin).count();
    ++runs_;
    return ticket;
}

Status Executable::run()
{
    SR_TRY(const uint64_t ticket, submit());
    SR_CHECK(device_.wait(ticket));
    return device_.profile() ? collect_profile() : Status{};
}

Result<std::vector<uint64_t>> Executable::stamps() const
{
    std::vector<uint64_t> out(plan_.dispatches.size() * 2);
    SR_VK(device_.vk().GetQueryPoolResults(device_.handle(), queries_, 0, uint32_t(out.size()), out.size() * 8,
                                           out.data(), 8, VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT));
    return out;
}

// by what the run before took, with the next alternatives to try
Status Executable::schedule_again()
{
    SR_CHECK(device_.wait(device_.last_ticket()));
    SR_TRY(const std::vector<uint64_t> stamps, stamps());
    std::vector<double> seconds(plan_.passes.size());
    for (size_t i = 0; i < plan_.dispatches.size(); ++i)
        if (stamps[2 * i + 1] > stamps[2 * i]) // counters of few bits begin again
            seconds[plan_.dispatches[i].pass] +=
                double(stamps[2 * i + 1] - stamps[2 * i]) * device_.timestamp_ns() / 1e9;
    for (size_t i = 0; i < plan_.passes.size(); ++i) {
        const Pass& pass = plan_.passes[i];
        device_.costs().learn(pass, seconds[i]);
        if (pass.options.max_flops > 0)
            seconds[i] = std::max(seconds[i], device_.costs().seconds(pass));
    }
    recorded_ = false; // what follows may fail
    if (autotuner_.running())
        SR_CHECK(autotuner_.next(plan_, seconds, device_.limits(), device_.tuning()));
    stage::submits(plan_, device_.limits(), seconds);
    measuring_ = autotuner_.running();
    return {};
}

// after the plan has changed, or where that could not be done the last time
Status Executable::record_again()
{
    SR_CHECK(device_.wait(device_.last_ticket()));
    SR_CHECK(get_pipelines());
    device_.vk().DestroyCommandPool(device_.handle(), commands_pool_, device_.vk().allocator());
    device_.vk().DestroyQueryPool(device_.handle(), queries_, device_.vk().allocator());
    commands_pool_ = VK_NULL_HANDLE;
    queries_ = VK_NULL_HANDLE;
    SR_CHECK(make_queries());
    return record();
}

Status Executable::collect_profile()
{
    if (!queries_ || !device_.profile())
        return {};
    SR_TRY(const std::vector<uint64_t> stamps, stamps());
    for (size_t i = 0; i < plan_.dispatches.size(); ++i) {
        const Dispatch& d = plan_.dispatches[i];
        const Pass& pass = plan_.passes[d.pass];
        const double begin = double(stamps[2 * i]) * device_.timestamp_ns() / 1e3;
        const double end = double(stamps[2 * i + 1]) * device_.timestamp_ns() / 1e3;
        const double part = double(d.count[0]) * d.count[1] * d.count[2] /
                            (double(pass.group_count[0]) * pass.group_count[1] * pass.group_count[2]);
        device_.profile()->add({pass.name(),
                                begin,
                                end - begin,
                                std::to_array(d.count),
                                pass.options.flops * part,
                                {pass.grid.tile.rows, pass.grid.tile.cols},
                                pipelines_[d.pass]->statistics});
    }
    return {};
}

} // namespace semrover
