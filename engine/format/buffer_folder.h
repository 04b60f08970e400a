// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/camera.h"
#include "engine/format/depth_picture.h"
#include "engine/shards/shard_set.h"

#include <string>

namespace semrover {

// the splat buffers of one camera: FOLDER/{color,visible}/000000.png and so on, as `render` writes them; colours may be
// JPEGs, 000000.jpg. The colour is
// over the background that `render` was given, black by default; where visible is 0 the renderer is not to trust it.
struct BufferCamera {
    std::string name; // empty: the folder's own pictures
    Path folder;
    ImageSize size;
    uint32_t frames = 0;             // 0 .. frames - 1
    double depth_unit = kMillimetre; // metres, of depth/
    ShardsOrNone shards = {};        // that the pictures are in
};

struct BufferFrame {
    std::vector<uint8_t> color;   // [height, width, 3]
    std::vector<uint8_t> visible; // [height, width] 0: not
};

// where the pictures of a camera go: those of one without a name into the folder itself
Path camera_folder(const Path& folder, const std::string& camera);
Path frame_path(const Path& folder, const char* kind, uint32_t number, std::string_view extension = "png");
// the one that is there of the formats a picture may have, else its path as a PNG. bad_input: it is there twice
Result<Path> find_picture(const Path& folder, const char* kind, uint32_t number);

// the cameras of a folder or of a shard set: itself when it has color/, else its sub-folders that have, by name; the
// unit of depth is what the folder's transforms.json says. Errors: bad_input for a gap in the numbers, for a picture in
// two formats, for colour without visibility, for pictures of another size than the first, and as open_if_shards()
Result<std::vector<BufferCamera>> open_buffers(const Path& folder);

// the cameras of a path, before their buffers exist
std::vector<BufferCamera> path_buffers(const Path& folder, const CameraPath& path, double depth_unit);
// bad_input where a folder's cameras, frames or sizes are not those of a path
Status check_against_path(std::span<const BufferCamera> cameras, const CameraPath& path);

Result<BufferFrame> read_buffer(const BufferCamera& camera, uint32_t frame);

// bad_input where it is not there or has another size
Result<DepthPicture> read_depth(const BufferCamera& camera, uint32_t frame);

// label colours, black where there is nothing: [height, width, 3]
Result<std::vector<uint8_t>> read_label_picture(const BufferCamera& camera, uint32_t frame);

// hash of the files of frames [first, last], of these kinds: "color", "visible", "depth"
Result<uint64_t> hash_pictures(const BufferCamera& camera, std::initializer_list<const char*> kinds, uint32_t first,
                               uint32_t last);

// "frame 3" or "frame 3 of camera 'front'"
std::string frame_text(const std::string& camera, uint32_t frame);

} // namespace semrover
