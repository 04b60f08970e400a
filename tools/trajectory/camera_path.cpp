// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/trajectory/camera_path.h"

#include "runtime/base/quote.h"
#include "tools/trajectory/camera_text.h"

namespace semrover {

namespace {

// a file beside the poses, or of poses/NN.txt in sequences/NN, if it is there
Path beside(const Path& path, const char* name)
{
    for (const Path& folder : {path.parent_path(), path.parent_path() / ".." / "sequences" / path.stem()})
        if (path.filename() != name && is_file(folder / name))
            return folder / name;
    return {};
}

// formats without a lens
Result<CameraPath> read_poses(const FoundPath& found, const Intrinsics& lens)
{
    switch (found.format) {
    case PathFormat::kitti360:
        return read_kitti360(found.path, lens);
    case PathFormat::matrices:
        return read_matrices(found.path, lens);
    case PathFormat::redwood:
        return read_redwood(found.path, lens);
    case PathFormat::pose_files:
        return read_pose_files(found.path, lens);
    case PathFormat::euroc:
        return read_euroc(found.path, lens);
    case PathFormat::nuscenes:
        return read_nuscenes_poses(found.path, lens);
    default:
        return read_tum(found.path, lens);
    }
}

// whether the file's own lens was read
struct ReadPath {
    CameraPath path;
    bool own_lens = true;
};
Result<ReadPath> read_found(const FoundPath& found, const PathLens& lens)
{
    ReadPath read;
    if (found.format == PathFormat::colmap) {
        SR_TRY(read.path, read_colmap(found.path));
        if (found.path.filename() == "0" && is_folder(found.path.parent_path() / "1"))
            read.path.warnings.push_back(fmt::format("{}: holds several models, of which the first, 0, is read",
                                                     quote_path(found.path.parent_path())));
    } else if (found.format == PathFormat::transforms) { // says itself what it takes
        SR_TRY(read.path, read_transforms(found.path, lens));
    } else if (found.format == PathFormat::camera_path) {
        SR_TRY(read.path, read_camera_path_json(found.path));
    } else if (found.format == PathFormat::pandaset) {
        SR_TRY(read.path, read_pandaset(found.path, lens));
        read.own_lens = is_file(found.path.parent_path() / "intrinsics.json");
    } else if (found.format == PathFormat::kitti) {
        KittiFiles files{beside(found.path, "times.txt"), {}, lens.size_given};
        if (lens.matters)
            files.calibration = beside(found.path, "calib.txt");
        SR_TRY(read.path, read_kitti(found.path, lens.intrinsics, files));
        read.own_lens = !files.calibration.empty();
    } else {
        SR_TRY(read.path, read_poses(found, lens.intrinsics));
        read.own_lens = false;
    }
    return read;
}

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

std::string body_text(std::string_view name, const PathBody& body)
{
    return fmt::format("{}: poses of {}, read as a camera at its origin that looks forward; `rig` says where cameras "
                       "sit on it",
                       name, body.name);
}

Status refuse_colmap_file(const Path& path)
{
    for (const char* name : {"cameras.bin", "images.bin", "points3D.bin", "rigs.bin", "frames.bin", "cameras.txt",
                             "images.txt", "points3D.txt"})
        if (path.filename() == name)
            return fail(ErrorCode::bad_input,
                        "{}: a part of a COLMAP reconstruction, which is read as a whole; give its folder, {}",
                        quote_path(path), quote_path(path.has_parent_path() ? path.parent_path() : Path(".")));
    return {};
}

Result<CameraPath> read_camera_path(const Path& path, const PathLens& lens, const PathPlacement& placement)
{
    SR_CHECK(refuse_colmap_file(path));
    SR_TRY(const std::optional<FoundPath> found, find_path(path));
    if (!found)
        SR_CHECK(refuse_unknown_path(path));
    SR_TRY(ReadPath read, read_found(*found, lens));
    if (!read.own_lens && !lens.view_given && lens.matters)
        read.path.warnings.push_back(default_view_text(quote_path(path), lens.intrinsics));
    SR_CHECK(place_path(read.path, placement, quote_path(path)));
    return std::move(read.path);
}

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
