// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/scene_actors.h"

#include "engine/camera/camera_view.h"
#include "engine/scene/scene_fields.h"

namespace semrover {

namespace {

std::array<float, 12> row_of(const Rigid& m)
{
    std::array<float, 12> row;
    std::ranges::transform(std::span(m).first(12), row.begin(), [](double v) { return float(v); });
    return row;
}

// At the start and at the end of the frame's readout, or both at its time. None where it is not there at its time;
// where it comes or goes meanwhile, it stands before or after that.
std::optional<std::pair<Rigid, Rigid>> poses_in(const Actor& a, const CameraFrame& frame)
{
    const int64_t first = a.poses.front().time, last = a.poses.back().time;
    const auto now = pose_at(a, microseconds_of(frame.time));
    if (!now || !frame.readout || first == last)
        return now ? std::optional(std::pair(*now, *now)) : std::nullopt;
    const auto at = [&](double seconds) { return *pose_at(a, std::clamp(microseconds_of(seconds), first, last)); };
    return std::pair(at(frame.time + frame.readout->start), at(frame.time + frame.readout->end));
}

} // namespace

Result<SceneActors> SceneActors::create(std::vector<Actor> actors, const ObjectsById& objects)
{
    std::set<uint32_t> ids; // of objects, as far as actors have them
    for (const Actor& a : actors)
        if (objects.contains(a.id))
            ids.insert(a.id);
    SR_CHECK(check_actor_ids(actors, ids, "actors"));
    SceneActors scene;
    for (const Actor& a : actors) {
        const bool cut_out = std::holds_alternative<ObjectOfScene>(a.from);
        scene.from_splats_.push_back(cut_out ? inverse(box_to_world(*objects.at(a.id))) : kIdentity);
        const uint32_t number = instance_number(a.id);
        scene.rows_.resize(std::max<size_t>(scene.rows_.size(), number + 1));
        scene.rows_[number] = uint32_t(scene.from_splats_.size());
    }
    scene.actors_ = std::move(actors);
    return scene;
}

bool SceneActors::moving(const CameraFrame& frame) const
{
    const auto moves = [&](const Actor& a) {
        const auto poses = poses_in(a, frame);
        return poses && poses->first != poses->second;
    };
    return frame.moves() || (frame.readout && std::ranges::any_of(actors_, moves));
}

SplatMovers SceneActors::seen_by(std::span<const CameraFrame> frames, bool moving) const
{
    SplatMovers movers{size(), rows_, {}};
    for (const CameraFrame& frame : frames) {
        const CameraMotion motion = motion_of(frame);
        const Rigid& view = motion.middle.world_to_camera;
        for (size_t i = 0; i < actors_.size(); ++i) {
            const auto poses = poses_in(actors_[i], frame);
            std::array<std::array<float, 12>, 2> rows{};
            if (poses && moving)
                rows = moving_views(motion, poses->first, poses->second, from_splats_[i]);
            else if (poses)
                rows[0] = row_of(compose(view, compose(poses->first, from_splats_[i])));
            movers.views.insert(movers.views.end(), rows.begin(), rows.begin() + (moving ? 2 : 1));
        }
    }
    return movers;
}

std::vector<std::array<float, 12>> SceneActors::moves(const CameraFrame& now, const CameraFrame& next) const
{
    const Rigid from = motion_of(now).middle.camera_to_world(), to = motion_of(next).middle.world_to_camera;
    std::vector<std::array<float, 12>> rows = {row_of(compose(to, from))};
    for (const Actor& a : actors_) {
        const auto before = pose_at(a, microseconds_of(now.time)), after = pose_at(a, microseconds_of(next.time));
        rows.push_back(before && after ? row_of(compose(to, compose(*after, compose(inverse(*before), from))))
                                       : std::array<float, 12>{});
    }
    return rows;
}

} // namespace semrover
