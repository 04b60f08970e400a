// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/deferred/renderer_settings.h"

#include <gtest/gtest.h>

namespace semrover {
namespace engine_frame_windows_test {

using Windows = std::vector<FrameWindow>;

TEST(engine_frame_windows, overlap_by_what_was_asked_for_and_the_last_is_moved_back_until_it_is_full)
{
    EXPECT_EQ(frame_windows({0, 27}, 0, 12, 4), (Windows{{0, 12, 0}, {8, 12, 4}, {16, 12, 4}}));
    EXPECT_EQ(frame_windows({0, 29}, 0, 12, 4), (Windows{{0, 12, 0}, {8, 12, 4}, {16, 12, 4}, {18, 12, 10}}));
    EXPECT_EQ(frame_windows({0, 23}, 0, 12, 0), (Windows{{0, 12, 0}, {12, 12, 0}}));
    EXPECT_EQ(frame_windows({0, 12}, 0, 12, 0), (Windows{{0, 12, 0}, {1, 12, 11}}));
    EXPECT_EQ(frame_windows({5, 7}, 0, 12, 4), (Windows{{5, 3, 0}})); // there are no more
    EXPECT_EQ(frame_windows({3, 5}, 0, 1, 0), (Windows{{3, 1, 0}, {4, 1, 0}, {5, 1, 0}}));
}

TEST(engine_frame_windows, every_frame_is_made_once_after_those_that_its_window_knows)
{
    for (uint32_t length = 1; length <= 7; ++length)
        for (uint32_t overlap = 0; overlap < length; ++overlap)
            for (uint32_t count = 1; count <= 20; ++count)
                for (const uint32_t before : {0u, 2u}) {
                    const FrameRange range{2, 1 + count};
                    uint32_t next = range.first;
                    for (const FrameWindow& w : frame_windows(range, before, length, overlap)) {
                        EXPECT_EQ(w.next(), next);
                        EXPECT_GE(w.first, range.first - before);
                        EXPECT_EQ(w.count, std::min(length, range.count() + before)) << length << " " << overlap;
                        EXPECT_GE(w.known, std::min(overlap, next - (range.first - before)));
                        next = w.end();
                    }
                    EXPECT_EQ(next, range.last + 1);
                }
}

// from the frame after a window on, they are those of the whole drive
TEST(engine_frame_windows, that_go_on_after_a_window_are_those_of_the_whole_drive)
{
    const Windows whole = frame_windows({0, 33}, 0, 12, 4);
    for (size_t i = 1; i < whole.size(); ++i) {
        const uint32_t first = whole[i].next();
        EXPECT_EQ(frame_windows({first, 33}, std::min(first, 11u), 12, 4),
                  Windows(whole.begin() + std::ptrdiff_t(i), whole.end()));
    }
}

TEST(engine_frame_windows, are_decoded_in_parts_that_begin_with_a_frame_before_them)
{
    EXPECT_EQ(decode_windows({0, 12, 0}, 4), (Windows{{0, 4, 0}, {3, 4, 1}, {6, 4, 1}, {8, 4, 2}}));
    EXPECT_EQ(decode_windows({8, 12, 4}, 4), (Windows{{11, 4, 1}, {14, 4, 1}, {16, 4, 2}}));
    EXPECT_EQ(decode_windows({8, 12, 4}, 12), (Windows{{8, 12, 4}}));
    EXPECT_EQ(decode_windows({7, 1, 0}, 1), (Windows{{7, 1, 0}}));
}

} // namespace engine_frame_windows_test
} // namespace semrover
