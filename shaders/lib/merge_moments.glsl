// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// Merges (count, mean, m2) of disjoint sets as in Chan, Golub and LeVeque 1979, eight at once: with one division, and
// without a chain of merges that wait for each other. Means are summed from the first one on, so that a large one costs
// no digits.
const uint kAtOnce = 8;

// more: another set. The first of `sets` is empty only where all are.
vec3 merge(vec3 sets[kAtOnce], vec3 more)
{
    const float first = sets[0].y;
    float n = more.x, sum = more.x * (more.y - first);
    [[unroll]] for (uint i = 0; i < kAtOnce; ++i) {
        n += sets[i].x;
        sum += sets[i].x * (sets[i].y - first);
    }
    const float mean = first + (n > 0.0 ? sum / n : 0.0);
    float m2 = more.z + more.x * (more.y - mean) * (more.y - mean);
    [[unroll]] for (uint i = 0; i < kAtOnce; ++i)
        m2 += sets[i].z + sets[i].x * (sets[i].y - mean) * (sets[i].y - mean);
    return vec3(n, mean, m2);
}

// pixels in a chunk of `rows` rows of an image
float chunk_pixels(uint chunk, uint rows, uint pixels) { return float(min(pixels - min(chunk * rows, pixels), rows)); }

// Merges chunks first, first + stride, ... below `end` of a column into sum. moments: pairs, `row` of them before
// chunk 0's, `ld` from a chunk to the next. All loads of a round are on their way together.
#define MERGE_CHUNKS(sum, moments, row, ld, first, stride, end, count)                                                 \
    for (uint chunk_ = first; chunk_ < end; chunk_ += kAtOnce * stride) {                                              \
        vec3 sets_[kAtOnce];                                                                                           \
        [[unroll]] for (uint i_ = 0; i_ < kAtOnce; ++i_) {                                                             \
            const uint at_ = chunk_ + i_ * stride, inside_ = min(at_, end - 1);                                        \
            const vec2 m_ = moments[row + inside_ * ld];                                                               \
            sets_[i_] = at_ < end ? vec3(count(inside_), m_) : vec3(0.0, m_.x, 0.0);                                   \
        }                                                                                                              \
        sum = merge(sets_, sum);                                                                                       \
    }
