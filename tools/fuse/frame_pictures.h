// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/camera.h"

#include <span>

namespace semrover {

// where the pictures of a frame lie; label, color and used empty: none
struct FramePictures {
    Path depth, label, color;
    Path used = {}; // 0: a pixel is left out
};

constexpr const char* kDepthMaps = "stereo/depth_maps"; // of a workspace of COLMAP's dense reconstruction
constexpr std::string_view kPictureEndings[] = {".png", ".jpg", ".jpeg", ".npy"};

// a path of a file, kept inside the folder; bad_input, with `where` in front
Result<Path> path_inside(const Path& folder, std::string_view text, std::string_view where);

// the file with this name and one of the endings that pictures of its kind have; the name itself where there is none
Path with_ending(Path picture);

// Pictures of frames that a path names (transforms.json, COLMAP) or that are numbered for each camera. A kind that has
// no folder has none. Errors: bad_input for names that lead outside the folder, and for more numbered pictures than
// poses; whether each file is there is not looked at
Result<std::vector<FramePictures>> find_pictures(const Path& folder, const Path& poses,
                                                 const std::vector<CameraFrame>& cameras);

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
Result<bool> has_timed_pictures(const Path& folder);

// Colours are those of rgb.txt, rgb/ or color/, labels those of label/; a kind that is not there has none.
// Errors: bad_input, also when no picture has a pose of its moment
Result<TimedFrames> find_timed_pictures(const Path& folder, const Path& poses, const std::vector<CameraFrame>& path);

} // namespace semrover
