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

} // namespace semrover
