// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/refine/frame_images.h"

#include "engine/format/image.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

uint8_t to_byte(float v)
{
    return uint8_t(std::lround(std::clamp(v, 0.f, 1.f) * 255));
}

} // namespace

std::vector<uint8_t> color_pixels(const SplatImage& image, const std::array<uint8_t, 3>& background)
{
    std::vector<uint8_t> out(image.color.size());
    for (size_t i = 0; i < image.alpha.size(); ++i)
        for (size_t c = 0; c < 3; ++c)
            out[3 * i + c] = to_byte(image.color[3 * i + c] + (1 - image.alpha[i]) * float(background[c]) / 255);
    return out;
}

std::vector<uint16_t> depth_pixels(const SplatImage& image)
{
    std::vector<uint16_t> out(image.depth_expected.size());
    for (size_t i = 0; i < out.size(); ++i)
        out[i] = uint16_t(std::lround(std::clamp(image.depth_expected[i] * 1000.f, 0.f, 65535.f)));
    return out;
}

std::vector<uint8_t> normal_pixels(const SplatImage& image)
{
    std::vector<uint8_t> out(image.normal.size());
    for (size_t i = 0; i < image.alpha.size(); ++i) {
        const float* n = &image.normal[3 * i];
        const float length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
        for (size_t c = 0; c < 3; ++c)
            out[3 * i + c] = uint8_t(std::lround(128 + (length > 0 ? 127 * n[c] / length : 0)));
    }
    return out;
}

std::vector<uint8_t> label_pixels(const SplatImage& image)
{
    std::vector<uint8_t> out(image.label.size());
    for (size_t i = 0; i < out.size(); ++i)
        out[i] = uint8_t(std::min<uint32_t>(image.label[i], 255));
    return out;
}

std::vector<uint8_t> visible_pixels(const SplatImage& image)
{
    std::vector<uint8_t> out(image.visible.size());
    for (size_t i = 0; i < out.size(); ++i)
        out[i] = image.visible[i] ? 255 : 0;
    return out;
}

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
