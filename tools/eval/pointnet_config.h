// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/file.h"
#include "runtime/base/result.h"

#include <cstdint>
#include <string>
#include <vector>

namespace semrover {

// one set abstraction of PointNet++: `npoint` points far from one another, of each up to `nsample` neighbours within
// `radius`, a shared network of `mlp` widths over them, the maximum
struct SetAbstraction {
    uint32_t npoint = 0, nsample = 0;
    float radius = 0; // metres
    std::vector<uint32_t> mlp;
};

// The JSON file beside a PointNet++'s weights, NAME.json of NAME.safetensors:
//   {"inputs": ["xyz", "rgb"], "chunk": 4.0, "points": 4096, "min_points": 256, "pool": "max",
//    "layers": [{"npoint": 1024, "radius": 0.1, "nsample": 32, "mlp": [32, 32, 64]}, ..]}
// `layers` are sa1, sa2, .. of the weights; the rest may be left out and is then as above.
struct PointnetConfig {
    enum class Input {
        xyz,        // metres: x and y from the middle of the chunk, z from its lowest point
        rgb,        // sRGB, 0..1
        normalized, // xyz within the bounds of the whole grid, 0..1
    };
    enum class Pool { max, mean }; // over the points of the last layer
    std::vector<Input> inputs = {Input::xyz, Input::rgb};
    double chunk = 4;          // metres, side of the columns that a grid is cut into
    uint32_t points = 4096;    // of a chunk
    uint32_t min_points = 256; // a chunk with fewer is left out
    Pool pool = Pool::max;
    std::vector<SetAbstraction> layers;

    uint32_t input_width() const { return uint32_t(3 * inputs.size()); }
};

// errors: bad_input, with the field; names that nobody knows go to `warnings`
Result<PointnetConfig> read_pointnet_config(const Path& path, std::vector<std::string>& warnings);

} // namespace semrover
