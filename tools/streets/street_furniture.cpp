// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/streets/street_objects.h"

#include "tools/streets/class_label.h"

#include <algorithm>
#include <numbers>

namespace semrover {

namespace {

constexpr Color kSteel = {0.5, 0.51, 0.51}, kDarkGreen = {0.2, 0.24, 0.22}, kAnthracite = {0.24, 0.25, 0.26};

void post(MeshBuilder& m, const Frame& f, double height, double radius, const Color& c)
{
    const Finish pole = m.finish(Pattern::metal, label::kPole, c);
    m.tube(pole, f.at(0, 0, -0.05), radius * 1.6, f.at(0, 0, 0.5), radius * 1.5, 8, 0);
    m.tube(pole, f.at(0, 0, 0.5), radius * 1.1, f.at(0, 0, height), radius * 0.8, 8, 2);
}

// three lamps in a black box whose face looks against x
void signal_head(MeshBuilder& m, const Frame& f, double y, double z, bool red)
{
    const uint8_t l = label::kTrafficLight;
    const Finish box = m.finish(Pattern::rubber, l, {0.9, 0.95, 0.9});
    m.box(box, f, {-0.12, y - 0.16, z - 0.45}, {0.12, y + 0.16, z + 0.45}, MeshBuilder::kAllSides);
    const Finish off = m.finish(Pattern::rubber, l);
    const Finish lamps[] = {red ? m.finish(Pattern::lamp_red, l) : off, m.finish(Pattern::lamp_amber, l),
                            m.finish(Pattern::lamp_green, l, red ? Color{0.7, 0.7, 0.7} : Color{1, 1, 1})};
    for (int i = 0; i < 3; ++i) {
        const double at = z + 0.28 - 0.28 * i;
        m.disc(lamps[i], f.at(-0.126, y, at), f.x * -1, 0.1, 14, true);
        std::vector<std::vector<Vector3>> visor; // half a ring over the lamp
        for (double x : {-0.125, -0.27}) {
            auto& ring = visor.emplace_back();
            for (int k = 0; k <= 6; ++k) {
                const double t = std::numbers::pi * k / 6;
                ring.push_back(f.at(x, y + 0.115 * std::cos(t), at + 0.115 * std::sin(t)));
            }
        }
        std::ranges::reverse(visor);
        m.loft(box, visor, false);
    }
}

void plate(MeshBuilder& m, const Frame& f, Pattern face, double z, double size, int corners, double turn)
{
    const Finish front = m.finish(face, label::kTrafficSign);
    const Finish back = m.finish(Pattern::metal, label::kTrafficSign, {0.55, 0.55, 0.55});
    const Vector3 c = f.at(-0.06, 0, z);
    std::vector<Vector3> edge, behind;
    std::vector<std::array<double, 2>> uv;
    for (int i = 0; i < corners; ++i) {
        const double t = turn + 2 * std::numbers::pi * i / corners, u = std::cos(t), v = std::sin(t);
        // seen against x, the left hand is +y
        edge.push_back(c + f.y * (-u * size / 2) + f.z * (v * size / 2));
        behind.push_back(edge.back() + f.x * 0.02);
        uv.push_back({0.5 + u / 2, 0.5 + v / 2});
    }
    for (int i = 1; i + 1 < corners; ++i)
        m.pictured(front, {edge[0], edge[size_t(i)], edge[size_t(i) + 1]}, {uv[0], uv[size_t(i)], uv[size_t(i) + 1]});
    std::ranges::reverse(behind);
    m.polygon(back, behind);
}

} // namespace

void add_street_light(MeshBuilder& m, const Frame& f, double height, bool old_fashioned)
{
    const ObjectNote note(m, label::kPole, f);
    const Color color = old_fashioned ? kDarkGreen : kSteel;
    const Finish metal = m.finish(Pattern::metal, label::kPole, color);
    const Finish lamp = m.finish(Pattern::trim, label::kPole, {0.93, 0.92, 0.86});
    post(m, f, height, old_fashioned ? 0.07 : 0.08, color);
    if (old_fashioned) {
        m.tube(lamp, f.at(0, 0, height), 0.1, f.at(0, 0, height + 0.4), 0.18, 6, 0);
        m.tube(metal, f.at(0, 0, height + 0.4), 0.24, f.at(0, 0, height + 0.62), 0.04, 6, 3);
        m.blob(metal, f.moved(0, 0, height + 0.66), {0.05, 0.05, 0.08}, 4, 6);
        m.tube(metal, f.at(0, 0, height * 0.3), 0.1, f.at(0, 0, height * 0.32), 0.1, 8, 3);
        return;
    }
    const Vector3 top = f.at(0, 0, height - 0.1), bend = f.at(0, 0.6, height + 0.35), end = f.at(0, 1.7, height + 0.45);
    m.tube(metal, top, 0.05, bend, 0.045, 7, 0);
    m.tube(metal, bend, 0.045, end, 0.04, 7, 0);
    m.blob(metal, f.moved(0, 1.95, height + 0.46), {0.14, 0.36, 0.08}, 5, 9);
    m.quad(lamp, f.at(-0.1, 2.2, height + 0.375), f.at(0.1, 2.2, height + 0.375), f.at(0.1, 1.72, height + 0.375),
           f.at(-0.1, 1.72, height + 0.375));
}

void add_traffic_light(MeshBuilder& m, const Frame& f, bool arm, bool red)
{
    const ObjectNote pole(m, label::kPole, f), lights(m, label::kTrafficLight, f.turned(std::numbers::pi));
    post(m, f, arm ? 5.6 : 3.2, 0.07, kAnthracite);
    signal_head(m, f, arm ? 0.26 : 0.0, 2.75, red);
    if (!arm)
        return;
    const Finish metal = m.finish(Pattern::metal, label::kPole, kAnthracite);
    m.tube(metal, f.at(0.14, 0, 5.4), 0.06, f.at(0.14, 3.6, 5.7), 0.04, 7, 2);
    signal_head(m, f, 3.3, 5.35, red);
}

void add_sign(MeshBuilder& m, const Frame& f, SignKind kind)
{
    const ObjectNote pole(m, label::kPole, f), shield(m, label::kTrafficSign, f.turned(std::numbers::pi));
    post(m, f, 2.85, 0.035, kSteel);
    const double z = 2.45;
    switch (kind) {
    case SignKind::stop:
        return plate(m, f, Pattern::sign_stop, z, 0.76, 8, std::numbers::pi / 8);
    case SignKind::yield:
        return plate(m, f, Pattern::sign_yield, z, 0.9, 3, -std::numbers::pi / 2);
    case SignKind::speed:
        return plate(m, f, Pattern::sign_speed, z, 0.62, 20, 0);
    case SignKind::no_entry:
        return plate(m, f, Pattern::sign_no_entry, z, 0.62, 20, 0);
    case SignKind::parking:
        return plate(m, f, Pattern::sign_parking, z, 0.8, 4, std::numbers::pi / 4);
    case SignKind::crossing:
        return plate(m, f, Pattern::sign_crossing, z, 0.85, 4, std::numbers::pi / 4);
    case SignKind::priority:
        return plate(m, f, Pattern::sign_priority, z, 0.7, 4, 0);
    default:
        break;
    }
    const Finish face = m.finish(Pattern::street_name, label::kTrafficSign);
    m.picture(face, f.at(-0.05, 0.45, 2.5), f.at(-0.05, -0.45, 2.5), f.at(-0.05, -0.45, 2.75), f.at(-0.05, 0.45, 2.75),
              {0, 0.25, 1, 0.75});
    m.picture(face, f.at(-0.03, -0.45, 2.5), f.at(-0.03, 0.45, 2.5), f.at(-0.03, 0.45, 2.75), f.at(-0.03, -0.45, 2.75),
              {0, 0.25, 1, 0.75});
}

void add_bollard(MeshBuilder& m, const Frame& f)
{
    const ObjectNote note(m, label::kPole, f);
    const Finish metal = m.finish(Pattern::metal, label::kPole, kAnthracite);
    m.tube(metal, f.at(0, 0, -0.02), 0.06, f.at(0, 0, 0.85), 0.05, 9, 0);
    m.tube(m.finish(Pattern::trim, label::kPole, {0.85, 0.85, 0.83}), f.at(0, 0, 0.68), 0.058, f.at(0, 0, 0.76), 0.058,
           9, 0);
    m.blob(metal, f.moved(0, 0, 0.87), {0.06, 0.06, 0.06}, 4, 9);
}

void add_bin(MeshBuilder& m, const Frame& f, KeyedRandom& r)
{
    const ObjectNote note(m, label::kPole, f);
    constexpr Color colors[] = {{0.2, 0.3, 0.22}, {0.3, 0.31, 0.32}, {0.2, 0.26, 0.36}, {0.5, 0.34, 0.14}};
    const Color c = r.pick(colors);
    if (r.chance(0.5)) { // on wheels, of the houses
        const Finish body = m.finish(Pattern::car_paint, label::kPole, {c[0] * 0.8, c[1] * 0.8, c[2] * 0.8});
        const auto ring = [&](double s, double z) {
            return std::vector{f.at(s, -s * 1.1, z), f.at(s, s * 1.1, z), f.at(-s, s * 1.1, z), f.at(-s, -s * 1.1, z)};
        };
        m.loft(body, {ring(0.2, 0.08), ring(0.28, 0.95)});
        m.box(body, f, {-0.3, -0.33, 0.95}, {0.32, 0.33, 1.04}, MeshBuilder::kAllSides);
        return;
    }
    const Finish body = m.finish(Pattern::metal, label::kPole, c);
    m.tube(body, f.at(0, 0, 0), 0.2, f.at(0, 0, 0.8), 0.24, 12, 0);
    m.tube(m.finish(Pattern::rubber, label::kPole), f.at(0, 0, 0.8), 0.2, f.at(0, 0, 0.9), 0.22, 12, 2);
    m.tube(body, f.at(0, 0, 0.95), 0.26, f.at(0, 0, 1.02), 0.15, 12, 3);
}

void add_bench(MeshBuilder& m, const Frame& f)
{
    const ObjectNote note(m, label::kFence, f.turned(std::numbers::pi / 2));
    const Finish wood = m.finish(Pattern::planks, label::kFence, {0.6, 0.44, 0.3});
    const Finish metal = m.finish(Pattern::metal, label::kFence, kAnthracite);
    for (double y : {-0.2, -0.05, 0.1})
        m.box(wood, f, {-0.85, y, 0.43}, {0.85, y + 0.12, 0.47}, MeshBuilder::kAllSides);
    for (double z : {0.58, 0.74})
        m.box(wood, f, {-0.85, -0.3, z}, {0.85, -0.26, z + 0.11}, MeshBuilder::kAllSides);
    for (double x : {-0.7, 0.65}) {
        m.box(metal, f, {x, -0.22, 0}, {x + 0.05, 0.2, 0.43});
        m.box(metal, f, {x, -0.26, 0.4}, {x + 0.05, -0.22, 0.84});
    }
}

void add_cabinet(MeshBuilder& m, const Frame& f)
{
    const ObjectNote note(m, label::kWall, f.turned(std::numbers::pi / 2));
    m.box(m.finish(Pattern::metal, label::kWall, {0.56, 0.58, 0.54}), f, {-0.55, -0.18, 0.08}, {0.55, 0.18, 1.3});
    m.box(m.finish(Pattern::concrete, label::kWall, {0.6, 0.6, 0.6}), f, {-0.6, -0.2, -0.02}, {0.6, 0.2, 0.08});
    m.box(m.finish(Pattern::metal, label::kWall, {0.42, 0.44, 0.42}), f, {-0.006, 0.18, 0.12}, {0.006, 0.185, 1.25});
}

void add_planter(MeshBuilder& m, const Frame& f, KeyedRandom& r)
{
    const ObjectNote note(m, label::kWall, f);
    m.box(m.finish(Pattern::concrete, label::kWall, {0.66, 0.64, 0.6}), f, {-0.6, -0.3, 0}, {0.6, 0.3, 0.5});
    add_bush(m, f.moved(0, 0, 0.4), {0.58, 0.32, 0.5}, r);
}

void add_bike_rack(MeshBuilder& m, const Frame& f, int bicycles, KeyedRandom& r)
{
    const Finish metal = m.finish(Pattern::metal, label::kFence, kSteel);
    for (int i = 0; i < bicycles; ++i) {
        const Frame g = f.moved(0.75 * i, 0, 0);
        for (double y : {-0.4, 0.4})
            m.tube(metal, g.at(0, y, 0), 0.025, g.at(0, y, 0.78), 0.025, 6, 0);
        m.tube(metal, g.at(0, -0.4, 0.78), 0.025, g.at(0, 0.4, 0.78), 0.025, 6, 3);
        if (r.chance(0.75))
            add_bicycle(m,
                        g.moved(0.14, r.uniform(-0.1, 0.1), 0)
                            .turned(std::numbers::pi / 2 * (r.chance(0.5) ? 1 : -1) + r.uniform(-0.1, 0.1)),
                        r);
    }
}

void add_bus_stop(MeshBuilder& m, const Frame& f)
{
    const ObjectNote note(m, label::kBuilding, f.turned(std::numbers::pi / 2));
    const uint8_t l = label::kBuilding;
    const Finish metal = m.finish(Pattern::metal, l, kAnthracite),
                 glass = m.finish(Pattern::office_glass, l, {0.95, 1, 1});
    for (double x : {-2.0, -0.03, 1.94})
        m.box(metal, f, {x, -0.75, 0}, {x + 0.06, -0.69, 2.4});
    m.box(metal, f, {-2.1, -0.85, 2.4}, {2.1, 0.75, 2.52}, MeshBuilder::kAllSides);
    for (double x : {-1.94, 0.03}) // back, seen from both sides
        for (double y : {-0.71, -0.73}) {
            const double a = y > -0.72 ? x + 1.9 : x, b = y > -0.72 ? x : x + 1.9;
            m.picture(glass, f.at(a, y, 0.35), f.at(b, y, 0.35), f.at(b, y, 2.25), f.at(a, y, 2.25));
        }
    const Finish ad = m.finish(Pattern::poster, l), ad_2 = m.finish(Pattern::poster_2, l);
    m.box(metal, f, {1.94, -0.7, 0.3}, {2.06, 0.5, 2.2}, MeshBuilder::kAllSides);
    m.picture(ad, f.at(1.93, 0.42, 0.4), f.at(1.93, -0.62, 0.4), f.at(1.93, -0.62, 2.1), f.at(1.93, 0.42, 2.1));
    m.picture(ad_2, f.at(2.07, -0.62, 0.4), f.at(2.07, 0.42, 0.4), f.at(2.07, 0.42, 2.1), f.at(2.07, -0.62, 2.1));
    m.box(m.finish(Pattern::planks, l, {0.55, 0.42, 0.3}), f, {-1.6, -0.6, 0.42}, {1.2, -0.25, 0.47},
          MeshBuilder::kAllSides);
    for (double x : {-1.5, 1.0})
        m.box(metal, f, {x, -0.5, 0}, {x + 0.06, -0.4, 0.42});
}

void add_railing(MeshBuilder& m, const Frame& f, double length)
{
    const Finish metal = m.finish(Pattern::metal, label::kFence, kSteel);
    for (double z : {0.55, 1.0})
        m.tube(metal, f.at(0, 0, z), 0.022, f.at(length, 0, z), 0.022, 6, 3);
    for (double x = 0.05; x <= length; x += std::max((length - 0.1) / std::ceil(length / 1.5), 0.1))
        m.tube(metal, f.at(x, 0, 0), 0.024, f.at(x, 0, 1.0), 0.024, 6, 0);
}

} // namespace semrover
