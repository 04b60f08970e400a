// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/frame_boxes.h"

#include "runtime/base/quote.h"

#include <algorithm>
#include <bit>

namespace semrover {

std::string frame_key(const std::string& camera, uint32_t number)
{
    return fmt::format("{}{}{:06}", camera, camera.empty() ? "" : "/", number);
}

Result<std::unique_ptr<FrameBoxes>> FrameBoxes::create(const CameraPath& path, const DrawOptions& draw,
                                                       const PictureEncoding& encoding)
{
    auto record = drive_record_of(path, encoding.depth_unit());
    if (!record)
        return fail(ErrorCode::bad_input, "`boxes` wants a path whose cameras sit on a vehicle: {}",
                    record.error().message);
    return std::unique_ptr<FrameBoxes>(new FrameBoxes(std::move(*record), draw, encoding));
}

FrameBoxes::FrameBoxes(DriveRecord record, const DrawOptions& draw, const PictureEncoding& encoding)
    : record_(std::move(record)), objects_(draw.objects), actors_(draw.actors), encoding_(encoding)
{
    for (const SceneObject& object : objects_)
        if (!object.part && std::ranges::find(actors_, object.id, &Actor::id) == actors_.end())
            standing_.push_back(placed(object));
}

std::string FrameBoxes::line(const CameraFrame& frame, uint32_t number, const FramePixels& pixels) const
{
    const int64_t time = microseconds_of(frame.time);
    std::vector<PlacedObject> there = standing_;
    for (const Actor& actor : actors_)
        if (const auto pose = pose_at(actor, time))
            there.push_back({actor.id, actor.label, {*pose, actor.size}});
    const double unit = encoding_.depth_unit();
    const bool floats = encoding_.depth == DepthFormat::npy;
    std::vector<uint32_t> instances = pixels.instances;
    for (size_t i = 0; i < instances.size(); ++i) // outlines of splats fade over some pixels
        if (pixels.seen[i] >> 24 == 0)
            instances[i] = 0;
    const InstancePicture picture{pixels.width, pixels.height, instances, [&](size_t i) {
                                      const uint32_t word = pixels.depths[i];
                                      return floats ? double(std::bit_cast<float>(word)) : word * unit;
                                  }};
    return box_line({time, frame.camera, number}, seen_objects(frame, picture, there),
                    inverse(record_.moment(time)->vehicle_to_world), frame.pose.world_to_camera);
}

Status FrameBoxes::write(const Path& folder) const
{
    SR_TRY(AtomicFile file, AtomicFile::create(folder / kBoxesName));
    for (const DriveRecord::Picture& p : record_.pictures) {
        const auto line = lines_.find(frame_key(p.camera, p.number));
        if (line == lines_.end())
            return fail(ErrorCode::bad_input, "{}: no boxes of picture {}, start over with `replace`",
                        quote_path(folder), frame_key(p.camera, p.number));
        SR_CHECK(file.write(line->second));
        SR_CHECK(file.write("\n"));
    }
    SR_CHECK(file.commit());
    return write_objects(folder / kObjectsName, objects_);
}

} // namespace semrover
