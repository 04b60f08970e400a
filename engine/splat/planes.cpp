// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/splat/planes.h"

#include <cstring>

namespace semrover {

void split_texels(std::span<const float> texels, float* __restrict xyz, float* __restrict w)
{
    const size_t count = texels.size() / 4;
    if (!count)
        return;
    const float* from = texels.data();
    // all four numbers are stored at once: the next texel overwrites the fourth
    for (size_t i = 0; i + 1 < count; ++i, from += 4, xyz += 3) {
        std::memcpy(xyz, from, 16);
        w[i] = from[3];
    }
    std::memcpy(xyz, from, 12);
    w[count - 1] = from[3];
}

void split_pairs(std::span<const float> pairs, float* __restrict first, float* __restrict second)
{
    const float* __restrict from = pairs.data();
    for (size_t i = 0; i < pairs.size() / 2; ++i) {
        first[i] = from[2 * i];
        second[i] = from[2 * i + 1];
    }
}

void split_pairs(std::span<const uint32_t> pairs, uint32_t* __restrict first, uint32_t* __restrict second)
{
    const uint32_t* __restrict from = pairs.data();
    for (size_t i = 0; i < pairs.size() / 2; ++i) {
        first[i] = from[2 * i];
        second[i] = from[2 * i + 1];
    }
}

void mark_from(std::span<const float> values, float threshold, uint8_t* __restrict marks)
{
    const float* __restrict from = values.data();
    for (size_t i = 0; i < values.size(); ++i)
        marks[i] = from[i] >= threshold;
}

} // namespace semrover
