// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/keyed_random.h"
#include "tools/streets/mesh_builder.h"

namespace semrover {

// standing or in a step, on the frame's origin, looking along x
void add_person(MeshBuilder& mesh, const Frame& foot, KeyedRandom& random);
// two-wheelers stand on the frame's origin, their middle, and look along x
void add_bicycle(MeshBuilder& mesh, const Frame& middle, KeyedRandom& random);
void add_motorcycle(MeshBuilder& mesh, const Frame& middle, KeyedRandom& random);
// one who rides: seated over the middle of a bicycle or motorcycle
void add_rider(MeshBuilder& mesh, const Frame& middle, bool motorcycle, KeyedRandom& random);

enum class TreeKind : uint8_t { round, tall, spreading, young };

// trunk and branches, and a crown of many small leaves
void add_tree(MeshBuilder& mesh, const Frame& foot, TreeKind kind, KeyedRandom& random);
// a mound of leaves of these half axes, standing on the ground
void add_bush(MeshBuilder& mesh, const Frame& foot, const Vector3& radii, KeyedRandom& random);
// clipped, along the frame's x
void add_hedge(MeshBuilder& mesh, const Frame& foot, double length, double width, double height, KeyedRandom& random);

enum class CarBody : uint8_t { hatchback, sedan, estate, suv, van };

struct VehicleSize {
    double length, width, height; // metres, without mirrors
};
VehicleSize car_size(CarBody body);

// vehicles stand on the frame's origin, their middle, and look along x
void add_car(MeshBuilder& mesh, const Frame& middle, CarBody body, KeyedRandom& random);
void add_truck(MeshBuilder& mesh, const Frame& middle, KeyedRandom& random); // 7.6 x 2.4 x 3.3 m
void add_bus(MeshBuilder& mesh, const Frame& middle, KeyedRandom& random);   // 11.8 x 2.5 x 3.1 m
void add_tram(MeshBuilder& mesh, const Frame& middle, KeyedRandom& random); // three cars, 27 x 2.4 x 3.5 m; label train

// a wheel whose outer face looks along +y of the frame at its axle
void add_wheel(MeshBuilder& mesh, const Frame& axle, double radius, double width, uint8_t label);

// Things at the kerb. Frames stand on the ground; x along the traffic they serve, y to the left; what hangs over the
// road (arms of lamps and lights) reaches towards +y.
void add_street_light(MeshBuilder& mesh, const Frame& foot, double height, bool old_fashioned);
void add_traffic_light(MeshBuilder& mesh, const Frame& foot, bool arm, bool red);
enum class SignKind : uint8_t { stop, yield, speed, no_entry, parking, crossing, priority, street_name };
void add_sign(MeshBuilder& mesh, const Frame& foot, SignKind kind); // its face looks against x
void add_bollard(MeshBuilder& mesh, const Frame& foot);
void add_bin(MeshBuilder& mesh, const Frame& foot, KeyedRandom& random);
void add_bench(MeshBuilder& mesh, const Frame& foot);
void add_cabinet(MeshBuilder& mesh, const Frame& foot);
void add_planter(MeshBuilder& mesh, const Frame& foot, KeyedRandom& random);
void add_bike_rack(MeshBuilder& mesh, const Frame& foot, int bicycles, KeyedRandom& random);
void add_bus_stop(MeshBuilder& mesh, const Frame& foot); // a shelter of 4 m along x, open towards +y
void add_railing(MeshBuilder& mesh, const Frame& foot, double length);

} // namespace semrover
