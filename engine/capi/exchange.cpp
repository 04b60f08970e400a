// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/capi/exchange.h"

#include <limits>

namespace semrover::capi {

namespace {

VkImageAspectFlags aspect_of(uint32_t format)
{
    return format == VK_FORMAT_D32_SFLOAT ? VK_IMAGE_ASPECT_DEPTH_BIT : VK_IMAGE_ASPECT_COLOR_BIT;
}

} // namespace

Result<ExternalCopies*> copies_of(sr_context& context)
{
    if (!context.copies) {
        SR_TRY(context.copies, ExternalCopies::create(*context.drawing));
    }
    return context.copies.get();
}

JobBudget timed_budget(uint64_t microseconds)
{
    return {.submits = ~0u, .microseconds = std::min<uint64_t>(microseconds, 1ull << 60)};
}

Status check_size(const ImageSize& size, const char* name)
{
    if (size.width < 1 || size.height < 1 || size.width > kMostPixels || size.height > kMostPixels)
        return fail(ErrorCode::usage, "{}: {} x {} pixels; 1 to {} are possible", name, size.width, size.height,
                    kMostPixels);
    return {};
}

Status hand_over(sr_context& context, std::span<const WantedPicture> pictures)
{
    std::vector<BufferSlice> read;
    std::vector<std::byte*> memory; // of these
    std::vector<ExternalCopy> copied;
    for (const auto& [pixels, target, size] : pictures) {
        if (target->memory) {
            read.push_back(pixels);
            memory.push_back(static_cast<std::byte*>(target->memory));
        }
        if (target->buffer || target->image)
            copied.push_back({pixels, external_target(*target, size)});
    }
    if (!read.empty())
        SR_CHECK(context.drawing->read(
            read, [&](const ReadPiece& piece) { std::ranges::copy(piece.bytes, memory[piece.slice] + piece.at); }));
    if (copied.empty())
        return {};
    SR_TRY(ExternalCopies * copies, copies_of(context));
    return copies->copy(copied);
}

ExternalTarget external_target(const sr_target& to, const ImageSize& size)
{
    ExternalTarget target{.buffer = to.buffer, .offset = to.buffer_offset};
    target.image = {to.image,
                    size.width,
                    size.height,
                    VkImageLayout(to.layout_before),
                    VkImageLayout(to.layout_after),
                    aspect_of(to.format)};
    return target;
}

std::vector<WantedPicture> wanted_pictures(const sr_draw_desc& draw, const PictureFormats& formats, SplatSlots kept)
{
    std::vector<WantedPicture> wanted;
    const auto targets = targets_of(draw);
    const auto slots = kept.all();
    for (size_t i = 0; i < slots.size(); ++i)
        if (slots[i]->valid())
            wanted.push_back({slots[i]->slice().part(0, picture_bytes(formats[i], *slots[i], draw.width * draw.height)),
                              targets[i],
                              {draw.width, draw.height}});
    return wanted;
}

Result<ExternalImage> external_depth(const sr_depth_image& d, const ImageSize& size)
{
    if (d.format != VK_FORMAT_D32_SFLOAT && d.format != VK_FORMAT_R32_SFLOAT)
        return fail(ErrorCode::usage, "sr_depth_image: format {} is neither D32_SFLOAT nor R32_SFLOAT", d.format);
    if (d.layout_before == VK_IMAGE_LAYOUT_UNDEFINED || d.layout_after == VK_IMAGE_LAYOUT_UNDEFINED || d.reserved)
        return fail(ErrorCode::usage, "sr_depth_image: {}", d.reserved ? "reserved is not 0" : "a layout is UNDEFINED");
    constexpr double most = std::numeric_limits<float>::max();
    SR_CHECK(number_in(d.scale, -most, most, "sr_depth_image", "scale").map([](double) {}));
    SR_CHECK(number_in(d.offset, -most, most, "sr_depth_image", "offset").map([](double) {}));
    return ExternalImage{d.image,
                         size.width,
                         size.height,
                         VkImageLayout(d.layout_before),
                         VkImageLayout(d.layout_after),
                         aspect_of(d.format)};
}

std::array<float, 2> z_scale(const sr_depth_image& d)
{
    return {float(d.scale), float(d.offset)};
}

std::array<float, 2> depth_scale(const sr_draw_desc& d)
{
    return {float(d.depth_scale), float(d.depth_offset)};
}

Status take_in(sr_context& context, const sr_source& from, const DeviceTensor& to, uint64_t bytes, const char* name)
{
    if (!from.memory == !from.buffer)
        return fail(ErrorCode::usage, "{}: one of memory and buffer must be given", name);
    const BufferSlice slice = to.slice().part(0, bytes);
    if (from.memory)
        return context.device->write(slice, {static_cast<const std::byte*>(from.memory), size_t(bytes)});
    SR_TRY(ExternalCopies * copies, copies_of(context));
    return copies->fetch(from.buffer, from.buffer_offset, slice);
}

Result<SplatPool*> splats_of(const sr_world& world, const char* name)
{
    SplatPool* splats = world.world->splats();
    if (!splats)
        return fail(ErrorCode::usage, "{}: the world was created without splat_bytes", name);
    return splats;
}

} // namespace semrover::capi
