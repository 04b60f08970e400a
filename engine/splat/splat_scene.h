// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/ply.h"
#include "engine/scene/scene_points.h"
#include "kernels/network.h"
#include "kernels/splat.h"
#include "runtime/device/device.h"
#include "runtime/device/tensor_pool.h"

namespace semrover {

struct PointSplatOptions {
    float sigma = 0.04f;        // metres (the paper's splat radius)
    bool auto_sigma = false;    // sigma from the distance of the nearest points, which closes the holes,
    float largest_sigma = 0.3f; // up to this, metres
    float opacity = 1;
    uint32_t neighbors = 16;       // of a point, itself included, for its normal
    float neighbor_radius = 0.45f; // metres; 0: no limit
    bool same_label = true;        // neighbours of the same label first
    bool fallbacks = true;         // normals of poles and of lonely points (docs/method.md §5.1)

    bool operator==(const PointSplatOptions&) const = default;
};
// errors: usage for numbers of neighbours and a radius that cannot be; bad_input when arrays disagree in size or there
// are too many points
Status check_point_splat_options(const PointSplatOptions& options);
Status check_points(const ScenePoints& points);

// Splats on the device, ready to be drawn: positions, normals, colours, sigmas, opacities, labels, voxels, and
// what each is of.
class SplatScene {
  public:
    // of points: normals by PCA over the nearest ones, sigma and opacity by the options
    // errors: of check_points() and check_point_splat_options(); out_of_memory
    static Result<SplatScene> create(Device& device, const ScenePoints& points, const PointSplatOptions& options = {});

    // Of splats that are complete; the voxel of each is its index. owners: SplatTensors::owners; empty: of nothing
    static Result<SplatScene> create(Device& device, const Splats& splats, std::span<const uint32_t> owners = {});

    // One after the other, with memory of its own. Errors: bad_input for too many splats; out_of_memory
    static Result<SplatScene> joined(Device& device, std::span<const SplatScene> parts);

    // Room for splats, all without opacity at first: not drawn. by_blocks: and none are drawn of a block of kBlock
    // whose word in blocks() is 0, as all are at first
    static constexpr uint32_t kBlock = 64;
    static Result<SplatScene> reserve(Device& device, uint32_t size, bool by_blocks);
    // records the first splats of another scene over those from `first` on
    void record_put(VkCommandBuffer commands, uint32_t first, const SplatScene& from, uint32_t count);
    // normals from the nearest points, and sigmas if they follow the spacing
    void derive(Graph& g, const PointSplatOptions& options) const;

    // the whole arrays, of which in() gives rows, in its order
    std::array<DeviceTensor, 6> arrays() const { return {positions_, normals_, colors_, labels_, cells_, owners_}; }

    const DeviceTensor& blocks() const { return blocks_; } // one that is not valid: there are none

    uint32_t size() const { return size_; }       // splats
    uint32_t skipped() const { return skipped_; } // of these, not drawn: not finite, or without normal, size or opacity
    uint64_t bytes() const;                       // on the device

    // tensors of its first rows in a graph; one splat without opacity if there are none
    SplatTensors in(Graph& g, uint32_t rows) const;

    Result<Splats> read() const; // as they are drawn, for export

  private:
    struct Host; // the parts, as they are uploaded

    explicit SplatScene(Device& device) : device_(&device) {}
    Status allocate(bool by_blocks = false);
    Status upload(const Host& host);

    Device* device_;
    uint32_t size_ = 0, skipped_ = 0;
    TensorPool state_;
    DeviceTensor positions_, normals_, colors_, labels_, cells_, owners_, blocks_; // as SplatTensors has them
};

} // namespace semrover
