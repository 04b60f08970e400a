// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/keyed_random.h"
#include "tools/streets/mesh_builder.h"

#include <vector>

namespace semrover {

enum class GroundFloor : uint8_t { homes, shops, lobby };
enum class WindowKind : uint8_t { casement, cross, sash, french };

// How the walls of one building look; metres
struct FacadeStyle {
    Finish wall, base, trim, frame, door, shutter, sign, awning, metal, glass_door, garage;
    std::vector<Finish> panes, shop_panes;
    int storeys = 4; // with the ground floor
    double ground_height = 3.6, storey = 3.0;
    double bay = 2.6, window_width = 1.15, window_height = 1.6;
    double recess = 0.14;
    WindowKind window = WindowKind::casement;
    GroundFloor ground = GroundFloor::homes;
    bool shutters = false, balconies = false, courses = false, cornice = true, surrounds = true, awnings = false;
    bool curtain_wall = false; // offices: bands of glass
    bool garages = false;

    double height() const { return ground_height + storey * (storeys - 1); }
};

FacadeStyle random_style(MeshBuilder& mesh, KeyedRandom& random, uint32_t district);

// A wall from the frame's origin, x to the right seen from outside, y into the building, z up, `width` wide, with
// windows, doors, balconies as the style says; `front`: with entrances and shops.
void add_facade(MeshBuilder& mesh, const FacadeStyle& style, const Frame& wall, double width, bool front,
                KeyedRandom& random);

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
