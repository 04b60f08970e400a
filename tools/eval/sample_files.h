// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/depth_picture.h"
#include "engine/scene/scene_points.h"
#include "engine/shards/shard_set.h"
#include "runtime/base/file.h"
#include "tools/dataset/picture_classes.h"

#include <map>
#include <string>

namespace semrover {

// The images of a folder (or of a shard set that is open), sorted by path: all .png, .jpg and .jpeg files in it and
// below. Of a folder that `refine` wrote only those in frames/, of one that `render` wrote only those in color/ (of
// every camera), since depth, labels and the like are no pictures. Errors, bad_input: no such folder, none in it
Result<std::vector<Path>> list_images(const Path& folder);
// whatever the names of folders; `arrays`: and .npy files
Result<std::vector<Path>> list_all_images(const Path& folder, bool arrays = false);

// a PNG or JPEG by its name's ending; bad_input as read_png_rgb8() and read_jpeg_rgb8()
Result<ImageRgb8> read_image(const Path& path);

// Grids, or clouds of points: one .sgrid or .ply file, all .sgrid of a folder and below, sorted (else all .ply), or
// those that a .txt file names, one a line, relative to it. Errors, bad_input: nothing there, or a name in the list
// that does not exist
Result<std::vector<Path>> list_grids(const Path& path);

// points of anybody: lidar, reconstructions, splats' centres
struct PointCloud {
    std::vector<std::array<double, 3>> positions; // metres
    std::vector<std::array<float, 3>> colors;     // sRGB, 0..1; empty: none
    uint64_t dropped = 0;                         // that are not finite
};

// Whether a file is a PLY without faces. bad_input for a PLY that is broken
Result<bool> is_cloud(const Path& path);

// Vertices of a PLY: x y z and, where they are there, red green blue (8 bits, 16 bits if any is above 255, floats of 0
// to 1) or the colours of Gaussian splats (f_dc_0..2). bad_input: other colours, no points, a mesh with faces
Result<PointCloud> read_cloud(const Path& path);

// the points of a grid, or of a cloud (`dropped` counts those that are not finite); without labels. bad_input: as
// above, a grid without points, a cloud beyond 100 km, where floats are too coarse
struct PointFile {
    ScenePoints points; // colours are empty where a cloud has none
    uint64_t dropped = 0;
};
Result<PointFile> read_points(const Path& path);

// pictures by what they are called among those of their kind: [CAMERA/]NNNNNN, without an ending, in order
struct FrameFiles : std::map<std::string, Path> {
    ShardsOrNone shards; // that they are in
};

// The .png, .jpg and .jpeg files (of labels and depth .npy, too) of a kind ("color", "depth", "label", "flow", ...):
// those in FOLDER/KIND, or in CAMERA/KIND of folders of cameras, as `render` and `streets` write them; colour also in
// FOLDER/frames, as `refine` writes it; else all in FOLDER and below; FOLDER may be a shard set, or in one. Errors:
// bad_input: no such folder, none in it, two of one name, and as open_if_shards()
Result<FrameFiles> list_frames(const Path& folder, std::string_view kind);

// metres of a unit of the depth pictures that list_frames() finds there, as read_depth_unit() says it
Result<double> depth_unit_of(const Path& folder);

// bad_input unless `other` has a picture of each of these names; `exactly`: and no more
Status check_names(const FrameFiles& files, const Path& folder, const FrameFiles& other, const Path& other_folder,
                   bool exactly);

// the first channel of a picture, as 8 bits, [height, width]. Errors: bad_input, also for another size than `size`
Result<std::vector<uint8_t>> read_gray_frame(const Path& path, ImageSize size);
// classes, or kNoLabel; `map` counts the numbers that it looks up
Result<std::vector<uint8_t>> read_label_frame(const Path& path, ImageSize size, PictureClasses& map);
Result<ImageRgb8> read_color_frame(const Path& path, ImageSize size); // likewise; a width of 0: any size
// numbers of things, 0: none; a PNG of 16-bit gray
Result<std::vector<uint16_t>> read_instance_frame(const Path& path, ImageSize size);
Result<DepthPicture> read_depth_frame(const Path& path, ImageSize size, double unit); // of read_depth_picture()

} // namespace semrover
