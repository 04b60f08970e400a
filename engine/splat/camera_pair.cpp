// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/splat/camera_pair.h"

#include "engine/camera/camera_view.h"

#include <algorithm>

namespace semrover {

namespace {

void write_seen_from(const CameraFrame& frame, bool moving, const Rigid& world_to_camera, std::span<float> row)
{
    SplatCamera camera = splat_camera(frame, moving);
    std::ranges::transform(std::span(world_to_camera).first(12), camera.world_to_camera.begin(),
                           [](double v) { return float(v); });
    write_row(camera, row);
}

} // namespace

CameraPair pair_of(const CameraFrame& first, const CameraFrame& second)
{
    const bool moving = first.moves() || second.moves();
    CameraPair pair{drawn_model(first.intrinsics.model, moving), moving, std::vector<float>(2 * kLensCameraFloats)};
    const Rigid between = compose(motion_of(second).middle.world_to_camera, motion_of(first).middle.camera_to_world());
    const std::span<float> rows(pair.rows);
    write_seen_from(first, moving, kIdentity, rows.first(kLensCameraFloats));
    write_seen_from(second, moving, between, rows.last(kLensCameraFloats));
    return pair;
}

} // namespace semrover
