// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/image.h"
#include "engine/format/lidar_points.h"
#include "engine/format/ply.h"
#include "engine/job/job.h"
#include "engine/job/path_drawing.h"

#include <variant>

namespace semrover {

// what `render` does: splat buffers of a camera path, and a picture from above
struct DrawingOptions {
    std::variant<VoxelGrid, Splats> scene;
    Path scene_name; // for errors
    CameraPath path; // without frames: nothing is driven
    ImageSize top;   // of top.png; 0 x 0: none
    Path folder;     // gets {color,depth,normal,label,visible}/000000.png, in folders of the cameras' names, and
                     // transforms.json of the path; of a lidar's sweeps LIDAR/points/000000.npy and LIDAR/sweeps.json
    bool replace = false; // what is there
    DrawOptions draw;
    PictureEncoding encoding;
    LidarFormat lidar = LidarFormat::npy;
    uint32_t threads = 0;       // that make files; 0: usable_threads()
    bool floats = false;        // also {depth_expected,depth_median,alpha}/000000.npy
    bool points = false;        // also points.ply, the scene's points or splats
    bool visible_depth = false; // depth is 0 where a pixel is not visible
    bool allow_empty = false;   // it is no error if no frame sees anything
    // gets the colours of every frame of the path in order, [height, width, 3]; of one that an earlier start has drawn,
    // too; may be empty
    std::function<Status(const CameraFrame&, std::span<const uint8_t>)> picture;
};

// usage: what is in the folder and would be replaced
Status check_drawing_outputs(const DrawingOptions& options);

// Stage "render" counts frames and sweeps; a step is a moment of the path at least. What is done is in the folder:
// begun again after a cancel or a kill, the job draws what is missing, to the same bytes; one that is done draws
// nothing. Figures: output, frames, sweeps, splats, skipped, peak_device_bytes, seconds and, of them,
// file_wait_seconds, in which nothing could be drawn as files waited to be made; empty_frames, which see nothing: a
// warning, and bad_input when all frames are drawn and none sees anything. Errors: as check_drawing_outputs; bad_input
// for a grid without points, and for another drawing in the folder; out_of_memory; device errors
Result<std::unique_ptr<Job>> begin_drawing(Device& device, DrawingOptions options, const JobCallbacks& callbacks);

} // namespace semrover
