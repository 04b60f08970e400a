// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/image.h"
#include "tools/dataset/picture_classes.h"

#include <map>
#include <string>

namespace semrover {

// pictures by what they are called among those of their kind: [CAMERA/]NNNNNN, without an ending, in order
using FrameFiles = std::map<std::string, Path>;

// The .png, .jpg and .jpeg files (of labels .npy, too) of a kind ("color", "depth", "label", "visible"): those in
// FOLDER/KIND, or in CAMERA/KIND of folders of cameras, as `render` and `streets` write them; colour also in
// FOLDER/frames, as `refine` writes it; else all in FOLDER and below. Errors: bad_input: no such folder, none in it,
// two of one name
Result<FrameFiles> list_frames(const Path& folder, std::string_view kind);

// bad_input unless `other` has a picture of each of these names; `exactly`: and no more
Status check_names(const FrameFiles& files, const Path& folder, const FrameFiles& other, const Path& other_folder,
                   bool exactly);

// the first channel of a picture, as 8 bits, [height, width]. Errors: bad_input, also for another size than `size`
Result<std::vector<uint8_t>> read_gray_frame(const Path& path, ImageSize size);
// classes, or kNoLabel; `map` counts the numbers that it looks up
Result<std::vector<uint8_t>> read_label_frame(const Path& path, ImageSize size, PictureClasses& map);
Result<ImageRgb8> read_color_frame(const Path& path, ImageSize size); // likewise; a width of 0: any size
Result<ImageGray16> read_depth_frame(const Path& path, ImageSize size);

} // namespace semrover
