// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/trajectory/path_placement.h"

namespace semrover {

namespace {

Result<size_t> index_of_frame(const CameraPath& path, uint64_t frame, std::string_view where)
{
    const size_t count = path.frames.size();
    if (frame == PathPlacement::kFirst)
        return size_t(0);
    if (!path.numbered && frame < count)
        return size_t(frame);
    for (size_t i = 0; path.numbered && i < count; ++i)
        if (path.frames[i].time == double(frame))
            return i;
    return fail(ErrorCode::bad_input, "{}: `relative_to`: no frame {}, expected one of {} frames{} {} to {}", where,
                frame, count, path.numbered ? ", which the file numbers" : ", counted from 0:",
                path.numbered ? path.frames.front().time : 0.0,
                path.numbered ? path.frames.back().time : double(count - 1));
}

} // namespace

Status place_path(CameraPath& path, const PathPlacement& placement, std::string_view where)
{
    Rigid to_grid = kIdentity;
    if (placement.relative_to || placement.lidar_to_camera) {
        SR_TRY(const size_t frame, index_of_frame(path, placement.relative_to.value_or(PathPlacement::kFirst), where));
        to_grid = inverse(path.file_pose(frame));
    }
    if (placement.lidar_to_camera && path.body)
        return fail(ErrorCode::bad_input,
                    "{}: `lidar_to_camera` brings a camera's poses into the lidar's frame, and these are of {}; "
                    "`world` takes any matrix",
                    where, path.body->name);
    if (placement.lidar_to_camera)
        to_grid = compose(inverse(*placement.lidar_to_camera), to_grid);
    to_grid = compose(placement.world, to_grid);
    for (size_t axis = 0; axis < 3; ++axis)
        to_grid[4 * axis + 3] += placement.origin[axis];
    if (to_grid == kIdentity) // poses keep their bits
        return {};
    for (CameraFrame& frame : path.frames)
        frame.pose.world_to_camera = inverse(compose(to_grid, frame.pose.camera_to_world()));
    return {};
}

} // namespace semrover
