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

} // namespace semrover
