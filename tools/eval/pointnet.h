// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/network.h"
#include "runtime/device/device.h"
#include "tools/eval/features.h"
#include "tools/eval/point_chunks.h"

#include <memory>

namespace semrover {

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
