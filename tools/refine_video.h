// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/refine_store.h"
#include "engine/refine/refine_chain.h"

namespace semrover {

struct RefineVideos {
    Path frames;       // MP4 of the frames; empty: none
    Path side_by_side; // MP4 of label, buffer and frame beside each other; empty: none
    int frames_per_second = 10;

    bool any() const { return !frames.empty() || !side_by_side.empty(); }
};

// FILE.mp4, or FILE-CAMERA.mp4 when there are several cameras
Path video_path(const Path& file, const std::string& camera, size_t cameras);

// from the finished frames of the store
Status write_videos(const RefineVideos& videos, const RefineStore& store, std::span<const RefineChain> chains);

} // namespace semrover
