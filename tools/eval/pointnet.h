// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/scene_points.h"
#include "kernels/network.h"
#include "runtime/base/file.h"
#include "runtime/base/result.h"
#include "runtime/device/device.h"
#include "tools/eval/features.h"

#include <cstdint>
#include <memory>
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

// columns of a grid as sets of equally many points, for a network of points
struct PointChunks {
    uint32_t count = 0, points = 0, width = 0;
    std::vector<float> positions; // [count * points, 4] xyz as PointnetConfig::Input::xyz, 0
    std::vector<float> inputs;    // [count * points, width]
    uint32_t left_out = 0;        // chunks with fewer than min_points
};

// Chunk (i, j) holds the points with floor(x / chunk) = i, floor(y / chunk) = j; chunks come in that order. Of more
// than config.points, that many are drawn; fewer are repeated from the start. Points are in a random order that depends
// on the seed and their number in the grid only, since a ball takes the first ones it meets. bad_input when a point is
// not finite or 2^30 chunks away.
Result<PointChunks> cut_chunks(const ScenePoints& scene, const PointnetConfig& config, uint64_t seed = 0);

// The encoder of PointNet++ with single-scale grouping (Qi et al. 2017): set abstractions one after the other, then the
// maximum or mean over the last one's points. Layer i reads saI.mlp_convs.J.{weight [N, C, 1, 1], bias [N]} and
// saI.mlp_bns.J.{weight, bias, running_mean, running_var} (eps 1e-5, folded), the names of
// github.com/yanx27/Pointnet_Pointnet2_pytorch, models/pointnet2_sem_seg.py; C = 3 + the width before, offsets first.
// Tensors whose names do not begin with "sa" (the decoder) are not used. Two rules differ from that code, which draws
// at random: the first of the farthest points is the chunk's first point, and ties go to the lower index.
class Pointnet {
  public:
    // `path`: the weights, with the config beside them. Errors, bad_input: of either
    static Result<std::unique_ptr<Pointnet>> load(Device& device, const Path& path, std::vector<std::string>& warnings);
    ~Pointnet();

    const PointnetConfig& config() const;
    uint32_t features() const; // D
    // positions [sets * points, 4] fp32 array, inputs [sets * points, width] fp32 -> [sets or more, D] fp32
    [[nodiscard]] Tensor forward(Graph& g, Tensor positions, Tensor inputs, uint32_t sets) const;

  private:
    struct Impl;
    explicit Pointnet(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

// features of chunks, a batch at a time
class PointFeatures {
  public:
    // a smaller batch where the device's budget asks for it. Errors: out_of_memory when one chunk does not fit
    static Result<std::unique_ptr<PointFeatures>> create(Device& device, const Pointnet& network, uint32_t batch);
    ~PointFeatures();

    uint32_t batch() const;
    // chunks [first, first + count), count <= batch() -> a row each. Errors: internal for NaN; the device's
    Status append(const PointChunks& chunks, uint32_t first, uint32_t count, Features& features);

  private:
    struct Impl;
    explicit PointFeatures(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

} // namespace semrover
