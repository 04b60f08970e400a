// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/streets/facade.h"

namespace semrover {

// What stands on a plot: the frame's origin is the left corner of the front on the ground, x to the right seen from the
// street, y into the plot, z up
struct BuildingPlot {
    Frame frame;
    double width = 10, depth = 11;
    double below = 0.3;                         // how far walls go down under the origin, where the street slopes
    bool open_left = false, open_right = false; // sides that streets or gardens see
    double hidden_left = 0, hidden_right = 0;   // how high a neighbour's house covers the other sides; there is no wall
};

// walls and roof; the style's walls may be its own (random_style)
void add_building(MeshBuilder& mesh, const FacadeStyle& style, const BuildingPlot& plot, uint64_t seed, uint64_t key);

} // namespace semrover
