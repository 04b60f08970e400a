// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/refine_store.h"

namespace semrover {

struct RefineVideos {
    Path frames;       // MP4 of the frames; empty: none
    Path side_by_side; // MP4 of label, buffer and frame beside each other; empty: none
    int frames_per_second = 10;

    bool any() const { return !frames.empty() || !side_by_side.empty(); }
};

// what write_videos will write: FILE.mp4 each, or FILE-CAMERA.mp4 when there are several cameras
std::vector<Path> video_files(const RefineVideos& videos, std::span<const RefinedCamera> cameras);

// from the finished frames of the store
Status write_videos(const RefineVideos& videos, const RefineStore& store, std::span<const RefinedCamera> cameras);

} // namespace semrover
