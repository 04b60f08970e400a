// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/keyed_random.h"
#include "tools/streets/mesh_builder.h"

namespace semrover {

enum class TreeKind : uint8_t { round, tall, spreading, young };

// trunk and branches, and a crown of many small leaves
void add_tree(MeshBuilder& mesh, const Frame& foot, TreeKind kind, KeyedRandom& random);
// a mound of leaves of these half axes, standing on the ground
void add_bush(MeshBuilder& mesh, const Frame& foot, const Vector3& radii, KeyedRandom& random);
// clipped, along the frame's x
void add_hedge(MeshBuilder& mesh, const Frame& foot, double length, double width, double height, KeyedRandom& random);

} // namespace semrover
