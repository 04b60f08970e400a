// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/mesh/bvh.h"
#include "engine/mesh/mesh.h"
#include "kernels/network.h"
#include "kernels/trace.h"
#include "runtime/device/device.h"
#include "runtime/device/tensor_pool.h"

#include <span>

namespace semrover {

// A mesh as rays see it, on the host: the tables of TraceScene (kernels/trace.h). Where faces meet they are smooth if
// they bend by less than 44 degrees. Transparent parts are left out; rays are relative to Mesh::origin.
struct TraceTables {
    std::vector<std::array<uint32_t, 16>> nodes = {};
    std::vector<std::array<uint32_t, 12>> triangles = {}, corners = {};
    std::vector<std::array<uint32_t, 8>> materials = {};
    std::vector<uint32_t> texels = {}; // all levels of all pictures
};

// the faces that are named, all if none are; gloss: of each material, 0 if empty; owners: of each face of the mesh the
// number of the thing that it is of, below 2^22 (its bits are never a NaN), 0 if empty. The mesh must pass check_mesh.
TraceTables trace_tables(const Mesh& mesh, std::span<const float> gloss, std::span<const uint32_t> faces = {},
                         std::span<const uint32_t> owners = {});

// the same on a device
class DeviceTraceScene {
  public:
    // out_of_memory when a table exceeds what the device binds: 48 bytes a triangle (2.7 million in 128 MiB), 4 bytes
    // a texel and a third more for smaller levels
    static Result<DeviceTraceScene> create(Device& device, const TraceTables& tables);

    TraceScene in(Graph& g) const;

  private:
    TensorPool memory_;
    DeviceTensor nodes_, triangles_, corners_, materials_, texels_; // of one row at least
};

} // namespace semrover
