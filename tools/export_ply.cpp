// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/export_ply.h"

#include "engine/scene/ply.h"
#include "engine/splat/surfels.h"

namespace semrover {

Status export_ply(Device& device, const VoxelGrid& grid, const PlyExports& exports)
{
    const SurfelPoints points = surfel_points(grid);
    const SurfelOptions options;
    SR_TRY(const SurfelScene scene, SurfelScene::create(device, points, options));
    std::vector<float> normals, sigmas;
    SR_CHECK(scene.read(normals, sigmas));
    Surfels s;
    for (size_t i = 0; i < points.size(); ++i) {
        const auto triple = [&](const std::vector<float>& v) { return std::array<float, 3>{v[3 * i], v[3 * i + 1], v[3 * i + 2]}; };
        s.position.push_back(triple(points.positions));
        s.normal.push_back(triple(normals));
        s.color.push_back(triple(points.colors));
        s.sigma_u.push_back(sigmas[2 * i]);
        s.sigma_v.push_back(sigmas[2 * i + 1]);
        s.opacity.push_back(options.opacity);
        s.label.push_back(points.labels[i]);
    }
    if (!exports.points.empty())
        SR_CHECK(write_points_ply(exports.points, s));
    if (!exports.splats_3d.empty())
        SR_CHECK(write_splats_ply(exports.splats_3d, s, SplatPly::gaussian_3d));
    if (!exports.splats_2d.empty())
        SR_CHECK(write_splats_ply(exports.splats_2d, s, SplatPly::gaussian_2d));
    return {};
}

} // namespace semrover
