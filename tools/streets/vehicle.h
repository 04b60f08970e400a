// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/keyed_random.h"
#include "tools/streets/mesh_builder.h"

namespace semrover {

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

} // namespace semrover
