// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/mesh/mesh.h"
#include "runtime/device/device.h"
#include "runtime/device/tensor_pool.h"

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace semrover {

using PointRow = std::array<float, 4>; // metres, near the origin where floats are exact enough; the last is unused

struct NearestPointsOptions {
    float cell_size = 0.3f;    // metres, of the search grid
    float first_radius = 0.9f; // metres that are searched first; only queries with no point there see all of them
};

// metres from each query to the nearest of the points (at least one of them), exact, in double.
// Errors: out_of_memory, device_lost
Result<std::vector<double>> nearest_distances(Device& device, std::span<const PointRow> queries,
                                              std::span<const PointRow> points,
                                              const NearestPointsOptions& options = {});

struct NearestFace {
    float distance; // metres, or the radius of the search
    uint32_t face;  // 2^32 - 1: none within the radius
};

// The faces of a mesh on the device, to be searched for the ones nearest to points.
class NearestSurface {
  public:
    // the mesh has passed check_mesh. Errors: out_of_memory, device_lost
    static Result<NearestSurface> create(Device& device, const Mesh& mesh);

    // the middle of the mesh in whole metres: points are relative to it, where floats are exact enough
    const std::array<double, 3>& origin() const { return origin_; }

    // exact distances; ties go to the lower face. Points: metres from the origin, unused
    Result<std::vector<NearestFace>> find(std::span<const std::array<float, 4>> points, float radius) const;

  private:
    struct Tree { // as many faces as the device can bind
        TensorPool state;
        DeviceTensor nodes, triangles;
    };

    explicit NearestSurface(Device& device) : device_(&device) {}
    Status search(std::span<const std::array<float, 4>> points, std::span<NearestFace> nearest) const;

    Device* device_;
    std::array<double, 3> origin_{};
    std::vector<Tree> trees_;
};

} // namespace semrover
