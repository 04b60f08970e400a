// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/camera/camera_view.h"
#include "engine/conditioning/cell_objects.h"
#include "engine/scene/palette.h"
#include "runtime/base/hash.h"
#include "tools/streets/class_label.h"
#include "tools/streets/street.h"
#include "tools/streets/street_objects.h"
#include "tools/streets/street_parts.h"

#include <algorithm>
#include <functional>
#include <gtest/gtest.h>
#include <map>
#include <set>

namespace semrover {
namespace engine_streets_test {

template <typename T>
void add_all(Hash& hash, const std::vector<T>& values)
{
    hash.add(std::as_bytes(std::span(values)));
}

uint64_t hash_of(const Street& street)
{
    Hash hash;
    add_all(hash, street.mesh.positions);
    add_all(hash, street.mesh.faces);
    add_all(hash, street.mesh.uvs);
    add_all(hash, street.mesh.face_labels);
    add_all(hash, street.mesh.face_materials);
    for (const Texture& t : street.mesh.textures)
        add_all(hash, t.image.pixels);
    return hash.value();
}

TEST(engine_streets, the_same_seed_gives_the_same_bytes_and_another_seed_another_street)
{
    EXPECT_EQ(hash_of(make_street({.seed = 3, .length = 60})), hash_of(make_street({.seed = 3, .length = 60})));
    EXPECT_NE(hash_of(make_street({.seed = 3, .length = 60})), hash_of(make_street({.seed = 4, .length = 60})));
}

TEST(engine_streets, meshes_are_whole_labelled_textured_and_within_bounds)
{
    for (uint64_t seed : {1, 6}) {
        const Street street = make_street({.seed = seed, .length = 90});
        const Mesh& m = street.mesh;
        const Status status = check_mesh(m, "street");
        ASSERT_TRUE(status) << status.error().message;
        ASSERT_EQ(m.face_labels.size(), m.faces.size());
        ASSERT_EQ(m.uvs.size(), m.faces.size());
        ASSERT_EQ(m.face_materials.size(), m.faces.size());
        ASSERT_EQ(street.gloss.size(), m.materials.size());
        for (const Material& material : m.materials)
            EXPECT_GE(material.texture, 0) << material.name;
        size_t tiny = 0;
        for (size_t f = 0; f < m.faces.size(); ++f) {
            ASSERT_LT(m.face_labels[f], kClassCount);
            ASSERT_NE(m.face_labels[f], label::kSky);
            tiny += face_area(m, f) < 1e-8;
        }
        EXPECT_LT(double(tiny), 0.001 * double(m.faces.size()));
        for (const auto& p : m.positions) {
            ASSERT_LT(std::abs(p[0]), 200) << "x";
            ASSERT_LT(std::abs(p[1]), 120) << "y";
            ASSERT_GT(p[2], -12) << "z";
            ASSERT_LT(p[2], 50) << "z";
        }
    }
}

TEST(engine_streets, some_streets_together_have_every_class_but_sky)
{
    std::set<std::string> missing;
    for (const SemanticClass& c : kPalette)
        missing.insert(std::string(c.name));
    for (uint64_t seed : {1, 2, 3, 4}) {
        const std::vector<ClassShare> shares = class_shares(make_street({.seed = seed, .length = 220}).mesh);
        for (size_t i = 0; i < kClassCount; ++i)
            if (shares[i].area > 0.5)
                missing.erase(std::string(kPalette[i].name));
        EXPECT_EQ(shares[label::kSky].faces, 0u);
    }
    EXPECT_EQ(missing, std::set<std::string>{"sky"});
}

// corners and label of every face whose middle lies in the first metres
std::multiset<std::array<float, 10>> beginning(const Mesh& m, float reach)
{
    std::multiset<std::array<float, 10>> faces;
    for (size_t f = 0; f < m.faces.size(); ++f) {
        std::array<float, 10> row{};
        for (size_t c = 0; c < 3; ++c)
            std::ranges::copy(m.positions[m.faces[f][c]], row.begin() + int64_t(3 * c));
        row[9] = m.face_labels[f];
        if ((row[0] + row[3] + row[6]) / 3 < reach)
            faces.insert(row);
    }
    return faces;
}

TEST(engine_streets, a_longer_street_begins_like_a_shorter_one)
{
    for (uint64_t seed : {2, 5}) {
        const auto shorter = beginning(make_street({.seed = seed, .length = 95}).mesh, 30);
        const auto longer = beginning(make_street({.seed = seed, .length = 170}).mesh, 30);
        EXPECT_GT(shorter.size(), 5000u);
        EXPECT_TRUE(shorter == longer) << shorter.size() << " and " << longer.size() << " faces";
    }
}

TEST(engine_streets, kerbs_are_12_to_15_cm_high_and_lowered_at_crossings)
{
    for (uint64_t seed : {1, 7}) {
        const RoadNetwork road(seed, 120);
        const CrossSection& c = road.section();
        EXPECT_GE(c.kerb_height, 0.12);
        EXPECT_LE(c.kerb_height, 0.15);
        EXPECT_GE(c.lane, 3.0);
        EXPECT_LE(c.lane, 3.5);
        MeshBuilder mesh;
        add_road_surface(mesh, road, seed);
        const Mesh m = std::move(mesh).take();
        const auto crossings = crossings_of(road);
        ASSERT_FALSE(crossings.empty());
        const double middle = (crossings[0].first + crossings[0].last) / 2; // in the first block, which is straight
        double highest = 0, at_crossing = 1;
        for (size_t f = 0; f < m.faces.size(); ++f)
            if (m.face_labels[f] == label::kSidewalk)
                for (uint32_t v : m.faces[f]) {
                    const auto& p = m.positions[v];
                    if (p[0] < 1 || p[0] > crossings[0].last || std::abs(p[1]) > c.facade() + 0.01)
                        continue;
                    const double h = p[2] - road.at(p[0], 0).z;
                    highest = std::max(highest, h);
                    if (std::abs(p[0] - middle) < 1.5 && std::abs(std::abs(p[1]) - c.kerb()) < 1e-3 && h > 1e-3)
                        at_crossing = std::min(at_crossing, h);
                }
        EXPECT_NEAR(highest, c.kerb_height, 2e-3);
        EXPECT_NEAR(at_crossing, 0.025, 2e-3);
    }
}

TEST(engine_streets, vehicles_have_their_size)
{
    const auto check = [](const VehicleSize& size, double mirrors, const std::function<void(MeshBuilder&)>& add) {
        MeshBuilder builder;
        add(builder);
        const Mesh m = std::move(builder).take();
        std::array<float, 3> low{99, 99, 99}, high{-99, -99, -99};
        for (const auto& p : m.positions)
            for (size_t a = 0; a < 3; ++a) {
                low[a] = std::min(low[a], p[a]);
                high[a] = std::max(high[a], p[a]);
            }
        EXPECT_NEAR(high[0] - low[0], size.length, 0.1);
        EXPECT_NEAR(high[1] - low[1], size.width, mirrors);
        EXPECT_NEAR(high[2], size.height, 0.1);
        EXPECT_NEAR(low[2], 0, 0.03);
    };
    for (CarBody body : {CarBody::hatchback, CarBody::sedan, CarBody::estate, CarBody::suv, CarBody::van}) {
        const VehicleSize size = car_size(body);
        EXPECT_GE(size.length, 4);
        EXPECT_LE(size.length, 5.3);
        check(size, 0.4, [&](MeshBuilder& m) {
            KeyedRandom r(1, {uint64_t(body)});
            add_car(m, {}, body, r);
        });
    }
    check({7.6, 2.4, 3.3}, 0.4, [](MeshBuilder& m) {
        KeyedRandom r(1, {9});
        add_truck(m, {}, r);
    });
    check({11.8, 2.5, 3.28}, 0.6, [](MeshBuilder& m) {
        KeyedRandom r(1, {9});
        add_bus(m, {}, r);
    });
}

TEST(engine_streets, objects_are_boxes_around_what_was_drawn)
{
    const Street street = make_street({.seed = 1, .length = 90});
    std::vector<size_t> held(kClassCount), all(kClassCount), count(kClassCount);
    for (const SceneObject& o : street.boxes)
        ++count[o.label];
    for (size_t f = 0; f < street.mesh.faces.size(); ++f) {
        const auto& p = street.mesh.positions[street.mesh.faces[f][0]];
        const uint8_t l = street.mesh.face_labels[f];
        ++all[l];
        held[l] += std::ranges::any_of(street.boxes, [&](const SceneObject& o) {
            const std::array<double, 3> at = place_in(o, {p[0], p[1], p[2]});
            const double around = l == label::kBuilding ? 1.5 : 0.001; // balconies and eaves stand out of a plot
            return o.label == l && std::abs(at[0]) < o.size[0] / 2 + around &&
                   std::abs(at[1]) < o.size[1] / 2 + around && std::abs(at[2]) < o.size[2] / 2 + around;
        });
    }
    for (uint8_t l : {label::kCar, label::kPerson, label::kBuilding, label::kTrafficSign}) {
        EXPECT_EQ(held[l], all[l]) << label_name(l);
        EXPECT_GT(count[l], 3u) << label_name(l);
    }
    EXPECT_EQ(count[label::kCar], street.objects.at("car"));
    EXPECT_EQ(count[label::kPerson], street.objects.at("person"));
}

TEST(engine_streets, faces_belong_to_the_object_that_they_were_drawn_for)
{
    const Street street = make_street({.seed = 1, .length = 90});
    ASSERT_EQ(street.owners.size(), street.mesh.faces.size());
    std::vector<size_t> owned(kClassCount), all(kClassCount);
    for (size_t f = 0; f < street.mesh.faces.size(); ++f) {
        const uint8_t l = street.mesh.face_labels[f];
        ++all[l];
        if (street.owners[f] == 0)
            continue;
        ++owned[l];
        const SceneObject& o = street.boxes.at(street.owners[f] - 1);
        ASSERT_EQ(o.id, street.owners[f] - 1);
        ASSERT_EQ(o.label, l);
        const double around = l == label::kBuilding ? 4 : 0.001; // balconies and eaves stand out of a plot
        for (const uint32_t v : street.mesh.faces[f]) {
            const auto& p = street.mesh.positions[v];
            const std::array<double, 3> at = place_in(o, {p[0], p[1], p[2]});
            for (size_t a = 0; a < 3; ++a)
                ASSERT_LE(std::abs(at[a]), o.size[a] / 2 + around) << "object " << o.id << " " << label_name(l);
        }
    }
    for (uint8_t l : {label::kCar, label::kPerson, label::kVegetation, label::kTrafficSign})
        EXPECT_EQ(owned[l], all[l]) << label_name(l);
    EXPECT_GT(double(owned[label::kBuilding]), 0.9 * double(all[label::kBuilding]));
    for (uint8_t l : {label::kRoad, label::kSidewalk, label::kTerrain, label::kRoadLane})
        EXPECT_EQ(owned[l], 0u) << label_name(l);
}

// height of the lowest point of an actor's box over the road below its middle
double above_road(const RoadNetwork& road, const Rigid& pose, const std::array<double, 3>& size, double d)
{
    double nearest = INFINITY, height = 0;
    for (double s = -18; s < road.length() + 20; s += 0.05) {
        const Vector3 p = road.at(s, d);
        if (const double away = std::hypot(p.x - pose[3], p.y - pose[7]); away < nearest) {
            nearest = away;
            height = p.z;
        }
    }
    EXPECT_LT(nearest, 2.0); // two who walk together are one thing
    return pose[11] - size[2] / 2 - height;
}

TEST(engine_streets, what_moves_starts_where_it_was_made_and_stays_on_the_road)
{
    constexpr double kSeconds = 12;
    for (const uint64_t seed : {0u, 1u, 4u}) {
        const Street street = make_street({.seed = seed, .length = 150});
        const std::vector<Actor> actors = moving_actors(street, kSeconds);
        ASSERT_GT(actors.size(), 10u) << seed;
        std::map<uint32_t, const Actor*> by_id;
        std::set<uint32_t> ids;
        for (const SceneObject& o : street.boxes)
            ids.insert(o.id);
        EXPECT_TRUE(check_actor_ids(actors, ids, "traffic"));
        for (const Actor& a : actors) {
            ASSERT_TRUE(by_id.empty() || by_id.rbegin()->first < a.id);
            by_id[a.id] = &a;
            const SceneObject box = as_written(street.boxes[a.id]);
            EXPECT_EQ(a.label, box.label);
            EXPECT_EQ(a.size, box.size);
            ASSERT_GT(a.poses.size(), 1u);
            EXPECT_EQ(a.poses[0].time, 0);
            const Rigid made = box_to_world(box);
            for (size_t n = 0; n < 16; ++n)
                EXPECT_NEAR(a.poses[0].to_world[n], made[n], n % 4 == 3 ? 0 : 4e-9) << a.id;
            for (size_t i = 1; i < a.poses.size(); ++i) {
                const double seconds = double(a.poses[i].time - a.poses[i - 1].time) * 1e-6;
                const Point3 p = translation_of(a.poses[i - 1].to_world), q = translation_of(a.poses[i].to_world);
                ASSERT_GT(seconds, 0);
                EXPECT_LE(std::hypot(q[0] - p[0], q[1] - p[1]) / seconds, 12.5) << a.id;
            }
        }
        size_t vehicles = 0, stayed = 0;
        for (const MovingThing& thing : street.moving)
            for (const uint32_t id : thing.objects) {
                const Actor& a = *by_id.at(id);
                vehicles += a.label != label::kPerson;
                stayed += a.poses.back().time >= int64_t(kSeconds * 1e6);
                const double first = above_road(street.road, a.poses[0].to_world, a.size, thing.d);
                for (size_t i = 0; i < a.poses.size(); i += 7)
                    EXPECT_NEAR(above_road(street.road, a.poses[i].to_world, a.size, thing.d), first, 0.05)
                        << "seed " << seed << " " << label_name(a.label) << " " << id << " pose " << i;
            }
        EXPECT_GE(vehicles, 3u) << seed;
        EXPECT_GT(stayed, actors.size() / 2) << seed;
    }
}

TEST(engine_streets, nobody_drives_into_who_is_ahead)
{
    for (const uint64_t seed : {1u, 2u, 3u, 4u}) {
        const Street street = make_street({.seed = seed, .length = 250});
        const std::vector<Actor> actors = moving_actors(street, 30);
        size_t pairs = 0;
        for (const MovingThing& thing : street.moving)
            for (const MovingThing& other : street.moving) {
                if (thing.lane == MovingThing::kOwnWay || thing.lane != other.lane || thing.s >= other.s)
                    continue;
                ++pairs;
                const auto of = [&](const MovingThing& t) {
                    return std::ranges::find(actors, t.objects[0], &Actor::id);
                };
                const double room = (of(thing)->size[0] + of(other)->size[0]) / 2;
                for (int64_t time = 0; time <= 30000000; time += 100000) {
                    const auto p = pose_at(*of(thing), time), q = pose_at(*of(other), time);
                    if (p && q) { // the road is no shorter than the chord
                        EXPECT_GT(std::hypot((*p)[3] - (*q)[3], (*p)[7] - (*q)[7]), room) << seed << " at " << time;
                    }
                }
            }
        EXPECT_GT(pairs, 5u) << seed;
    }
}

TEST(engine_streets, a_mesh_with_actors_has_them_where_they_are)
{
    const Street street = make_street({.seed = 1, .length = 90});
    const std::vector<Actor> actors = moving_actors(street, 20);
    Mesh mesh = street.mesh;
    std::vector<bool> absent = move_actors(mesh, street, actors, 0);
    EXPECT_EQ(std::ranges::count(absent, true), 0);
    for (size_t v = 0; v < mesh.positions.size(); ++v)
        for (size_t a = 0; a < 3; ++a)
            ASSERT_NEAR(mesh.positions[v][a], street.mesh.positions[v][a], 1e-6);
    size_t moved = 0, gone = 0;
    for (const int64_t time : {3700000, 18250000}) {
        absent = move_actors(mesh, street, actors, time);
        for (size_t f = 0; f < mesh.faces.size(); ++f) {
            const auto actor =
                street.owners[f] == 0 ? actors.end() : std::ranges::find(actors, street.owners[f] - 1, &Actor::id);
            const auto& p = mesh.positions[mesh.faces[f][0]];
            if (actor == actors.end()) {
                ASSERT_EQ(p, street.mesh.positions[mesh.faces[f][0]]);
                continue;
            }
            const auto pose = pose_at(*actor, time);
            ASSERT_EQ(!pose, absent[actor->id]);
            gone += !pose;
            if (!pose)
                continue;
            const Point3 at = transform(inverse(*pose), {p[0], p[1], p[2]});
            for (size_t a = 0; a < 3; ++a)
                ASSERT_LE(std::abs(at[a]), actor->size[a] / 2 + 0.001);
            moved += p != street.mesh.positions[mesh.faces[f][0]];
        }
    }
    EXPECT_GT(moved, 1000u);
    EXPECT_GT(gone, 100u); // who has left the street
}

// the box of a class in which a point lies deepest; null: in none
const SceneObject* deepest_box(std::span<const SceneObject> boxes, uint8_t label, const std::array<double, 3>& point)
{
    const SceneObject* in = nullptr;
    double deepest = 0;
    for (const SceneObject& o : boxes) {
        const std::array<double, 3> at = place_in(o, point);
        double depth = INFINITY;
        for (size_t a = 0; a < 3; ++a)
            depth = std::min(depth, o.size[a] / 2 - std::abs(at[a]));
        if (o.label == label && depth > deepest) {
            deepest = depth;
            in = &o;
        }
    }
    return in;
}

TEST(engine_streets, pieces_of_ground_hold_what_is_paved_alike)
{
    for (uint64_t seed : {1u, 3u, 5u, 8u}) {
        const Street street = make_street({.seed = seed, .length = 90});
        std::map<std::pair<uint32_t, uint32_t>, double> areas; // by piece and material
        double all = 0, held = 0;
        for (size_t f = 0; f < street.mesh.faces.size(); ++f) {
            const uint8_t l = street.mesh.face_labels[f];
            const auto corner = [&](size_t c) {
                const auto& p = street.mesh.positions[street.mesh.faces[f][c]];
                return Vector3{p[0], p[1], p[2]};
            };
            const Vector3 across = cross(corner(1) - corner(0), corner(2) - corner(0));
            const Vector3 middle = (corner(0) + corner(1) + corner(2)) * (1.0 / 3);
            const double area = length(across) / 2, facade = street.road.section().facade();
            if ((l != label::kRoad && l != label::kSidewalk) || across.z < area || std::abs(middle.y) > facade)
                continue;
            all += area;
            if (const SceneObject* in = deepest_box(street.boxes, l, {middle.x, middle.y, middle.z})) {
                held += area;
                areas[{in->id, street.mesh.face_materials[f]}] += area;
            }
        }
        std::map<uint32_t, double> most;
        for (const auto& [of, area] : areas)
            most[of.first] = std::max(most[of.first], area);
        double alike = 0;
        for (const auto& [id, area] : most)
            alike += area;
        EXPECT_GT(held, 0.98 * all) << seed;
        EXPECT_GT(alike, 0.85 * held) << seed; // the rest are gutters, kerbs, setts along the houses and rails
        EXPECT_GT(most.size(), 40u) << seed;
    }
}

TEST(engine_streets, cars_look_along_the_street_and_houses_at_it)
{
    const Street street = make_street({.seed = 3, .length = 60});
    size_t cars = 0, houses = 0;
    for (const SceneObject& o : street.boxes) {
        const double road = std::abs(o.center[1]), facade = street.road.section().facade();
        if (o.label == label::kCar && road < facade && std::abs(o.center[0]) < 15) {
            EXPECT_GT(std::abs(std::cos(o.heading)), 0.9);
            EXPECT_GT(o.size[0], o.size[1] * 1.8);
            ++cars;
        }
        const bool front = std::abs(road - facade - 5.5) < 0.5 && o.center[0] > 0 && o.center[0] < 25;
        if (o.label == label::kBuilding && front && o.size[2] > 5) {
            EXPECT_LT(std::sin(o.heading) * o.center[1], 0); // to the middle of the street
            EXPECT_NEAR(o.size[0], 11, 1e-6);
            ++houses;
        }
    }
    EXPECT_GT(cars, 0u);
    EXPECT_GT(houses, 1u);
}

TEST(engine_streets, solids_look_outwards)
{
    // the volume that faces enclose, by the divergence theorem, is that of the shape
    const auto volume = [](const std::function<void(MeshBuilder&, Finish)>& add) {
        MeshBuilder builder;
        add(builder, builder.finish(Pattern::trim, 2));
        const Mesh m = std::move(builder).take();
        double sum = 0;
        for (const auto& f : m.faces) {
            const auto at = [&](size_t c) {
                const auto& p = m.positions[f[c]];
                return Vector3{p[0], p[1], p[2]};
            };
            sum += dot(at(0), cross(at(1), at(2))) / 6;
        }
        return sum;
    };
    const Frame turned = upright_frame({3, 2, 1}, 0.7);
    EXPECT_NEAR(volume([&](MeshBuilder& m, Finish f) {
                    m.box(f, turned, {-1, -2, 0}, {1, 2, 3}, MeshBuilder::kAllSides);
                }),
                24, 1e-4);
    EXPECT_NEAR(volume([&](MeshBuilder& m, Finish f) { m.tube(f, {1, 1, 0}, 1, {1, 1, 2}, 1, 64, 3); }), 6.283, 0.02);
    EXPECT_NEAR(volume([&](MeshBuilder& m, Finish f) { m.blob(f, turned, {1, 2, 0.5}, 40, 60); }), 4.189, 0.04);
    EXPECT_NEAR(volume([&](MeshBuilder& m, Finish f) {
                    m.torus(f, {0, 1, 0}, {0, 1, 0}, 1, 0.2, 80, 30);
                }),
                0.7896, 0.01);
}

TEST(engine_streets, the_drive_keeps_to_the_right_lane_and_its_twin_beside_it)
{
    const RoadNetwork road(2, 150);
    const Intrinsics lens = pinhole_from_fov(73, 64, 48);
    DriveShape shape, beside;
    beside.offset = 1.5;
    const CameraPath path = drive_along(road, shape, lens), shifted = drive_along(road, beside, lens);
    ASSERT_EQ(path.frames.size(), 56u); // every 2 m from 6 to 116
    ASSERT_EQ(shifted.frames.size(), path.frames.size());
    for (size_t i = 0; i < path.frames.size(); ++i) {
        const double s = 6 + 2.0 * double(i);
        const Point3 p = translation_of(path.frames[i].pose.camera_to_world());
        const Point3 q = translation_of(shifted.frames[i].pose.camera_to_world());
        const Vector3 middle = road.at(s, 0);
        EXPECT_NEAR(p[2] - middle.z, 1.7, 1e-6);
        EXPECT_NEAR(std::hypot(p[0] - middle.x, p[1] - middle.y), road.section().lane / 2, 1e-6);
        EXPECT_NEAR(std::hypot(p[0] - q[0], p[1] - q[1]), 1.5, 1e-6);
        const auto ahead = project(path.frames[i], {road.at(s + 9, -road.section().lane / 2).x,
                                                    road.at(s + 9, -road.section().lane / 2).y, p[2]});
        ASSERT_TRUE(ahead);
        EXPECT_NEAR(ahead->x, 32, 1e-6);
    }
}

} // namespace engine_streets_test
} // namespace semrover
