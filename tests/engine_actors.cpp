// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/scene/actors.h"
#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"

#include <cmath>
#include <gtest/gtest.h>

namespace semrover {
namespace engine_actors_test {

Rigid pose(double x, double y, double heading)
{
    return *rigid_from_quaternion({x, y, 0.5}, {0, 0, std::sin(heading / 2), std::cos(heading / 2)}, "pose");
}

Actor moving(uint32_t id, ActorSource from = ObjectOfScene{})
{
    return {.id = id,
            .label = 13,
            .size = {4.4, 1.8, 1.5},
            .from = std::move(from),
            .poses = {{-500000, pose(0, 0, 0)}, {500000, pose(8, 2, 0.4)}, {1500000, pose(16, 2, 3)}}};
}

Result<std::vector<Actor>> parse_text(const std::string& text)
{
    return parse_actors(*parse_json(text, "a"), "folder", "a");
}

constexpr std::string_view kId = R"("id": 3)", kClass = R"("class": "car")", kSize = R"("size": [4, 2, 1.5])",
                           kFrom = R"("from": "object")",
                           kPose = R"({"time": 1, "position": [1, 2, 3], "rotation": [0, 0, 0, 1]})";

// an actor whose field `at` (of five) is replaced
std::string actor_with(size_t at, std::string_view field)
{
    const std::string poses = fmt::format(R"("poses": [{}])", kPose);
    std::array<std::string_view, 5> fields = {kId, kClass, kSize, kFrom, poses};
    if (at < fields.size())
        fields[at] = field;
    return fmt::format("{{{}}}", fmt::join(fields, ", "));
}
std::string with_poses(std::string_view list)
{
    return actor_with(4, fmt::format(R"("poses": {})", list));
}
std::string with_pose(std::string_view time, std::string_view position, std::string_view rotation)
{
    return with_poses(fmt::format(R"([{{"time": {}, "position": {}, "rotation": {}}}])", time, position, rotation));
}
std::string file_of(std::string_view list)
{
    return fmt::format(R"({{"format": "semrover.actors", "version": 1, "actors": [{}]}})", list);
}

TEST(engine_actors, what_is_written_is_read_and_the_same_actors_give_the_same_bytes)
{
    const ScratchFolder folder;
    std::vector<Actor> actors = {moving(7), moving(2, GridOfActor{folder / "car.sgrid"}),
                                 moving(4294967295, SplatsOfActor{folder / "parts/car.ply"})};
    actors[1].poses = {{kLatestTime, pose(1 / 3.0, -1000000, -3)}};
    actors[2].poses = {{-kLatestTime, pose(1e-9, -1e-9, 0)}, {kLatestTime, kIdentity}};
    ASSERT_TRUE(write_actors(folder / "a.json", actors));
    const auto read = read_actors(folder / "a.json");
    ASSERT_TRUE(read) << read.error().message;
    ASSERT_EQ(read->size(), actors.size());
    for (size_t i = 0; i < actors.size(); ++i) {
        const Actor expected = as_written(actors[i]);
        const Actor& found = (*read)[i];
        EXPECT_EQ(found.id, expected.id);
        EXPECT_EQ(found.label, expected.label);
        EXPECT_EQ(found.size, expected.size);
        EXPECT_EQ(found.from, expected.from);
        ASSERT_EQ(found.poses.size(), expected.poses.size());
        for (size_t k = 0; k < found.poses.size(); ++k) {
            EXPECT_EQ(found.poses[k].time, expected.poses[k].time);
            EXPECT_EQ(found.poses[k].to_world, expected.poses[k].to_world);
            for (size_t n = 0; n < 16; ++n)
                EXPECT_NEAR(found.poses[k].to_world[n], actors[i].poses[k].to_world[n], n % 4 == 3 ? 5.1e-5 : 4e-9);
        }
    }
    ASSERT_TRUE(write_actors(folder / "b.json", actors));
    EXPECT_EQ(contents(folder / "a.json"), contents(folder / "b.json"));
    EXPECT_NE(contents(folder / "a.json").find(R"("from":{"splats":"parts/car.ply"})"), std::string::npos);
    EXPECT_EQ(contents(folder / "a.json").find("-0.0,"), std::string::npos);
    ASSERT_TRUE(write_actors(folder / "none.json", {}));
    EXPECT_TRUE(read_actors(folder / "none.json")->empty());
}

TEST(engine_actors, an_actor_is_there_from_its_first_pose_to_its_last)
{
    const Actor a = moving(1);
    EXPECT_FALSE(pose_at(a, -500001));
    EXPECT_EQ(pose_at(a, -500000), a.poses[0].to_world);
    EXPECT_EQ(pose_at(a, 500000), a.poses[1].to_world);
    EXPECT_EQ(pose_at(a, 1500000), a.poses[2].to_world);
    EXPECT_FALSE(pose_at(a, 1500001));
    const Rigid quarter = *pose_at(a, -250000), expected = pose(2, 0.5, 0.1);
    for (size_t n = 0; n < 16; ++n)
        EXPECT_NEAR(quarter[n], expected[n], 1e-14);
    Actor stays = a;
    stays.poses.resize(1);
    for (const int64_t time : {-kLatestTime, int64_t(0), kLatestTime})
        EXPECT_EQ(pose_at(stays, time), a.poses[0].to_world);
    Actor slow = a; // differences of times that 32 bits, or a double's 53, do not hold
    slow.poses = {{-kLatestTime, pose(0, 0, 0)}, {kLatestTime, pose(8, 0, 0)}};
    EXPECT_NEAR((*pose_at(slow, kLatestTime / 2))[3], 6, 1e-12);
}

TEST(engine_actors, what_is_no_actor_is_refused_with_its_number)
{
    ASSERT_TRUE(parse_text(file_of(actor_with(9, ""))));
    const std::pair<std::string, const char*> cases[] = {
        {"7", "actor 2: expected an object, found number"},
        {actor_with(9, ""), "actor 2: id 3 is given twice"},
        {actor_with(0, R"("comment": "none")"), "actor 2: id: expected a whole number from 0"},
        {actor_with(0, R"("id": -1)"), "actor 2: id: expected a whole number from 0"},
        {actor_with(0, R"("id": 4294967296)"), "actor 2: id: expected a whole number from 0"},
        {actor_with(0, R"("id": 4, "colour": "red")"), "actor 2: unknown key 'colour'"},
        {actor_with(1, R"("class": "boat")"), "actor 2: class: there is no class 'boat'"},
        {actor_with(1, R"("comment": "")"), "actor 2: class: expected the name of a class"},
        {actor_with(2, R"("size": [4, 2, 0])"), "actor 2: size: expected a number from 0.001"},
        {actor_with(2, R"("size": [4, 2])"), "actor 2: size: expected an array of 3 numbers"},
        {actor_with(3, R"("comment": "")"), "actor 2: from: expected \"object\""},
        {actor_with(3, R"("from": "file")"), "actor 2: from: expected \"object\""},
        {actor_with(3, R"("from": {})"), "actor 2: from: expected \"object\""},
        {actor_with(3, R"("from": {"grid": 7})"), "actor 2: from: expected \"object\""},
        {actor_with(3, R"("from": {"grid": ""})"), "actor 2: from: the name of the file is empty"},
        {actor_with(3, R"("from": {"mesh": "a"})"), "actor 2: from: expected \"grid\" or \"splats\", found 'mesh'"},
        {actor_with(3, R"("from": {"grid": "a", "splats": "b"})"), "actor 2: from: expected \"object\""},
        {actor_with(4, R"("comment": "")"), "actor 2: poses: expected an array of one pose or more"},
        {with_poses("[]"), "actor 2: poses: expected an array of one pose or more"},
        {with_poses("{}"), "actor 2: poses: expected an array of one pose or more"},
        {with_poses("[3]"), "actor 2: pose 1: expected an object, found number"},
        {with_poses(fmt::format("[{},{}]", kPose, kPose)), "actor 2: pose 2: time: expected one after 1, found 1"},
        {with_poses(R"([{"position": [1, 2, 3], "rotation": [0, 0, 0, 1]}])"), "actor 2: pose 1: time: expected"},
        {with_poses(R"([{"time": 1, "rotation": [0, 0, 0, 1]}])"), "actor 2: pose 1: position: expected an array"},
        {with_poses(R"([{"time": 1, "position": [1, 2, 3]}])"), "actor 2: pose 1: rotation: expected an array"},
        {with_poses(R"([{"time": 1, "heading": 2}])"), "actor 2: pose 1: unknown key 'heading'"},
        {with_pose("0.5", "[0,0,0]", "[0,0,0,1]"), "actor 2: pose 1: time: expected a whole number"},
        {with_pose("2305843009213693953", "[0,0,0]", "[0,0,0,1]"), "actor 2: pose 1: time: expected a whole number"},
        {with_pose("-2305843009213693953", "[0,0,0]", "[0,0,0,1]"), "actor 2: pose 1: time: expected a whole number"},
        {with_pose("18446744073709551615", "[0,0,0]", "[0,0,0,1]"), "actor 2: pose 1: time: expected a whole number"},
        {with_pose("1", "[0,1000001,0]", "[0,0,0,1]"), "actor 2: pose 1: position: expected a number from -1000000"},
        {with_pose("1", "[0,0,0]", "[0,0,0,0]"), "actor 2: pose 1: expected a quaternion of norm 1"},
        {with_pose("1", "[0,0,0]", "[1,0,0,1]"), "actor 2: pose 1: expected a quaternion of norm 1"},
        {with_pose("1", "[0,0,0]", "[0,0,1]"), "actor 2: pose 1: rotation: expected an array of 4 numbers"},
    };
    for (const auto& [second, message] : cases)
        EXPECT_TRUE(says(parse_text(file_of(actor_with(9, "") + "," + second)), message)) << second;
    EXPECT_TRUE(says(parse_text("[]"), "expected an object with \"format\": \"semrover.actors\""));
    EXPECT_TRUE(says(parse_text(R"({"format": "semrover.objects"})"), "\"format\": \"semrover.actors\""));
    EXPECT_TRUE(says(parse_text(R"({"format": "semrover.actors", "version": 2})"), "version: expected 1, found 2"));
    EXPECT_TRUE(says(parse_text(R"({"format": "semrover.actors", "version": 1})"), "actors: expected an array"));
}

TEST(engine_actors, a_file_has_at_most_2_to_the_20_poses)
{
    Json file = *parse_json(file_of(actor_with(9, "") + "," + actor_with(0, R"("id": 4)")), "a");
    Json& second = file["actors"][1]["poses"]; // counted before any is looked at
    second = Json::array_t(kMaxActorPoses);
    EXPECT_TRUE(says(parse_actors(file, "", "a"), "actor 2: poses: a file has at most 1048576 poses"));
    second = Json::array_t(kMaxActorPoses - 1);
    EXPECT_TRUE(says(parse_actors(file, "", "a"), "actor 2: pose 1: expected an object, found null"));
}

TEST(engine_actors, exactly_those_made_of_objects_have_the_id_of_an_object)
{
    const std::vector<Actor> actors = {moving(3), moving(5, GridOfActor{"a.sgrid"})};
    EXPECT_TRUE(check_actor_ids(actors, {1, 3}, "a"));
    EXPECT_TRUE(
        says(check_actor_ids(actors, {1}, "a"), "a: actor 1: it is made of an object, but no object has the id 3"));
    EXPECT_TRUE(
        says(check_actor_ids(actors, {3, 5}, "a"), "a: actor 2: it is made of a file, but an object has the id 5"));
}

} // namespace engine_actors_test
} // namespace semrover
