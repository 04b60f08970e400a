// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// things of a world that move
#include "engine/capi/exchange.h"

#include <bit>

using namespace semrover;
using namespace semrover::capi;

namespace {

Result<Actor> actor_of(const sr_actor& a, std::span<const SceneObject> objects, std::string_view where)
{
    const auto object = std::ranges::find(objects, a.object, &SceneObject::id);
    if (object == objects.end() || object->part)
        return fail(ErrorCode::bad_input, "{}: the world has no object {}", where, a.object);
    if (a.reserved)
        return fail(ErrorCode::usage, "{}: reserved is not 0", where);
    Actor actor{.id = object->id, .label = object->label, .size = object->size, .from = ObjectOfScene(), .poses = {}};
    SR_TRY(const Rigid pose, rigid_from_matrix(a.pose, where));
    actor.poses.push_back({0, pose});
    return actor;
}

Result<SceneActors> actors_of(const sr_world& world, const sr_actor* given, uint32_t count)
{
    const std::span<const SceneObject> objects = world.world->objects();
    std::vector<Actor> actors;
    std::set<uint32_t> ids;
    for (uint32_t n = 0; n < count; ++n) {
        const std::string where = fmt::format("sr_world_set_actors: actor {}", n);
        SR_TRY(actors.emplace_back(), actor_of(given[n], objects, where));
        if (!ids.insert(actors.back().id).second)
            return fail(ErrorCode::bad_input, "{}: object {} is an actor already", where, actors.back().id);
    }
    return SceneActors::create(std::move(actors), by_id(objects));
}

} // namespace

// note: in steps, so that a rasterizer is seldom made anew
RasterizerOptions semrover::capi::with_actors(const sr_world& world, RasterizerOptions options)
{
    if (!world.actors.size())
        return options;
    options.movers = std::bit_ceil(std::max(world.actors.size(), 16u));
    options.mover_numbers = std::bit_ceil(std::max(uint32_t(world.actors.rows().size()), 256u));
    return options;
}

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

static_assert(sizeof(sr_actor) == 104);
