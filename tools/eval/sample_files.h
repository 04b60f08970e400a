// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/image.h"

namespace semrover {

// The images of a folder, sorted by path: all .png, .jpg and .jpeg files in it and below. Of a folder that `refine`
// wrote only those in frames/, of one that `render` wrote only those in color/ (of every camera), since depth, labels
// and the like are no pictures. Errors, bad_input: no such folder, none in it
Result<std::vector<Path>> list_images(const Path& folder);
// whatever the names of folders; `arrays`: and .npy files
Result<std::vector<Path>> list_all_images(const Path& folder, bool arrays = false);

// a PNG or JPEG by its name's ending; bad_input as read_png_rgb8() and read_jpeg_rgb8()
Result<ImageRgb8> read_image(const Path& path);

// Grids, or clouds of points: one .sgrid or .ply file, all .sgrid of a folder and below, sorted (else all .ply), or
// those that a .txt file names, one a line, relative to it. Errors, bad_input: nothing there, or a name in the list
// that does not exist
Result<std::vector<Path>> list_grids(const Path& path);

} // namespace semrover
