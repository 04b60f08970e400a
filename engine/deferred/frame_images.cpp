// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/deferred/frame_images.h"

#include "engine/camera/camera_view.h"
#include "engine/format/npy.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

namespace semrover {

namespace {

constexpr uint32_t kNothing = 255, kSky = 10; // of a picture

constexpr uint32_t kSkyBlock = 16; // pixels

// which way the rays of a camera go; a lens takes long to ask for every pixel
class SkySide {
  public:
    explicit SkySide(const CameraFrame& frame) : view_(frame) {}

    // how far up the unit ray through a position goes; NaN where the lens does not look
    double up(double x, double y) const
    {
        const auto ray = view_.direction(x, y);
        return ray ? (*ray)[2] : std::nan("");
    }
    // of all rays of a block, where they are farther from the horizon than its corners are apart
    std::optional<bool> of_block(uint32_t left, uint32_t top, uint32_t right, uint32_t bottom) const
    {
        const std::array<double, 4> corners = {up(left, top), up(right, top), up(left, bottom), up(right, bottom)};
        const auto [low, high] = std::ranges::minmax(corners);
        const bool seen = std::ranges::none_of(corners, [](double c) { return std::isnan(c); });
        if (seen && std::min(std::abs(low), std::abs(high)) > high - low && (low > 0) == (high > 0))
            return low > 0;
        return std::nullopt;
    }

  private:
    CameraView view_;
};

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

Result<std::vector<std::byte>> encode_depth(const FramePixels& pixels, const PictureEncoding& encoding)
{
    const uint32_t w = pixels.width, h = pixels.height;
    if (encoding.depth != DepthFormat::npy)
        return encode_png_gray16(w, h, shifted<uint16_t>(pixels.depths, 0), encoding.png_level);
    const auto metres = std::as_bytes(std::span(pixels.depths));
    return encode_npy({DType::f32, {h, w}, {metres.begin(), metres.end()}});
}

} // namespace

std::vector<uint8_t> color_pixels(const FramePixels& pixels)
{
    return three_bytes(pixels.seen);
}

DepthPicture depth_picture(const FramePixels& pixels)
{
    return {pixels.width, pixels.height, pixels.depths};
}

std::vector<uint8_t> normal_pixels(const FramePixels& pixels)
{
    return three_bytes(pixels.normals);
}

std::vector<uint8_t> label_pixels(const FramePixels& pixels)
{
    return shifted<uint8_t>(pixels.normals, 24);
}

std::vector<uint8_t> visible_pixels(const FramePixels& pixels)
{
    return shifted<uint8_t>(pixels.seen, 24);
}

void mark_sky(FramePixels& pixels, const CameraFrame& frame)
{
    const SkySide side(frame);
    for (uint32_t y = 0; y < pixels.height; y += kSkyBlock)
        for (uint32_t x = 0; x < pixels.width; x += kSkyBlock) {
            const uint32_t right = std::min(x + kSkyBlock, pixels.width),
                           bottom = std::min(y + kSkyBlock, pixels.height);
            const std::optional<bool> whole = side.of_block(x, y, right, bottom);
            for (uint32_t row = y; row < bottom; ++row)
                for (uint32_t column = x; column < right; ++column) {
                    uint32_t& word = pixels.normals[size_t(row) * pixels.width + column];
                    if (word >> 24 == kNothing && (whole ? *whole : side.up(column + 0.5, row + 0.5) > 0))
                        word = (word & 0xffffff) | kSky << 24;
                }
        }
}

void clear_hidden_depth(FramePixels& pixels)
{
    for (size_t i = 0; i < pixels.depths.size(); ++i)
        if (pixels.seen[i] >> 24 == 0)
            pixels.depths[i] = 0;
}

Status make_frame_images(const Path& folder, uint32_t number, const FramePixels& pixels,
                         const PictureEncoding& encoding, MadeFiles& files)
{
    const uint32_t w = pixels.width, h = pixels.height;
    const int level = encoding.png_level;
    const auto add = [&](const char* kind, std::string_view extension,
                         const Result<std::vector<std::byte>>& bytes) -> Status {
        SR_CHECK(bytes);
        return files.add(folder / kind / fmt::format("{:06}.{}", number, extension), *bytes);
    };
    SR_CHECK(add("color", encoding.color_extension(), encode_color(encoding, {w, h}, color_pixels(pixels))));
    SR_CHECK(add("depth", encoding.depth_extension(), encode_depth(pixels, encoding)));
    SR_CHECK(add("normal", "png", encode_png_rgb8(w, h, normal_pixels(pixels), level)));
    SR_CHECK(add("label", "png", encode_png_gray8(w, h, label_pixels(pixels), level)));
    SR_CHECK(add("visible", "png", encode_png_gray8(w, h, visible_pixels(pixels), level)));
    if (!pixels.instances.empty())
        SR_CHECK(add("instance", "png", encode_png_gray16(w, h, shifted<uint16_t>(pixels.instances, 0), level)));
    if (!encoding.flow || pixels.flow.empty())
        return {};
    std::vector<float> flow(pixels.flow.size());
    std::memcpy(flow.data(), pixels.flow.data(), flow.size() * sizeof(float));
    SR_CHECK(add("flow", kFlowFormats[size_t(*encoding.flow)], encode_flow(*encoding.flow, w, h, flow, level)));
    return add("flow_state", "png", encode_png_gray8(w, h, shifted<uint8_t>(pixels.flow_states, 0), level));
}

} // namespace semrover
