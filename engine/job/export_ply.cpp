// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/export_ply.h"

#include "engine/format/ply.h"
#include "engine/splat/splat_scene.h"

namespace semrover {

Status export_ply(Device& device, const VoxelGrid& grid, const PlyExports& exports)
{
    SR_TRY(const SplatScene scene, SplatScene::create(device, points_of(grid)));
    SR_TRY(const Splats s, scene.read());
    if (!exports.points.empty())
        SR_CHECK(write_points_ply(exports.points, s));
    if (!exports.splats_3d.empty())
        SR_CHECK(write_splats_ply(exports.splats_3d, s, SplatPly::gaussian_3d));
    if (!exports.splats_2d.empty())
        SR_CHECK(write_splats_ply(exports.splats_2d, s, SplatPly::gaussian_2d));
    return {};
}

} // namespace semrover
