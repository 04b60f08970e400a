// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/scene_actors.h"

#include "engine/camera/camera_view.h"

#include <cmath>
#include <map>

namespace semrover {

namespace {

std::array<float, 12> row_of(const Rigid& m)
{
    std::array<float, 12> row;
    std::ranges::transform(std::span(m).first(12), row.begin(), [](double v) { return float(v); });
    return row;
}

// the object's own frame: x along its heading, the origin in the middle of its box
Rigid object_to_world(const SceneObject& o)
{
    const double c = std::cos(o.heading), s = std::sin(o.heading);
    return {c, -s, 0, o.center[0], s, c, 0, o.center[1], 0, 0, 1, o.center[2], 0, 0, 0, 1};
}

} // namespace

int64_t microseconds_of(double seconds)
{
    return std::llround(seconds * 1e6);
}

Result<SceneActors> SceneActors::create(std::vector<Actor> actors, std::span<const SceneObject> objects)
{
    std::map<uint32_t, const SceneObject*> by_id;
    std::set<uint32_t> ids;
    for (const SceneObject& o : objects) {
        by_id[o.id] = &o;
        ids.insert(o.id);
    }
    SR_CHECK(check_actor_ids(actors, ids, "actors"));
    SceneActors scene;
    for (const Actor& a : actors) {
        const bool cut_out = std::holds_alternative<ObjectOfScene>(a.from);
        scene.from_splats_.push_back(cut_out ? inverse(object_to_world(*by_id.at(a.id))) : kIdentity);
        scene.rows_.resize(std::max<size_t>(scene.rows_.size(), a.id + 2));
        scene.rows_[a.id + 1] = uint32_t(scene.from_splats_.size());
    }
    scene.actors_ = std::move(actors);
    return scene;
}

SplatMovers SceneActors::seen_by(std::span<const CameraFrame> frames) const
{
    SplatMovers movers{size(), rows_, {}};
    for (const CameraFrame& frame : frames) {
        const Rigid world_to_camera = motion_of(frame).middle.world_to_camera;
        for (size_t i = 0; i < actors_.size(); ++i) {
            const auto pose = pose_at(actors_[i], microseconds_of(frame.time));
            movers.views.push_back(pose ? row_of(compose(world_to_camera, compose(*pose, from_splats_[i])))
                                        : std::array<float, 12>{});
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
