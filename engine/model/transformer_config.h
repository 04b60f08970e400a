// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/file.h"
#include "runtime/base/result.h"

#include <array>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

namespace semrover {

// what a transformer may be conditioned on beside a voxel's label (docs/method.md §2.1)
enum class ConditionPart : uint8_t { object, tint, part };
constexpr uint32_t condition_width(ConditionPart part)
{
    constexpr std::array<uint32_t, 3> kWidths = {60, 4, 64};
    return kWidths[size_t(part)];
}

// config.json of a VoxfieldTransformer (docs/models.md §3); nothing assumes the defaults
struct TransformerConfig {
    uint32_t num_layers = 12;
    uint32_t num_attention_heads = 8;
    uint32_t attention_head_dim = 128; // a multiple of 8
    uint32_t points_per_voxel = 20;    // 682 at most: the noise counter has room for 4096 channels
    uint32_t num_classes = 20;         // the embedding has one more row, the null label
    float voxel_size = 0.6f;           // metres
    float attention_radius = 3.0f;
    uint32_t pos_embed_dim = 128; // sinusoids per axis, even
    bool context_pos_embed = true;
    bool qk_norm = false; // rms_norm
    bool q8_0 = false;    // weights of its blocks are (weight_blocks.h)
    std::vector<ConditionPart> condition;
    bool condition_voxels = false;     // of voxel tokens too, not only of semantic tokens
    std::string placement = "shifted"; // of the points that it was trained on: shifted, canonical, mixed

    // per-channel x, y, z, r, g, b: token = (value - mean) / std, after the scaling to [-1, 1]
    struct Normalization {
        std::array<float, 6> mean, std;
    };
    std::optional<Normalization> normalization;
    std::vector<std::string> warnings; // fields that the engine does not know

    uint32_t dim() const { return num_attention_heads * attention_head_dim; }
    uint32_t channels() const { return 6 * points_per_voxel; }
    uint32_t condition_width() const; // numbers of a voxel; 0: labels are all that the model knows
    // largest squared distance in voxels at which two voxels see each other; inclusive
    int32_t radius2() const { return radius2_of(attention_radius); }
    int32_t radius2_of(double metres) const; // squared, in voxels
};

// errors: bad_input; a value that the engine does not implement is refused by name
Result<TransformerConfig> parse_transformer_config(const nlohmann::json& json);
Result<TransformerConfig> read_transformer_config(const Path& folder);

} // namespace semrover
