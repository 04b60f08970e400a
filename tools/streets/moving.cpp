// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/streets/moving.h"

#include "tools/streets/street.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace semrover {

namespace {

constexpr int kStepsAPose = 5;
constexpr double kStep = 0.1, kPoseSpacing = kStep * kStepsAPose; // seconds
constexpr double kGap = 2, kHeadway = 1.2;                        // metres and seconds behind who is ahead
constexpr double kAxle = 1.3;                                     // metres from the middle: what lies on the road

// lengthwise with the road, or upright; x along the thing's way
Rigid on_road(const RoadNetwork& road, double s, const MovingThing& thing)
{
    const Vector3 ahead = road.at(s + kAxle, thing.d), behind = road.at(s - kAxle, thing.d);
    Vector3 x = (ahead - behind) * thing.way;
    if (thing.upright)
        x.z = 0;
    x = normalized(x);
    const Vector3 y = normalized(cross({0, 0, 1}, x)), z = cross(x, y), at = mix(behind, ahead, 0.5);
    return {x.x, y.x, z.x, at.x, x.y, y.y, z.y, at.y, x.z, y.z, z.z, at.z, 0, 0, 0, 1};
}

struct Runner {
    const MovingThing* thing;
    double half = 0;     // its length
    double progress = 0; // along its way, metres
    bool gone = false, ended = false;
    std::vector<double> places; // along the street, every kPoseSpacing; where it goes is the last

    double s() const { return progress * thing->way; }
};

// those of a lane, who is ahead first, all a step further
void advance(std::span<Runner> lane)
{
    const Runner* ahead = nullptr;
    for (Runner& r : lane) {
        if (r.gone)
            continue;
        double speed = r.thing->speed;
        if (ahead && r.thing->lane != MovingThing::kOwnWay) {
            const double gap = ahead->progress - ahead->half - r.progress - r.half;
            speed = std::clamp((gap - kGap) / kHeadway, 0.0, speed);
        }
        r.progress += speed * kStep;
        if (const double s = std::clamp(r.s(), r.thing->low, r.thing->high); s != r.s()) {
            r.progress = s * r.thing->way;
            r.gone = !r.thing->stays;
        }
        ahead = &r;
    }
}

std::vector<Runner> run_all(const Street& street, size_t poses)
{
    std::map<uint32_t, std::vector<Runner>> lanes;
    for (const MovingThing& thing : street.moving) {
        double half = 0;
        for (const uint32_t id : thing.objects)
            half = std::max(half, street.boxes[id].size[0] / 2);
        lanes[thing.lane].push_back({&thing, half, thing.s * thing.way, false, false, {}});
    }
    std::vector<Runner> all;
    for (auto& [number, lane] : lanes) {
        std::ranges::stable_sort(lane, std::greater{}, &Runner::progress);
        for (size_t i = 0; i < poses; ++i) {
            for (Runner& r : lane)
                if (!r.ended) {
                    r.places.push_back(r.s());
                    r.ended = r.gone;
                }
            for (int k = 0; k < kStepsAPose; ++k)
                advance(lane);
        }
        std::ranges::move(lane, std::back_inserter(all));
    }
    return all;
}

// poses of a box, which moves with the thing; of one that has come to stand the last alone
std::vector<ActorPose> poses_of(const Runner& runner, const RoadNetwork& road, const Rigid& box)
{
    const Rigid made = compose(inverse(on_road(road, runner.thing->s, *runner.thing)), box);
    std::vector<ActorPose> poses;
    for (size_t i = 0; i < runner.places.size(); ++i) {
        const bool last = i + 1 == runner.places.size();
        if (i > 0 && !last && runner.places[i] == runner.places[i - 1] && runner.places[i] == runner.places[i + 1])
            continue;
        const Rigid pose = i == 0 ? box : compose(on_road(road, runner.places[i], *runner.thing), made);
        poses.push_back({microseconds_of(double(i) * kPoseSpacing), pose});
    }
    return poses;
}

} // namespace

std::vector<Actor> moving_actors(const Street& street, double seconds)
{
    std::vector<Actor> actors;
    for (const Runner& runner : run_all(street, size_t(std::ceil(seconds / kPoseSpacing)) + 1))
        for (const uint32_t id : runner.thing->objects) {
            const SceneObject box = as_written(street.boxes[id]);
            actors.push_back(as_written(Actor{.id = id,
                                              .label = box.label,
                                              .size = box.size,
                                              .from = ObjectOfScene{},
                                              .poses = poses_of(runner, street.road, box_to_world(box))}));
        }
    std::ranges::sort(actors, {}, &Actor::id);
    return actors;
}

std::vector<bool> move_actors(Mesh& mesh, const Street& street, std::span<const Actor> actors, int64_t time)
{
    std::vector<bool> absent(street.boxes.size());
    std::map<uint32_t, Rigid> motions;
    for (const Actor& actor : actors) {
        const auto pose = pose_at(actor, time);
        absent[actor.id] = !pose;
        if (pose)
            motions[actor.id] = compose(*pose, inverse(box_to_world(as_written(street.boxes[actor.id]))));
    }
    for (size_t f = 0; f < mesh.faces.size(); ++f) {
        if (street.owners[f] == 0)
            continue;
        const auto motion = motions.find(street.owners[f] - 1);
        if (motion == motions.end())
            continue;
        for (const uint32_t v : mesh.faces[f]) {
            const auto& p = street.mesh.positions[v];
            const Point3 q = transform(motion->second, {p[0], p[1], p[2]});
            mesh.positions[v] = {float(q[0]), float(q[1]), float(q[2])};
        }
    }
    return absent;
}

} // namespace semrover
