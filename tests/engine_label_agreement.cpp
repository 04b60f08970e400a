// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/eval/label_agreement.h"

#include <gtest/gtest.h>
#include <random>
#include <vector>

namespace semrover {
namespace engine_label_agreement_test {

TEST(EngineLabelAgreement, intersection_over_union_by_hand)
{
    // class 0 once right, once shown as 2 and once as nothing; class 1 right; where the truth is nothing, nothing
    // counts
    const std::vector<uint8_t> frame = {0, 2, 255, 1, 4, 0}, truth = {0, 0, 0, 1, 255, 255};
    const LabelAgreement a = label_agreement(frame, truth);
    EXPECT_EQ(a.counted(), 4u);
    EXPECT_EQ(a.unlabelled, 2u);
    EXPECT_DOUBLE_EQ(*a.iou(0), 1. / 3);
    EXPECT_DOUBLE_EQ(*a.iou(1), 1);
    EXPECT_DOUBLE_EQ(*a.iou(2), 0); // shown only: it is in the mean
    EXPECT_FALSE(a.iou(4));         // shown only where the truth is nothing
    EXPECT_FALSE(a.iou(3));
    EXPECT_EQ(a.classes(), 3u);
    EXPECT_DOUBLE_EQ(a.mean_iou(), (1. / 3 + 1 + 0) / 3);
    EXPECT_DOUBLE_EQ(a.accuracy(), 0.5);
    EXPECT_EQ(a.pixels[0][kClassCount], 1u);
}

TEST(EngineLabelAgreement, frames_are_pooled_and_match_counting_by_sets)
{
    std::mt19937 random(1);
    LabelAgreement pooled;
    std::vector<uint8_t> all_frames, all_truth;
    for (int n = 0; n < 3; ++n) {
        std::vector<uint8_t> frame(500), truth(500);
        for (size_t i = 0; i < frame.size(); ++i) {
            truth[i] = random() % 7 ? uint8_t(random() % kClassCount) : kNoLabel;
            frame[i] = random() % 3 ? truth[i] : uint8_t(random() % (kClassCount + 1));
        }
        pooled += label_agreement(frame, truth);
        all_frames.insert(all_frames.end(), frame.begin(), frame.end());
        all_truth.insert(all_truth.end(), truth.begin(), truth.end());
    }
    for (size_t c = 0; c < kClassCount; ++c) {
        uint64_t both = 0, either = 0;
        for (size_t i = 0; i < all_truth.size(); ++i)
            if (all_truth[i] < kClassCount) {
                both += all_truth[i] == c && all_frames[i] == c;
                either += all_truth[i] == c || all_frames[i] == c;
            }
        ASSERT_TRUE(pooled.iou(c));
        EXPECT_DOUBLE_EQ(*pooled.iou(c), double(both) / double(either)) << label_name(c);
    }
}

} // namespace engine_label_agreement_test
} // namespace semrover
