// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/grid.h"

#include <span>

namespace semrover {

// MagicaVoxel's file as it is: RIFF-like chunks, little endian, z up.
// Source: https://github.com/ephtracy/voxel-model, MagicaVoxel-file-format-vox.txt and -vox-extension.txt
struct VoxVoxel {
    uint8_t x, y, z, color;
};

struct VoxModel {
    std::array<uint32_t, 3> size{}; // 1 to 256
    std::vector<VoxVoxel> voxels;   // inside
};

// a signed permutation of the axes and a translation: world = R local + t
struct VoxTransform {
    std::array<int8_t, 9> rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}; // row-major, entries -1, 0, 1
    std::array<int64_t, 3> translation{};
};
VoxTransform compose(const VoxTransform& a, const VoxTransform& b); // a after b

// The cell of a voxel of a model: models turn about the corner at size / 2, rounded down.
Cell vox_cell(const VoxTransform& transform, const VoxModel& model, const VoxVoxel& voxel);

struct VoxNode {
    enum class Kind : uint8_t { none, transform, group, shape };
    Kind kind = Kind::none;
    bool hidden = false;
    int32_t layer = -1;
    VoxTransform transform;         // of the first frame
    std::vector<uint32_t> children; // nodes; of a shape: its models
};

struct VoxFile {
    std::vector<VoxModel> models;
    std::map<uint32_t, VoxNode> nodes; // by id; 0 is the root; empty in files without a scene
    std::map<int32_t, bool> hidden_layers;
    std::array<std::array<uint8_t, 3>, 256> palette{}; // by colour index; 0 is no colour
};

// of files without RGBA, as the description lists it
std::array<std::array<uint8_t, 3>, 256> default_vox_palette();

// bad_input names the chunk and the byte: sizes beyond the file, voxels outside their model, rotations that are none
Result<VoxFile> parse_vox(std::span<const std::byte> bytes, std::string_view where);

// version 150, one transform and shape a model
std::vector<std::byte> encode_vox(std::span<const VoxModel> models,
                                  std::span<const std::array<int64_t, 3>> translations,
                                  std::span<const std::array<uint8_t, 3>> palette);

} // namespace semrover
