// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// things of a world that move
#include "engine/capi/exchange.h"

using namespace semrover;
using namespace semrover::capi;

namespace {

Result<std::vector<ActorPose>> poses_of(const sr_actor& a, std::string_view where)
{
    if (!a.poses || !a.pose_count)
        return fail(ErrorCode::bad_input, "{}: expected one pose or more", where);
    std::vector<ActorPose> poses;
    for (uint32_t n = 0; n < a.pose_count; ++n) {
        const sr_actor_pose& given = a.poses[n];
        const std::string at = fmt::format("{}: pose {}", where, n);
        if (given.time_us < -kLatestTime || given.time_us > kLatestTime)
            return fail(ErrorCode::bad_input, "{}: a time of {} us, expected one within 2^61", at, given.time_us);
        if (n && given.time_us <= poses.back().time)
            return fail(ErrorCode::bad_input, "{}: expected a time after {} us, found {}", at, poses.back().time,
                        given.time_us);
        SR_TRY(const Rigid to_world, rigid_from_matrix(given.pose, at));
        poses.push_back({given.time_us, to_world});
    }
    return poses;
}

Result<Actor> actor_of(const sr_actor& a, const ObjectsById& objects, std::string_view where)
{
    const auto found = objects.find(a.object);
    if (found == objects.end() || found->second->part)
        return fail(ErrorCode::bad_input, "{}: the world has no object {}", where, a.object);
    const SceneObject& object = *found->second;
    Actor actor{.id = object.id, .label = object.label, .size = object.size, .from = ObjectOfScene(), .poses = {}};
    SR_TRY(actor.poses, poses_of(a, where));
    return actor;
}

Result<SceneActors> actors_of(const sr_world& world, const sr_actor* given, uint32_t count)
{
    std::vector<Actor> actors;
    std::set<uint32_t> ids;
    for (uint32_t n = 0; n < count; ++n) {
        const std::string where = fmt::format("sr_world_set_actors: actor {}", n);
        SR_TRY(actors.emplace_back(), actor_of(given[n], world.objects, where));
        if (!ids.insert(actors.back().id).second)
            return fail(ErrorCode::bad_input, "{}: object {} is an actor already", where, actors.back().id);
    }
    return SceneActors::create(std::move(actors), world.objects);
}

} // namespace

sr_status sr_world_set_actors(sr_world* world, const sr_actor* actors, uint32_t count)
{
    return guarded<kDraw>(world ? world->context : nullptr, [&]() -> Status {
        if (!world || (count && !actors))
            return fail(ErrorCode::usage, "sr_world_set_actors: {} is NULL", world ? "actors" : "world");
        SR_CHECK(splats_of(*world, "sr_world_set_actors").map([](SplatPool*) {}));
        SR_TRY(world->actors, actors_of(*world, actors, count));
        return {};
    });
}

static_assert(sizeof(sr_actor_pose) == 104 && sizeof(sr_actor) == 16);
