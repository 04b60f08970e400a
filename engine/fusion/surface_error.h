// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/fusion/depth_frames.h"
#include "engine/mesh/mesh.h"
#include "runtime/device/device.h"

namespace semrover {

// how many frames saw each vertex of a mesh: it projects to a pixel, and its depth lies within the depths of that pixel
// and its neighbours, give or take 0.1 m or 2 % of the depth
Result<std::vector<uint32_t>> count_views(const Mesh& mesh, const DepthFrames& frames);

struct SurfaceError {
    std::vector<float> distances; // [vertices that are measured] metres to the nearest true face, or the radius
    std::vector<uint8_t> classes; // of these nearest faces, kNoLabel for none
    size_t vertices = 0;          // of the mesh
    size_t beyond = 0;            // with no true face within the radius
    double labelled = 0;          // m^2 of faces whose nearest true face (to the face's middle) has a label
    double right = 0;             // of these, with the same label
    // [true label][label] m^2; half a MiB, too much for the stack of a thread
    std::vector<std::array<double, 256>> confusion = std::vector<std::array<double, 256>>(256);

    double percentile(double share) const;                // of the distances
    double percentile(double share, uint8_t label) const; // where the true face has this class
};

// Distances from the vertices of a mesh that `views` says at least `min_views` frames saw (empty: all) to the surface
// of the true mesh, exact on the device; labels of the faces between such vertices, by area.
// Errors: bad_input, out_of_memory, device_lost
Result<SurfaceError> measure_surface(Device& device, const Mesh& mesh, const Mesh& truth,
                                     const std::vector<uint32_t>& views = {}, uint32_t min_views = 2,
                                     double radius = 5);

} // namespace semrover
