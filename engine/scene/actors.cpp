// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/scene/actors.h"

#include "engine/scene/palette.h"
#include "engine/scene/scene_fields.h"
#include "runtime/base/json_fields.h"
#include "runtime/base/json_numbers.h"
#include "runtime/base/quote.h"

#include <algorithm>

namespace semrover {

namespace {

constexpr const char* kActorFormat = "semrover.actors";
constexpr std::array<std::string_view, 4> kActorFileKeys = {"format", "version", "actors", "comment"};
constexpr std::array<std::string_view, 6> kActorKeys = {"id", "class", "size", "from", "poses", "comment"};
constexpr std::array<std::string_view, 4> kPoseKeys = {"time", "position", "rotation", "comment"};
constexpr double kPerTurn = 1e9; // of numbers of quaternions

Result<ActorSource> source_at(const Json& json, const Path& folder, std::string_view where)
{
    const auto from = json.find("from");
    const bool object = from != json.end() && *from == "object";
    if (object)
        return ActorSource(ObjectOfScene{});
    if (from == json.end() || !from->is_object() || from->size() != 1 || !from->front().is_string())
        return fail(ErrorCode::bad_input,
                    "{}: from: expected \"object\", {{\"grid\": \"FILE\"}} or {{\"splats\": \"FILE\"}}", where);
    const std::string& name = from->front().get_ref<const std::string&>();
    if (name.empty())
        return fail(ErrorCode::bad_input, "{}: from: the name of the file is empty", where);
    if (from->contains("grid"))
        return ActorSource(GridOfActor{folder / name});
    if (from->contains("splats"))
        return ActorSource(SplatsOfActor{folder / name});
    return fail(ErrorCode::bad_input, "{}: from: expected \"grid\" or \"splats\", found {}", where,
                quote(from->begin().key()));
}

Result<ActorPose> parse_pose(const Json& json, std::string_view where)
{
    if (!json.is_object())
        return fail(ErrorCode::bad_input, "{}: expected an object, found {}", where, json.type_name());
    SR_CHECK(check_keys(json, kPoseKeys, where));
    const auto time = json.find("time");
    if (time == json.end() || !time->is_number_integer() ||
        (time->is_number_unsigned() && time->get<uint64_t>() > uint64_t(kLatestTime)) ||
        (!time->is_number_unsigned() && time->get<int64_t>() < -kLatestTime))
        return fail(ErrorCode::bad_input, "{}: time: expected a whole number of microseconds within 2^61", where);
    SR_TRY(const Point3 position, triple_at(json, "position", -kFarthestThing, kFarthestThing, where));
    SR_TRY(const Quaternion rotation, numbers_at<4>(json, "rotation", where));
    SR_TRY(const Rigid to_world, rigid_from_quaternion(position, rotation, where));
    return ActorPose{time->get<int64_t>(), to_world};
}

// `left`: how many poses the file may still have
Result<std::vector<ActorPose>> poses_at(const Json& json, size_t left, std::string_view where)
{
    const auto list = json.find("poses");
    if (list == json.end() || !list->is_array() || list->empty())
        return fail(ErrorCode::bad_input, "{}: poses: expected an array of one pose or more", where);
    if (list->size() > left)
        return fail(ErrorCode::bad_input, "{}: poses: a file has at most {} poses", where, kMaxActorPoses);
    std::vector<ActorPose> poses;
    for (const Json& item : *list) {
        const std::string at = fmt::format("{}: pose {}", where, poses.size() + 1);
        SR_TRY(const ActorPose pose, parse_pose(item, at));
        if (!poses.empty() && pose.time <= poses.back().time)
            return fail(ErrorCode::bad_input, "{}: time: expected one after {}, found {}", at, poses.back().time,
                        pose.time);
        poses.push_back(pose);
    }
    return poses;
}

Result<Actor> parse_actor(const Json& json, const Path& folder, size_t poses_left, std::string_view where)
{
    if (!json.is_object())
        return fail(ErrorCode::bad_input, "{}: expected an object, found {}", where, json.type_name());
    SR_CHECK(check_keys(json, kActorKeys, where));
    Actor a;
    SR_TRY(a.id, id_at(json, where));
    SR_TRY(a.label, class_at(json, where));
    SR_TRY(a.size, triple_at(json, "size", kShortestSide, kLongestSide, where));
    SR_TRY(a.from, source_at(json, folder, where));
    SR_TRY(a.poses, poses_at(json, poses_left, where));
    return a;
}

Point3 written_lengths(Point3 metres)
{
    for (double& v : metres)
        v = rounded_to(v, kPerMetre);
    return metres;
}

Quaternion written_rotation(const Rigid& pose)
{
    Quaternion q = quaternion_of(pose);
    for (double& v : q)
        v = rounded_to(v, kPerTurn);
    return q;
}

Json from_json(const ActorSource& from, const Path& folder)
{
    const auto name = [&](const Path& path) { return path.lexically_proximate(folder).generic_string(); };
    if (const auto* grid = std::get_if<GridOfActor>(&from))
        return {{"grid", name(grid->path)}};
    if (const auto* splats = std::get_if<SplatsOfActor>(&from))
        return {{"splats", name(splats->path)}};
    return "object";
}

std::string actor_text(const Actor& actor, const Path& folder)
{
    const Json head = {{"id", actor.id},
                       {"class", std::string(kPalette[actor.label].name)},
                       {"size", written_lengths(actor.size)},
                       {"from", from_json(actor.from, folder)}};
    std::string text = json_text(head);
    text.pop_back(); // the brace that ends it
    text += ", \"poses\": [";
    for (size_t i = 0; i < actor.poses.size(); ++i) {
        const Rigid& pose = actor.poses[i].to_world;
        const Json line = {{"time", actor.poses[i].time},
                           {"position", written_lengths(translation_of(pose))},
                           {"rotation", written_rotation(pose)}};
        text += (i ? ",\n  " : "\n  ") + json_text(line);
    }
    return text + "]}";
}

} // namespace

std::optional<Rigid> pose_at(const Actor& actor, int64_t time)
{
    const auto& poses = actor.poses;
    if (poses.size() == 1)
        return poses[0].to_world;
    if (poses.empty() || time < poses.front().time || time > poses.back().time)
        return std::nullopt;
    const auto after = std::ranges::lower_bound(poses, time, {}, &ActorPose::time);
    if (after->time == time)
        return after->to_world;
    const ActorPose& before = after[-1];
    return interpolate(before.to_world, after->to_world,
                       double(time - before.time) / double(after->time - before.time));
}

Result<std::vector<Actor>> parse_actors(const Json& json, const Path& folder, std::string_view where)
{
    SR_TRY(const Json* list, things_in(json, kActorFormat, kActorFileKeys, "actors", kMaxActors, where));
    std::vector<Actor> actors;
    std::set<uint32_t> ids;
    size_t left = kMaxActorPoses;
    for (const Json& item : *list) {
        const std::string at = fmt::format("{}: actor {}", where, actors.size() + 1);
        SR_TRY(Actor a, parse_actor(item, folder, left, at));
        if (!ids.insert(a.id).second)
            return fail(ErrorCode::bad_input, "{}: id {} is given twice", at, a.id);
        left -= a.poses.size();
        actors.push_back(std::move(a));
    }
    return actors;
}

Result<std::vector<Actor>> read_actors(const Path& path)
{
    SR_TRY(const Json json, read_json(path, {.bytes = 256u << 20, .values = 32u << 20, .containers = 4u << 20}));
    return parse_actors(json, path.parent_path(), quote_path(path));
}

Status check_actor_ids(std::span<const Actor> actors, const std::set<uint32_t>& objects, std::string_view where)
{
    for (size_t i = 0; i < actors.size(); ++i) {
        const bool object = std::holds_alternative<ObjectOfScene>(actors[i].from);
        if (object != objects.contains(actors[i].id))
            return fail(ErrorCode::bad_input, "{}: actor {}: {} object has the id {}", where, i + 1,
                        object ? "it is made of an object, but no" : "it is made of a file, but an", actors[i].id);
    }
    return {};
}

Actor as_written(Actor a)
{
    a.size = written_lengths(a.size);
    for (ActorPose& p : a.poses) // a unit quaternion has the norm 1 after rounding, too
        p.to_world =
            *rigid_from_quaternion(written_lengths(translation_of(p.to_world)), written_rotation(p.to_world), "");
    return a;
}

Status write_actors(const Path& path, std::span<const Actor> actors)
{
    std::string text = fmt::format("{{\"format\": \"{}\", \"version\": 1, \"actors\": [", kActorFormat);
    for (size_t i = 0; i < actors.size(); ++i)
        text += (i ? ",\n " : "\n ") + actor_text(actors[i], path.parent_path());
    return write_file_atomically(path, text + "\n]}\n");
}

} // namespace semrover
