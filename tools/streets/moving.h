// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/mesh/mesh.h"
#include "engine/scene/actors.h"

#include <vector>

namespace semrover {

struct Street;

// A thing of a street that could move along it: a vehicle, a cyclist, somebody who walks.
struct MovingThing {
    std::vector<uint32_t> objects = {}; // ids of its boxes: a bicycle and its rider
    double s = 0, d = 0;                // where it was made: along the street, to the left of the centre line
    int way = 1;                        // +1 along the street, -1 against it
    uint32_t lane = 0;                  // kOwnWay: nobody is in its way; those of another lane keep behind each other
    double speed = 8;                   // m/s, where nobody is ahead
    double low = 0, high = 0;           // how far it may go along the street
    bool stays = false;                 // stands where its way ends; others are gone from there on
    bool upright = false;               // others lean with the road's slope

    static constexpr uint32_t kOwnWay = 0;
};

// Where the moving things of a street are from the time 0, when all are where they were made, for so many seconds: the
// first pose is that of the object's box, to the bit of what files hold. They follow the road's curve and height,
// keep their distance from who is ahead in their lane, and slow down for nothing else.
std::vector<Actor> moving_actors(const Street& street, double seconds);

// Moves the vertices of the actors' objects, in a copy of the street's mesh, to where they are at a time. Returns the
// objects that are not there then, by id.
std::vector<bool> move_actors(Mesh& mesh, const Street& street, std::span<const Actor> actors, int64_t time);

} // namespace semrover
