// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

namespace semrover {

// frames of a camera that a run refines, first and last included
struct FrameRange {
    uint32_t first = 0, last = 0;

    uint32_t count() const { return last - first + 1; }
};

// Frames that are worked on together. The first `known` of them are done already.
struct FrameWindow {
    uint32_t first = 0, count = 1, known = 0;

    uint32_t next() const { return first + known; } // the first frame that the window makes
    uint32_t end() const { return first + count; }
    uint32_t made() const { return count - known; }
    bool operator==(const FrameWindow&) const = default;
};

// How a trajectory is cut: windows of `frames`, which begin `overlap` frames before the first one that is new. Frames
// are decoded `decode_frames` at a time.
struct WindowShape {
    uint32_t frames = 1, overlap = 0, decode_frames = 1; // frame by frame
};

// Cuts a range into windows of `length` frames. Each begins `overlap` (below `length`) frames before the first one that
// it makes; `before` frames in front of the range are done already. The last window is moved back until it is full. So
// all have the same length: `length`, or less where there are not so many frames.
std::vector<FrameWindow> frame_windows(const FrameRange& range, uint32_t before, uint32_t length, uint32_t overlap);

// The windows that the frames which `window` makes are decoded in, `length` at a time: the first frames of each are
// decoded for those after them, and not kept.
std::vector<FrameWindow> decode_windows(const FrameWindow& window, uint32_t length);

} // namespace semrover
