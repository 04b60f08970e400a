// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

// Takes the texels of an image apart, as the device has them, into planes. A frame has millions, so these loops are
// compiled with -O3, apart from the code that calls them.
namespace semrover {

// xyz: three numbers of each texel, one texel after the other; w: the fourth
void split_texels(std::span<const float> texels, float* xyz, float* w);
void split_pairs(std::span<const float> pairs, float* first, float* second);
void split_pairs(std::span<const uint32_t> pairs, uint32_t* first, uint32_t* second);
// 1 where a value reaches the threshold
void mark_from(std::span<const float> values, float threshold, uint8_t* marks);

} // namespace semrover
