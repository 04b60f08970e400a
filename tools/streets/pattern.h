// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/image.h"

#include <string_view>

namespace semrover {

// What surfaces of a street look like: pictures that are painted once, the same on every machine. Those marked * are
// near white and get their colour from a tint; those marked + are whole pictures of a thing (a door, a sign), the
// others repeat.
enum class Pattern : uint8_t {
    asphalt,
    road_paint,
    slabs,         // *
    setts,         // * small stones
    kerb,          //
    grass,         //
    earth,         //
    gravel,        // * flat roofs
    brick,         // *
    plaster,       // *
    concrete,      // *
    ashlar,        // *
    planks,        // *
    roof_tiles,    // *
    slate,         // *
    trim,          // * frames, cornices, painted smooth things
    metal,         // *
    pane_dark,     // +
    pane_curtain,  // +
    pane_blind,    // +
    pane_lit,      // +
    office_glass,  // +
    shop_window,   // +
    shop_window_2, // +
    door,          // *+
    glass_door,    // *+
    garage_door,   // *+
    shutter,       // *
    shop_sign,     // *+
    shop_sign_2,   // *+
    shop_sign_3,   // *+
    awning,        // *
    poster,        // +
    poster_2,      // +
    bark,          // *
    leaves,        // *
    hedge,         // *
    car_paint,     // *
    car_side,      // *+
    car_glass,
    rubber,
    rim,           // +
    headlight,     // +
    taillight,     // +
    grille,        // +
    plate,         // +
    bus_side,      // *+
    train_side,    // *+
    cargo,         // *
    fabric,        // *
    skin,          // *
    sign_stop,     // +
    sign_yield,    // +
    sign_speed,    // +
    sign_no_entry, // +
    sign_parking,  // +
    sign_crossing, // +
    sign_priority, // +
    street_name,   // +
    lamp_red,      // + traffic lights
    lamp_amber,    // +
    lamp_green,    // +
    count,
};

struct PatternInfo {
    std::string_view name;
    double metres = 1;    // that the picture's side covers when it repeats
    uint32_t pixels = 64; // of a side
    float gloss = 0;      // what it mirrors at right angles, 0..1
};

const PatternInfo& pattern_info(Pattern pattern);
ImageRgb8 paint_pattern(Pattern pattern);

} // namespace semrover
