// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/fuse/frame_pictures.h"

#include <span>

namespace semrover {

constexpr double kSameMoment = 0.02; // seconds, as in TUM RGB-D's associate.py

// Indices of times of `a` and `b` that differ by less than `within`, the closest pairs first, each used once; in the
// order of `a`. Both are sorted. bad_input where more than 2^22 pairs are that close
Result<std::vector<std::pair<size_t, size_t>>> associate_times(std::span<const double> a, std::span<const double> b,
                                                               double within = kSameMoment);

// frames whose pictures are named by time, and the poses nearest to them
struct TimedFrames {
    std::vector<CameraFrame> cameras;
    std::vector<FramePictures> pictures;
    size_t depths = 0; // pictures in depth/: those without a pose, a colour or a label of their moment are not frames
};

// Whether a folder holds depth pictures that are named by time: depth.txt lists `time path` as TUM RGB-D's does, or the
// names in depth/ are seconds with a point
bool has_timed_pictures(const Path& folder);

// Colours are those of rgb.txt, rgb/ or color/, labels those of label/; a kind that is not there has none.
// Errors: bad_input, also when no picture has a pose of its moment
Result<TimedFrames> find_timed_pictures(const Path& folder, const Path& poses, const std::vector<CameraFrame>& path);

} // namespace semrover
