// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/streets/class_label.h"
#include "tools/streets/facade.h"

namespace semrover {

namespace {

// colours as houses have them: pale plaster, brick, stone
constexpr Color kPlaster[] = {{0.86, 0.82, 0.72}, {0.84, 0.75, 0.58}, {0.78, 0.66, 0.56}, {0.72, 0.74, 0.72},
                              {0.88, 0.87, 0.83}, {0.8, 0.7, 0.62},   {0.66, 0.7, 0.66},  {0.82, 0.66, 0.5},
                              {0.9, 0.84, 0.76},  {0.7, 0.62, 0.56},  {0.76, 0.78, 0.8}};
constexpr Color kBrick[] = {{0.6, 0.36, 0.28}, {0.52, 0.32, 0.27}, {0.66, 0.45, 0.33},
                            {0.7, 0.58, 0.44}, {0.46, 0.34, 0.3},  {0.62, 0.42, 0.36}};
constexpr Color kStone[] = {{0.78, 0.74, 0.66}, {0.72, 0.7, 0.66}, {0.8, 0.75, 0.64}, {0.64, 0.62, 0.58}};
constexpr Color kConcrete[] = {{0.72, 0.71, 0.69}, {0.64, 0.64, 0.63}, {0.78, 0.76, 0.72}};
constexpr Color kDoor[] = {{0.32, 0.2, 0.13}, {0.15, 0.24, 0.2},  {0.16, 0.2, 0.3},
                           {0.4, 0.13, 0.11}, {0.18, 0.18, 0.18}, {0.45, 0.32, 0.2}};
constexpr Color kSign[] = {{0.17, 0.27, 0.24}, {0.2, 0.22, 0.32}, {0.44, 0.15, 0.13}, {0.16, 0.16, 0.17},
                           {0.5, 0.4, 0.24},   {0.14, 0.33, 0.4}, {0.4, 0.27, 0.32}};
constexpr Color kAwning[] = {{0.5, 0.17, 0.15}, {0.2, 0.32, 0.24}, {0.22, 0.27, 0.38}, {0.58, 0.5, 0.36}};
constexpr Color kShutter[] = {{0.24, 0.34, 0.28}, {0.36, 0.26, 0.2}, {0.5, 0.54, 0.56}, {0.28, 0.33, 0.4}};

void choose_walls(FacadeStyle& s, MeshBuilder& m, KeyedRandom& r, uint32_t district)
{
    const double kind = r.uniform();
    const uint8_t b = label::kBuilding;
    if (s.curtain_wall || (district == 1 && kind < 0.3))
        s.wall = m.finish(Pattern::concrete, b, r.pick(kConcrete));
    else if (kind < (district == 0 ? 0.42 : 0.55))
        s.wall = m.finish(Pattern::brick, b, r.pick(kBrick));
    else if (kind < (district == 0 ? 0.56 : 0.6))
        s.wall = m.finish(Pattern::ashlar, b, r.pick(kStone));
    else
        s.wall = m.finish(Pattern::plaster, b, r.pick(kPlaster));
    s.base = r.chance(0.6) ? m.finish(Pattern::ashlar, b, r.pick(kStone)) : s.wall;
    const double light = r.uniform(0.8, 0.92);
    s.trim = m.finish(Pattern::trim, b, r.chance(0.75) ? Color{light, light * 0.985, light * 0.94} : r.pick(kStone));
    const double frame = r.chance(0.72) ? r.uniform(0.84, 0.92) : r.uniform(0.16, 0.3);
    s.frame = m.finish(Pattern::trim, b, {frame, frame, frame * 0.98});
}

void choose_openings(FacadeStyle& s, MeshBuilder& m, KeyedRandom& r)
{
    const uint8_t b = label::kBuilding;
    s.door = m.finish(Pattern::door, b, r.pick(kDoor));
    s.garage = m.finish(Pattern::garage_door, b, r.chance(0.5) ? Color{0.75, 0.75, 0.73} : r.pick(kDoor));
    s.glass_door = m.finish(Pattern::glass_door, b, s.curtain_wall ? Color{0.5, 0.5, 0.5} : r.pick(kDoor));
    s.shutter = m.finish(Pattern::shutter, b, r.pick(kShutter));
    constexpr Pattern signs[] = {Pattern::shop_sign, Pattern::shop_sign_2, Pattern::shop_sign_3};
    const Pattern sign = r.pick(signs);
    s.sign = m.finish(sign, b, sign == Pattern::shop_sign_3 ? r.pick(kPlaster) : r.pick(kSign));
    s.awning = m.finish(Pattern::awning, b, r.pick(kAwning));
    s.metal = m.finish(Pattern::metal, b, {0.22, 0.23, 0.24});
    if (s.curtain_wall)
        for (const Color& tint : {Color{1, 1, 1}, {0.86, 0.9, 0.94}, {0.75, 0.82, 0.86}})
            s.panes.push_back(m.finish(Pattern::office_glass, b, tint));
    else
        for (Pattern p : {Pattern::pane_dark, Pattern::pane_curtain, Pattern::pane_dark, Pattern::pane_blind,
                          Pattern::pane_curtain, Pattern::pane_dark, Pattern::pane_lit})
            s.panes.push_back(m.finish(p, b));
    s.shop_panes = {m.finish(Pattern::shop_window, b), m.finish(Pattern::shop_window_2, b)};
}

} // namespace

FacadeStyle random_style(MeshBuilder& m, KeyedRandom& r, uint32_t district)
{
    FacadeStyle s;
    s.curtain_wall = district == 2 ? r.chance(0.65) : r.chance(0.06);
    s.storeys = district == 0 ? 3 + int(r.below(3)) : district == 1 ? 2 + int(r.below(4)) : 4 + int(r.below(4));
    s.ground_height = r.uniform(3.3, 4.2);
    s.storey = r.uniform(2.85, 3.45);
    s.bay = r.uniform(2.1, 3.1);
    s.window_width = r.uniform(0.9, 1.3);
    s.window_height = r.uniform(1.45, 1.95);
    s.recess = r.uniform(0.1, 0.22);
    constexpr WindowKind kinds[] = {WindowKind::casement, WindowKind::cross, WindowKind::sash, WindowKind::french};
    s.window = r.pick(kinds);
    s.ground = r.chance(district == 0   ? 0.62
                        : district == 1 ? 0.18
                                        : 0.3)
                   ? GroundFloor::shops
               : s.curtain_wall ? GroundFloor::lobby
                                : GroundFloor::homes;
    s.shutters = s.window != WindowKind::french && !s.curtain_wall && r.chance(0.22) && s.bay > s.window_width * 2;
    s.balconies = !s.curtain_wall && r.chance(district == 1 ? 0.6 : 0.3);
    s.courses = r.chance(0.5);
    s.cornice = r.chance(0.75);
    s.surrounds = r.chance(0.65);
    s.awnings = r.chance(0.5);
    s.garages = district == 1 && r.chance(0.3);
    choose_walls(s, m, r, district);
    choose_openings(s, m, r);
    return s;
}

} // namespace semrover
