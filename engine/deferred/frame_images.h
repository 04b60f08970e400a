// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/camera.h"
#include "engine/format/depth_picture.h"
#include "engine/format/picture_encoding.h"
#include "engine/splat/rasterizer.h"
#include "runtime/base/made_files.h"

namespace semrover {

// What splats look like in files, as the device makes it: PixelWords (kernels/picture.h). color: sRGB, over a
// background where the splats leave room; depth: as a DepthFormat along z, or from the camera where Lens::radial_depth
// says so, 0 for nothing and for what 16 bits do not hold; normal: camera frame, 128 + 127 n; label: class number, 255
// for nothing; visible: 0 or 255; instance: number of the thing, 0 for nothing.
struct FramePixels {
    uint32_t width = 0, height = 0;
    std::vector<uint32_t> seen = {}, depths = {}, normals = {};
    std::vector<uint32_t> instances = {}, flow = {},
                          flow_states = {}; // those that nobody asks for are empty; FlowTensors, as bits

    uint64_t bytes() const
    {
        return 12 * uint64_t(width) * height + 4 * (instances.size() + flow.size() + flow_states.size());
    }
};
std::vector<uint8_t> color_pixels(const FramePixels& pixels);   // [height, width, 3]
DepthPicture depth_picture(const FramePixels& pixels);          // of millimetres
std::vector<uint8_t> normal_pixels(const FramePixels& pixels);  // [height, width, 3]
std::vector<uint8_t> label_pixels(const FramePixels& pixels);   // [height, width]
std::vector<uint8_t> visible_pixels(const FramePixels& pixels); // [height, width]

// Label 10, sky, where a ray goes up and meets no splat: the world is a street under the open sky. Where a ray goes
// down and meets none, the label stays 255.
void mark_sky(FramePixels& pixels, const CameraFrame& frame);

void clear_hidden_depth(FramePixels& pixels); // 0 where a pixel is not visible

// FOLDER/{color,depth,normal,label,visible}/NNNNNN.png, colour and depth as they are encoded, and what pixels have
// beside: instance/NNNNNN.png, flow/NNNNNN.{png,flo}, flow_state/NNNNNN.png (FlowState). Errors: bad_input
Status make_frame_images(const Path& folder, uint32_t number, const FramePixels& pixels,
                         const PictureEncoding& encoding, MadeFiles& files);

} // namespace semrover
