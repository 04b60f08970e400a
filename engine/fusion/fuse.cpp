// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/fusion/fuse.h"

#include "engine/scene/palette.h"

#include <algorithm>

namespace semrover {

namespace {

uint8_t face_label(const std::array<uint8_t, 3>& corners)
{
    std::array<uint8_t, 3> sorted = corners;
    std::ranges::sort(sorted);
    if (sorted[1] == sorted[2] && sorted[1] != kNoLabel)
        return sorted[1];
    return sorted[0]; // two or three the same, or all different; kNoLabel is above all classes
}

// one for each class that occurs, and one for faces without
void add_materials(Mesh& mesh)
{
    std::array<int32_t, 256> index;
    index.fill(-1);
    for (const uint8_t label : mesh.face_labels)
        index[label] = 0;
    for (size_t label = 0; label < index.size(); ++label)
        if (index[label] == 0) {
            index[label] = int32_t(mesh.materials.size());
            Material& material = mesh.materials.emplace_back();
            material.name = label < kClassCount ? std::string(kPalette[label].name) : "unlabelled";
        }
    for (const uint8_t label : mesh.face_labels)
        mesh.face_materials.push_back(uint32_t(index[label]));
}

} // namespace

double suitable_max_depth(const std::vector<CameraFrame>& cameras, double voxel)
{
    double depth = 30;
    for (const CameraFrame& camera : cameras)
        depth = std::min(depth, 0.55 * voxel * std::min(camera.intrinsics.fx, camera.intrinsics.fy));
    return depth;
}

Result<FusedMesh> fuse(Device& device, const DepthFrames& frames, const FusionOptions& options,
                       const FusionProgress& progress)
{
    SR_TRY(const TsdfVolume volume, TsdfVolume::create(device, frames, options, progress));
    SR_TRY(FusedSurface surface, extract_surface(device, volume));
    if (surface.faces.empty())
        return fail(ErrorCode::bad_input,
                    "nothing was observed: {} frames touch {} blocks, but no surface was seen by {} of them "
                    "(`min_views`) with weight {} (`min_weight`); do the poses fit the pictures?",
                    frames.cameras.size(), volume.blocks().size(), options.min_views, options.min_weight);
    FusedMesh out;
    out.figures = {volume.blocks().size(), volume.chunks(), 0};
    for (const auto& face : surface.faces) {
        const uint8_t label = face_label({surface.labels[face[0]], surface.labels[face[1]], surface.labels[face[2]]});
        out.mesh.face_labels.push_back(label);
        out.figures.unlabelled_faces += label == kNoLabel;
    }
    out.mesh.positions = std::move(surface.positions);
    out.mesh.colors = std::move(surface.colors);
    out.mesh.faces = std::move(surface.faces);
    out.views = std::move(surface.views);
    add_materials(out.mesh);
    return out;
}

} // namespace semrover
