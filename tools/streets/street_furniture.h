// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/keyed_random.h"
#include "tools/streets/mesh_builder.h"

namespace semrover {

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
