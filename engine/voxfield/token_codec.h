// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/model/transformer_config.h"

#include <cstdint>
#include <span>

namespace semrover {

// Stored points <-> model tokens (docs/method.md §1.2). A token is the voxel's n points by increasing distance to its
// centre (ties by x, y, z, then source order), each x, y, z, r, g, b; offsets / (voxel_size / 2), 2 * rgb - 1, then the
// model's normalization. All known tokens are made from stored values, so a resumed run sees the same ones.

// stored points and their colours in the order of a token
void sort_by_distance(std::span<uint16_t> points, std::span<uint8_t> colors);

// points [n, 3] f16 bits in metres, colors [n, 3] sRGB -> token [6n]
void encode_token(const TransformerConfig& config, std::span<const uint16_t> points, std::span<const uint8_t> colors,
                  std::span<float> token);

// words [3n] of decode_tokens (kernels/sampling.h) -> points and colours in stored form
void unpack_points(std::span<const uint32_t> words, std::span<uint16_t> points, std::span<uint8_t> colors);

} // namespace semrover
