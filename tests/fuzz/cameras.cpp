// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// paths of cameras in all formats, rigs, lidars and what places one beside another
#include "engine/camera/rig.h"
#include "engine/format/transforms.h"
#include "tests/fuzz/fuzz_target.h"
#include "tools/dataset/rigid_file.h"
#include "tools/trajectory/camera_path.h"
#include "tools/trajectory/path_format.h"

#include <cmath>

namespace semrover::fuzz {

namespace cameras {

const Intrinsics& view()
{
    static const Intrinsics k = pinhole_from_fov(90, 616, 424);
    return k;
}

void check(const Result<CameraPath>& path)
{
    if (!accepts(path))
        return;
    for (const CameraFrame& frame : path->frames) {
        for (const double number : frame.pose.world_to_camera)
            if (!std::isfinite(number))
                found("a pose that is not finite");
        if (const Status status = check_intrinsics(frame.intrinsics, "frame"); !status)
            found("a lens that is none: " + status.error().message);
    }
}

// as its content says, and as each format that says no more of itself than numbers
void camera_path(Bytes input)
{
    const InputFile file(input, "path.txt");
    check(read_camera_path(file, view()));
    check(read_tum(file, view()));
    check(read_kitti(file, view()));
    check(read_kitti360(file, view()));
    check(read_matrices(file, view()));
    check(read_redwood(file, view()));
    check(read_euroc(file, view()));
}

void camera_json(Bytes input)
{
    const InputFile file(input, "poses.json");
    check(read_camera_path(file, view()));
    check(read_camera_path_json(file));
    check(read_transforms(file, view()));
    check(read_pandaset(file, view()));
    check(read_nuscenes_poses(file, view()));
}

void camera_folder(Bytes input)
{
    const InputFolder folder(input, "poses.txt");
    check(read_camera_path(folder, view()));
    check(read_camera_path(folder.first(), view()));
    check(read_colmap(folder));
    check(read_pose_files(folder, view()));
}

void transforms(Bytes input)
{
    const InputFile file(input, "transforms.json");
    check(read_transforms(file));
    (void)accepts(read_depth_unit(Path(file).parent_path()));
}

void rig(Bytes input)
{
    const InputFolder folder(input, "rig.json");
    const auto read = read_rig(folder.path() / "rig.json");
    if (!accepts(read))
        return;
    CameraPath vehicle;
    for (const double time : {0., 0.5, 1.})
        vehicle.frames.push_back({time, "", {}, view()});
    check(expand_rig(*read, vehicle));
}

void lidar(Bytes input)
{
    (void)accepts(read_lidar(InputFile(input, "l.json")));
}

void rigid(Bytes input)
{
    const InputFile file(input, "r.txt");
    (void)accepts(read_rigid(file));
    (void)accepts(read_kitti_lidar(file));
}

constexpr FuzzTarget kTargets[] = {
    {"camera_path", "*.txt *.tum *.log *.csv", camera_path},
    {"camera_json", "*.json", camera_json},
    {"camera_folder", "*.folder", camera_folder, 32 << 10},
    {"transforms", "*.json", transforms},
    {"rig", "*.json", rig},
    {"lidar", "*.json", lidar},
    {"rigid", "*.txt *.json", rigid, 4096},
};

} // namespace cameras

std::span<const FuzzTarget> camera_targets()
{
    return cameras::kTargets;
}

} // namespace semrover::fuzz
