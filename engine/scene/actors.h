// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/rigid.h"
#include "runtime/base/json.h"

#include <optional>
#include <set>
#include <span>
#include <variant>
#include <vector>

namespace semrover {

struct ActorPose {
    int64_t time = 0; // microseconds
    Rigid to_world = kIdentity;
};

// what an actor is made of: the object of the same id, which is cut out of the scene, or a file of its own
struct ObjectOfScene {
    bool operator==(const ObjectOfScene&) const = default;
};
struct GridOfActor {
    Path path;
    bool operator==(const GridOfActor&) const = default;
};
struct SplatsOfActor {
    Path path;
    bool operator==(const SplatsOfActor&) const = default;
};
using ActorSource = std::variant<ObjectOfScene, GridOfActor, SplatsOfActor>;

// A thing that moves as one piece. Its own frame: x forward, y left, z up, metres, the origin in the middle of its box.
struct Actor {
    uint32_t id = 0; // unique among actors; that of the object that it is made of, otherwise of no object
    uint8_t label = 0;
    std::array<double, 3> size{}; // of its box: along x, y, z
    ActorSource from;
    std::vector<ActorPose> poses; // 1 or more, times ascending
};

constexpr size_t kMaxActors = 1 << 16, kMaxActorPoses = 1 << 20; // of a file
constexpr int64_t kLatestTime = int64_t(1) << 61;                // microseconds, also before 0: differences fit

// Where the actor is at a time: between two poses the position linear, the rotation by slerp. None before its first
// pose and after its last; with one pose it is there always.
std::optional<Rigid> pose_at(const Actor& actor, int64_t time);

// Files of actors (docs/formats.md §2.10). Paths of grids and splats are relative to `folder`, the file's own. Errors:
// bad_input with the number of the actor and of the pose, for unknown keys and classes, ids given twice, boxes without
// size, times that do not ascend, rotations that are none, places beyond 1000 km, too many actors or poses.
Result<std::vector<Actor>> parse_actors(const Json& json, const Path& folder, std::string_view where);
Result<std::vector<Actor>> read_actors(const Path& path);
// bad_input, with `where` in front, unless exactly the actors that are made of objects have an object's id
Status check_actor_ids(std::span<const Actor> actors, const std::set<uint32_t>& objects, std::string_view where);

// what reading gives of the written one: lengths rounded to 0.1 mm, quaternions to 1e-9
Actor as_written(Actor actor);
// the same actors give the same bytes
Status write_actors(const Path& path, std::span<const Actor> actors);

} // namespace semrover
