// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// trucks, buses and trams: long boxes with rounded edges
#include "tools/streets/class_label.h"
#include "tools/streets/street_objects.h"

#include <algorithm>
#include <numbers>

namespace semrover {

namespace {

// a box from x0 to x1 with rounded edges along it; a picture on each flank; open ends
struct Hull {
    double x0, x1, width, low, high, round;
};

void add_hull(MeshBuilder& m, const Frame& f, const Hull& h, Finish flank, Finish roof, bool mirrored)
{
    const double y = h.width / 2, top = h.high - h.round;
    const auto p = [&](double x, double py, double z) { return f.at(x, py, z); };
    const Span ahead{0, 0, 1, 1}, back{1, 0, 0, 1}; // the picture's left end is the front
    m.picture(flank, p(h.x1, y, h.low), p(h.x0, y, h.low), p(h.x0, y, top), p(h.x1, y, top), mirrored ? back : ahead);
    m.picture(flank, p(h.x0, -y, h.low), p(h.x1, -y, h.low), p(h.x1, -y, top), p(h.x0, -y, top),
              mirrored ? ahead : back);
    std::vector<std::vector<Vector3>> rings;
    for (double x : {h.x0, h.x1}) {
        auto& ring = rings.emplace_back();
        for (int i = 0; i <= 8; ++i) { // a quarter circle, the roof, a quarter circle
            const double t = std::numbers::pi / 2 * (i <= 4 ? i / 4.0 : (i - 5) / 3.0 + 1);
            const double side = i <= 4 ? y - h.round : -y + h.round;
            ring.push_back(p(x, side + h.round * std::cos(t), top + h.round * std::sin(t)));
        }
    }
    m.loft(roof, rings, false);
}

// an end wall with a windscreen that leans back; way: +1 front, -1 rear
void add_end(MeshBuilder& m, const Frame& f, const Hull& h, int way, Finish paint, Finish glass, double sill)
{
    const double x = way > 0 ? h.x1 : h.x0, y = h.width / 2, lean = 0.02 * way;
    const auto p = [&](double py, double z, double out) { return f.at(x + out, py * way, z); };
    const double top = h.high - h.round * 0.6;
    m.quad(paint, p(-y, h.low, 0), p(y, h.low, 0), p(y, top, 0), p(-y, top, 0));
    m.quad(paint, p(-y, top, 0), p(y, top, 0), p(y - h.round, h.high, 0), p(-y + h.round, h.high, 0));
    m.quad(glass, p(-y + 0.12, sill, lean), p(y - 0.12, sill, lean), p(y - 0.14, top - 0.12, lean * 0.6),
           p(-y + 0.14, top - 0.12, lean * 0.6));
    const Finish dark = m.finish(Pattern::rubber, glass.label);
    m.quad(dark, p(-y + 0.05, h.low, lean), p(y - 0.05, h.low, lean), p(y - 0.05, h.low + 0.22, lean),
           p(-y + 0.05, h.low + 0.22, lean));
    const Finish lamp = m.finish(way > 0 ? Pattern::headlight : Pattern::taillight, glass.label);
    for (double s : {-1.0, 1.0}) {
        const double a = s * (y - 0.12) - 0.19 * (s > 0), b = a + 0.19;
        m.picture(lamp, p(a, h.low + 0.3, lean), p(b, h.low + 0.3, lean), p(b, h.low + 0.55, lean),
                  p(a, h.low + 0.55, lean));
    }
}

void add_wheels(MeshBuilder& m, const Frame& f, double at, double width, double radius, uint8_t l)
{
    for (int side : {1, -1}) {
        Frame axle = f.moved(at, side * (width / 2 + 0.002), radius);
        m.disc(m.finish(Pattern::rubber, l, {0.8, 0.8, 0.8}), axle.at(0, side * 0.003, 0.095), axle.y * double(side),
               radius + 0.09, 16);
        if (side < 0)
            axle = axle.turned(std::numbers::pi);
        add_wheel(m, axle.moved(0, 0.012, 0), radius, 0.28, l);
    }
}

void add_underside(MeshBuilder& m, const Frame& f, const Hull& h, uint8_t l)
{
    const Finish dark = m.finish(Pattern::rubber, l, {0.7, 0.7, 0.7});
    m.box(dark, f, {h.x0 + 0.1, -h.width / 2 + 0.08, 0.28}, {h.x1 - 0.1, h.width / 2 - 0.08, h.low + 0.02},
          MeshBuilder::kBottom | MeshBuilder::kStanding);
}

} // namespace

void add_truck(MeshBuilder& m, const Frame& f, KeyedRandom& r)
{
    constexpr Color cabs[] = {
        {0.85, 0.85, 0.84}, {0.2, 0.28, 0.42}, {0.5, 0.15, 0.12}, {0.62, 0.6, 0.3}, {0.25, 0.36, 0.3}};
    constexpr Color boxes[] = {{0.84, 0.84, 0.82}, {0.74, 0.73, 0.7}, {0.42, 0.47, 0.52}, {0.7, 0.62, 0.5}};
    const uint8_t l = label::kTruck;
    const ObjectNote note(m, l, f);
    const Finish paint = m.finish(Pattern::car_paint, l, r.pick(cabs)), glass = m.finish(Pattern::car_glass, l);
    const Finish cargo = m.finish(Pattern::cargo, l, r.pick(boxes)),
                 metal = m.finish(Pattern::metal, l, {0.3, 0.3, 0.3});
    const Hull cab{1.9, 3.8, 2.3, 0.55, 2.6, 0.2};
    add_hull(m, f, cab, paint, paint, false);
    add_end(m, f, cab, 1, paint, glass, 1.45);
    m.quad(paint, f.at(1.9, 1.15, 0.55), f.at(1.9, -1.15, 0.55), f.at(1.9, -1.15, 2.5), f.at(1.9, 1.15, 2.5));
    for (double side : {1.0, -1.0}) { // windows of the doors
        const double y = side * 1.156, a = side > 0 ? 3.62 : 2.65, b = side > 0 ? 2.65 : 3.62;
        m.quad(glass, f.at(a, y, 1.5), f.at(b, y, 1.5), f.at(b, y, 2.25), f.at(a, y, 2.25));
        m.box(metal, f, {3.5, side * 1.28 - 0.08, 1.5}, {3.6, side * 1.28 + 0.08, 2.0}, MeshBuilder::kAllSides);
    }
    m.box(cargo, f, {-3.8, -1.2, 0.95}, {1.7, 1.2, 3.3}, MeshBuilder::kAllSides);
    m.box(metal, f, {-3.75, -0.45, 0.55}, {1.9, 0.45, 0.95}, MeshBuilder::kAllSides);
    const Finish tail = m.finish(Pattern::taillight, l);
    for (double y : {-1.0, 0.75})
        m.picture(tail, f.at(-3.81, y + 0.25, 0.8), f.at(-3.81, y, 0.8), f.at(-3.81, y, 0.95),
                  f.at(-3.81, y + 0.25, 0.95));
    for (double x : {2.75, -2.1, -3.05})
        add_wheels(m, f, x, 2.3, 0.46, l);
}

void add_bus(MeshBuilder& m, const Frame& f, KeyedRandom& r)
{
    constexpr Color paints[] = {
        {0.72, 0.2, 0.16}, {0.83, 0.8, 0.72}, {0.2, 0.36, 0.55}, {0.3, 0.5, 0.36}, {0.85, 0.66, 0.2}};
    const uint8_t l = label::kBus;
    const ObjectNote note(m, l, f);
    const Color c = r.pick(paints);
    const Finish paint = m.finish(Pattern::car_paint, l, c), flank = m.finish(Pattern::bus_side, l, c);
    const Hull h{-5.9, 5.9, 2.5, 0.35, 3.1, 0.22};
    add_hull(m, f, h, flank, paint, false);
    for (int way : {1, -1})
        add_end(m, f, h, way, paint, m.finish(Pattern::car_glass, l), way > 0 ? 1.05 : 1.6);
    const Finish sign = m.finish(Pattern::shop_sign_2, l, {0.12, 0.12, 0.12});
    m.picture(sign, f.at(5.935, -0.8, 2.62), f.at(5.935, 0.8, 2.62), f.at(5.935, 0.8, 2.86), f.at(5.935, -0.8, 2.86));
    for (double side : {1.0, -1.0})
        m.box(m.finish(Pattern::rubber, l), f, {5.85, side * 1.42 - 0.1, 1.9}, {5.98, side * 1.42 + 0.1, 2.5},
              MeshBuilder::kAllSides);
    m.box(m.finish(Pattern::metal, l, {0.7, 0.7, 0.7}), f, {-2.2, -0.8, 3.08}, {0.6, 0.8, 3.28});
    add_underside(m, f, h, l);
    for (double x : {3.1, -2.9})
        add_wheels(m, f, x, 2.5, 0.48, l);
}

void add_tram(MeshBuilder& m, const Frame& f, KeyedRandom& r)
{
    constexpr Color paints[] = {{0.68, 0.16, 0.14}, {0.8, 0.77, 0.68}, {0.24, 0.42, 0.3}, {0.85, 0.7, 0.25}};
    const uint8_t l = label::kTrain;
    const ObjectNote note(m, l, f);
    const Color c = r.pick(paints);
    const Finish paint = m.finish(Pattern::car_paint, l, c), flank = m.finish(Pattern::train_side, l, c);
    const Finish glass = m.finish(Pattern::car_glass, l), dark = m.finish(Pattern::rubber, l);
    for (int car = -1; car <= 1; ++car) {
        const Hull h{car * 9.1 - 4.3, car * 9.1 + 4.3, 2.4, 0.32, 3.4, 0.3};
        add_hull(m, f, h, flank, paint, car < 0);
        for (int way : {1, -1})
            if (way == car)
                add_end(m, f, h, way, paint, glass, 1.15);
        if (car < 1) // bellows
            m.box(dark, f, {h.x1 - 0.05, -1.05, 0.5}, {h.x1 + 0.55, 1.05, 3.2},
                  MeshBuilder::kLeft | MeshBuilder::kRight | MeshBuilder::kTop);
        m.box(m.finish(Pattern::metal, l, {0.55, 0.56, 0.57}), f, {h.x0 + 1.5, -0.7, 3.38}, {h.x1 - 1.5, 0.7, 3.62});
        m.box(dark, f, {h.x0 + 0.4, -1.0, 0.08}, {h.x1 - 0.4, 1.0, 0.34});
    }
    m.tube(dark, f.at(-0.9, 0, 3.6), 0.03, f.at(0.5, 0, 4.3), 0.03, 5, 0); // current collector
    m.tube(dark, f.at(0.5, 0, 4.3), 0.03, f.at(-0.5, 0, 5.0), 0.03, 5, 0);
    m.tube(dark, f.at(-0.5, -0.7, 5.0), 0.03, f.at(-0.5, 0.7, 5.0), 0.03, 5, 3);
}

} // namespace semrover
