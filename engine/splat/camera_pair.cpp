// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/splat/camera_pair.h"

#include "engine/camera/camera_view.h"

#include <algorithm>

namespace semrover {

namespace {

void write_seen_from(const CameraFrame& frame, const Rigid& world_to_camera, std::span<float> row)
{
    SplatCamera camera = splat_camera(frame);
    std::ranges::transform(std::span(world_to_camera).first(12), camera.world_to_camera.begin(),
                           [](double v) { return float(v); });
    write_row(camera, row);
}

} // namespace

CameraPair pair_of(CameraFrame first, CameraFrame second)
{
    CameraPair pair{first.intrinsics.model, first.moves() || second.moves(), std::vector<float>(2 * kLensCameraFloats)};
    if (pair.model == CameraModel::pinhole && pair.moving)
        pair.model = CameraModel::opencv;
    first.intrinsics.model = second.intrinsics.model = pair.model;
    const Rigid between = compose(motion_of(second).middle.world_to_camera, motion_of(first).middle.camera_to_world());
    const std::span<float> rows(pair.rows);
    write_seen_from(first, kIdentity, rows.first(kLensCameraFloats));
    write_seen_from(second, between, rows.last(kLensCameraFloats));
    return pair;
}

} // namespace semrover
