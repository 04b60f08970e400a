// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// objects, actors, boxes and sweeps, ours and other programs'
#include "engine/annotation/box_lines.h"
#include "engine/annotation/drive_record.h"
#include "engine/conditioning/scene_objects.h"
#include "engine/scene/actors.h"
#include "runtime/base/json.h"
#include "tests/fuzz/fuzz_target.h"
#include "tools/dataset/lidar_sweeps.h"
#include "tools/dataset/object_boxes.h"

namespace semrover::fuzz {

namespace annotations {

void objects(Bytes input)
{
    const auto read = read_objects(InputFile(input, "o.json"));
    if (!accepts(read))
        return;
    for (const SceneObject& object : *read)
        if (const Status status = check_object(object, "object"); !status)
            found("read_objects gives what is none: " + status.error().message);
}

void actors(Bytes input)
{
    const auto read = read_actors(InputFile(input, "a.json"));
    if (!accepts(read))
        return;
    for (const Actor& actor : *read)
        for (const ActorPose& pose : actor.poses)
            if (!pose_at(actor, pose.time))
                found("an actor is nowhere at the time of its pose");
}

void check(const Path& path, BoxFormat format, const BoxOptions& options)
{
    const auto read = read_box_file(path, format, options);
    // usage: an option is not for what the file has
    if ((!read && read.error().code == ErrorCode::usage) || !accepts(read))
        return;
    for (const SceneObject& object : read->objects)
        if (const Status status = check_object(object, "object"); !status)
            found("read_box_file gives what is none: " + status.error().message);
}

void boxes(Bytes input)
{
    const InputFile file(input, "boxes.txt");
    (void)detect_box_format(file);
    for (const BoxFormat format : {BoxFormat::kitti, BoxFormat::waymo, BoxFormat::carla})
        check(file, format, {});
    BoxOptions options;
    options.frame = 0;
    check(file, BoxFormat::kitti, options);
}

void box_folder(Bytes input)
{
    const InputFolder folder(input, "sample_annotation.json");
    for (const Path& path : {folder.path(), folder.first()})
        if (const auto format = detect_box_format(path))
            check(path, *format, {});
    BoxOptions options;
    options.calibration = folder.path() / "calib.txt";
    check(folder.first(), BoxFormat::kitti, options);
    check(folder.first(), BoxFormat::nuscenes, {});
}

void box_lines(Bytes input)
{
    (void)accepts(read_box_lines(InputFile(input, kBoxesName)));
}

void drive_record(Bytes input)
{
    const InputFolder folder(input, "calibration.json");
    const auto read = read_drive_record(folder);
    if (accepts(read) && path_of(*read).frames.size() != read->pictures.size())
        found("the path of a record has another number of frames");
}

void sweeps(Bytes input)
{
    const InputFolder folder(input, "sweeps.json");
    const auto read = read_sweeps(folder);
    if (accepts(read))
        for (const RecordedSweep& sweep : *read)
            (void)accepts(read_scan(sweep.points));
}

void scan(Bytes input)
{
    (void)accepts(read_scan(InputFile(input, "000000.npy")));
}

constexpr FuzzTarget kTargets[] = {
    {"objects", "*.json", objects},
    {"actors", "*.json", actors},
    {"boxes", "*.txt *.csv *.json *.xml", boxes},
    {"box_folder", "*.folder", box_folder, 32 << 10},
    {"box_lines", "*.jsonl", box_lines},
    {"drive_record", "*.folder", drive_record, 32 << 10},
    {"sweeps", "*.folder", sweeps, 32 << 10},
    {"scan", "*.npy", scan},
};

} // namespace annotations

std::span<const FuzzTarget> annotation_targets()
{
    return annotations::kTargets;
}

} // namespace semrover::fuzz
