// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/refine/frame_images.h"

#include "engine/format/image.h"

#include <algorithm>

namespace semrover {

namespace {

std::vector<uint8_t> three_bytes(std::span<const uint32_t> words)
{
    std::vector<uint8_t> bytes;
    bytes.reserve(words.size() * 3);
    for (const uint32_t word : words)
        bytes.insert(bytes.end(), {uint8_t(word), uint8_t(word >> 8), uint8_t(word >> 16)});
    return bytes;
}

template <typename T>
std::vector<T> shifted(std::span<const uint32_t> words, uint32_t shift)
{
    std::vector<T> values(words.size());
    std::ranges::transform(words, values.begin(), [&](uint32_t word) { return T(word >> shift); });
    return values;
}

} // namespace

std::vector<uint8_t> color_pixels(const FramePixels& pixels)
{
    return three_bytes(pixels.seen);
}

std::vector<uint16_t> depth_pixels(const FramePixels& pixels)
{
    return shifted<uint16_t>(pixels.ranges, 0);
}

std::vector<uint8_t> normal_pixels(const FramePixels& pixels)
{
    return three_bytes(pixels.normals);
}

std::vector<uint8_t> label_pixels(const FramePixels& pixels)
{
    return shifted<uint8_t>(pixels.ranges, 16);
}

std::vector<uint8_t> visible_pixels(const FramePixels& pixels)
{
    return shifted<uint8_t>(pixels.seen, 24);
}

void clear_hidden_depth(FramePixels& pixels)
{
    for (size_t i = 0; i < pixels.ranges.size(); ++i)
        if (pixels.seen[i] >> 24 == 0)
            pixels.ranges[i] &= 0xffff0000u;
}

Status write_frame_images(const Path& folder, uint32_t number, const FramePixels& pixels)
{
    const std::string name = fmt::format("{:06}.png", number);
    for (const char* kind : {"color", "depth", "normal", "label", "visible"})
        SR_CHECK(make_folder(folder / kind));
    const uint32_t w = pixels.width, h = pixels.height;
    SR_CHECK(write_png_rgb8(folder / "color" / name, w, h, color_pixels(pixels)));
    SR_CHECK(write_png_gray16(folder / "depth" / name, w, h, depth_pixels(pixels)));
    SR_CHECK(write_png_rgb8(folder / "normal" / name, w, h, normal_pixels(pixels)));
    SR_CHECK(write_png_gray8(folder / "label" / name, w, h, label_pixels(pixels)));
    return write_png_gray8(folder / "visible" / name, w, h, visible_pixels(pixels));
}

} // namespace semrover
