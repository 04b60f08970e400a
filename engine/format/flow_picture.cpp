// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/flow_picture.h"

#include "engine/format/image.h"

#include <cmath>
#include <cstring>

namespace semrover {

namespace {

constexpr float kUnknownFlow = 1e10f;

// 64 v + 2^15; 0: it does not fit
uint16_t kitti_number(float v)
{
    const float number = std::round(64 * v + 32768);
    return number >= 1 && number <= 65535 ? uint16_t(number) : uint16_t(0);
}

std::vector<std::byte> encode_flo(uint32_t width, uint32_t height, std::span<const float> flow)
{
    std::vector<std::byte> file(12 + flow.size_bytes());
    std::memcpy(file.data(), "PIEH", 4);
    std::memcpy(file.data() + 4, &width, 4);
    std::memcpy(file.data() + 8, &height, 4);
    std::memcpy(file.data() + 12, flow.data(), flow.size_bytes());
    return file;
}

} // namespace

Result<std::vector<std::byte>> encode_flow(FlowFormat format, uint32_t width, uint32_t height,
                                           std::span<const float> flow, int png_level)
{
    SR_ASSERT(flow.size() == size_t(width) * height * 2, "flow of {} x {} pixels given with {} numbers", width, height,
              flow.size());
    if (format == FlowFormat::flo)
        return encode_flo(width, height, flow);
    std::vector<uint16_t> pixels;
    pixels.reserve(flow.size() / 2 * 3);
    for (size_t i = 0; i < flow.size(); i += 2) {
        const uint16_t u = kitti_number(flow[i]), v = kitti_number(flow[i + 1]);
        const bool known = u && v;
        pixels.insert(pixels.end(), {uint16_t(known ? u : 0), uint16_t(known ? v : 0), uint16_t(known)});
    }
    return encode_png_rgb16(width, height, pixels, png_level);
}

Result<FlowPicture> read_flow_png(const Path& path)
{
    SR_TRY(const ImageRgb16 image, read_png_rgb16(path));
    FlowPicture picture{image.width, image.height, {}};
    picture.flow.reserve(image.pixels.size() / 3 * 2);
    for (size_t i = 0; i < image.pixels.size(); i += 3)
        for (size_t c = 0; c < 2; ++c)
            picture.flow.push_back(image.pixels[i + 2] ? (float(image.pixels[i + c]) - 32768) / 64 : kUnknownFlow);
    return picture;
}

} // namespace semrover
