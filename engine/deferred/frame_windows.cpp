// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/deferred/frame_windows.h"

#include "runtime/base/result.h"

#include <algorithm>

namespace semrover {

std::vector<FrameWindow> frame_windows(const FrameRange& range, uint32_t before, uint32_t length, uint32_t overlap)
{
    SR_ASSERT(overlap < length && before <= range.first, "windows of {} frames that overlap by {}, {} frames before {}",
              length, overlap, before, range.first);
    const uint32_t lowest = range.first - before, end = range.last + 1;
    std::vector<FrameWindow> windows;
    for (uint32_t next = range.first; next < end;) {
        uint32_t first = next - std::min(overlap, next - lowest);
        if (first + length > end)
            first = std::max(lowest, end - std::min(length, end));
        const uint32_t count = std::min(length, end - first);
        windows.push_back({first, count, next - first});
        next = first + count;
    }
    return windows;
}

std::vector<FrameWindow> decode_windows(const FrameWindow& window, uint32_t length)
{
    constexpr uint32_t kOverlap = 1; // frames that a decoder of videos sees before those that are kept
    return frame_windows({window.next(), window.end() - 1}, window.known, length, std::min(kOverlap, length - 1));
}

} // namespace semrover
