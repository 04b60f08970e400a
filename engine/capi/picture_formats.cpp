// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/capi/picture_formats.h"

#include <cmath>
#include <vulkan/vulkan_core.h>

namespace semrover::capi {

namespace {

struct KnownFormat {
    uint32_t format; // VkFormat
    Texels texels;
};
constexpr const char* kNames[] = {"color", "normal", "depth", "label", "instance"};
// what each picture can have, the first of them for 0
const std::array<std::vector<KnownFormat>, 5> kFormats = {{
    {{VK_FORMAT_R32G32B32A32_SFLOAT, Texels::whole},
     {VK_FORMAT_R16G16B16A16_SFLOAT, Texels::half4},
     {VK_FORMAT_R8G8B8A8_UNORM, Texels::unorm8},
     {VK_FORMAT_R8G8B8A8_SRGB, Texels::unorm8}},
    {{VK_FORMAT_R32G32B32A32_SFLOAT, Texels::whole},
     {VK_FORMAT_R16G16B16A16_SFLOAT, Texels::half4},
     {VK_FORMAT_R8G8B8A8_SNORM, Texels::snorm8}},
    {{VK_FORMAT_R32G32_SFLOAT, Texels::whole},
     {VK_FORMAT_R32_SFLOAT, Texels::float1},
     {VK_FORMAT_R16_SFLOAT, Texels::half1},
     {VK_FORMAT_D32_SFLOAT, Texels::float1}},
    {{VK_FORMAT_R32G32_UINT, Texels::whole}, {VK_FORMAT_R32_UINT, Texels::word}, {VK_FORMAT_R8_UINT, Texels::byte}},
    {{VK_FORMAT_R32_UINT, Texels::word}},
}};

Result<Texels> texels_of(const sr_target& target, size_t picture)
{
    if (target.reserved)
        return fail(ErrorCode::usage, "sr_draw_desc: reserved of {} is not 0", kNames[picture]);
    if (!target.memory && !target.buffer && !target.image)
        return Texels::none;
    if (!target.format)
        return kFormats[picture].front().texels;
    for (const KnownFormat& known : kFormats[picture])
        if (known.format == target.format)
            return known.texels;
    return fail(ErrorCode::usage, "sr_draw_desc: {} cannot have format {}", kNames[picture], target.format);
}

Status check_color(const sr_draw_desc& d, PictureFormat& color)
{
    if (d.color_linear > 1)
        return fail(ErrorCode::usage, "sr_draw_desc: color_linear is {}, expected 0 or 1", d.color_linear);
    if (!d.color_linear || color.texels == Texels::none)
        return {};
    if (d.color.format == VK_FORMAT_R8G8B8A8_SRGB)
        return fail(ErrorCode::usage, "sr_draw_desc: color of R8G8B8A8_SRGB cannot be linear");
    color.linear = true;
    if (color.texels == Texels::whole)
        color.texels = Texels::float4;
    return {};
}

Status check_depth(const sr_draw_desc& d, PictureFormat& depth)
{
    if (!std::isfinite(float(d.depth_scale)) || !std::isfinite(float(d.depth_offset)))
        return fail(ErrorCode::usage, "sr_draw_desc: depth_scale {} or depth_offset {} is not finite", d.depth_scale,
                    d.depth_offset);
    const bool scaled = float(d.depth_scale) != 0;
    if (!scaled && d.depth_offset != 0)
        return fail(ErrorCode::usage, "sr_draw_desc: depth_offset is {} without a depth_scale", d.depth_offset);
    if (!scaled && d.depth.format == VK_FORMAT_D32_SFLOAT && depth.texels != Texels::none)
        return fail(ErrorCode::usage, "sr_draw_desc: depth of D32_SFLOAT without a depth_scale");
    if (scaled && depth.texels == Texels::whole)
        return fail(ErrorCode::usage, "sr_draw_desc: depth of R32G32_SFLOAT has no depth_scale");
    depth.scaled = scaled && depth.texels != Texels::none;
    return {};
}

} // namespace

Result<PictureFormats> formats_of(const sr_draw_desc& draw)
{
    PictureFormats formats;
    const auto targets = targets_of(draw);
    for (size_t i = 0; i < formats.size(); ++i) {
        SR_TRY(formats[i].texels, texels_of(*targets[i], i));
    }
    SR_CHECK(check_color(draw, formats[0]));
    SR_CHECK(check_depth(draw, formats[2]));
    return formats;
}

uint64_t picture_bytes(const PictureFormat& format, const DeviceTensor& kept, uint32_t pixels)
{
    return format.texels == Texels::whole ? kept.bytes() : uint64_t(pixels) * texel_bytes(format.texels);
}

} // namespace semrover::capi
