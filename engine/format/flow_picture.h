// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/file.h"
#include "runtime/base/result.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

namespace semrover {

// Files of optical flow. png: KITTI's, three numbers of 16 bits a pixel, 64 u + 2^15, 64 v + 2^15 and 1, or three zeros
// where the flow is not known or beyond 512 pixels. flo: Middlebury's, "PIEH", width, height, and u and v as float32,
// 1e10 where they are not known. Source: the development kits of KITTI 2015 and of vision.middlebury.edu/flow
enum class FlowFormat : uint8_t { png, flo };
constexpr std::array<std::string_view, 2> kFlowFormats = {"png", "flo"}; // which are extensions, too

// flow: [height, width, 2], pixels to the right and down; 1e9 and more: not known. Errors: bad_input for sizes
Result<std::vector<std::byte>> encode_flow(FlowFormat format, uint32_t width, uint32_t height,
                                           std::span<const float> flow, int png_level);

struct FlowPicture {
    uint32_t width = 0, height = 0;
    std::vector<float> flow; // [height, width, 2], as encode_flow takes it
};
// of KITTI's format. Errors: bad_input
Result<FlowPicture> read_flow_png(const Path& path);

} // namespace semrover
