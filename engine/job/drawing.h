// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/image.h"
#include "engine/format/ply.h"
#include "engine/job/job.h"
#include "engine/job/path_drawing.h"

#include <variant>

namespace semrover {

// what `render` does: splat buffers of a camera path, and a picture from above
struct DrawingOptions {
    std::variant<VoxelGrid, Surfels> scene;
    Path scene_name; // for errors
    CameraPath path; // without frames: nothing is driven
    ImageSize top;   // of top.png; 0 x 0: none
    Path folder;     // gets {color,depth,normal,label,visible}/000000.png, in folders of the cameras' names
    DrawOptions draw;
    bool floats = false;        // also {depth_expected,depth_median,alpha}/000000.npy
    bool visible_depth = false; // depth is 0 where a pixel is not visible
    bool allow_empty = false;   // it is no error if no frame sees anything
    // gets the colours of every frame of the path, [height, width, 3], when they arrive from the device; may be empty
    std::function<Status(const CameraFrame&, std::span<const uint8_t>)> picture;
};

// Stage "render" counts frames; a step is a moment of the path at least. Figures: frames, splats, skipped,
// peak_device_bytes, empty_frames, which see nothing: a warning, and bad_input when all frames are drawn and none sees
// anything. Errors: also bad_input for a grid without points; out_of_memory; device errors
Result<std::unique_ptr<Job>> begin_drawing(Device& device, DrawingOptions options, const JobCallbacks& callbacks);

} // namespace semrover
