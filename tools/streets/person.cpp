// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/streets/street_objects.h"

#include "tools/streets/class_label.h"

#include <algorithm>

namespace semrover {

namespace {

constexpr Color kCloth[] = {{0.2, 0.23, 0.32}, {0.55, 0.52, 0.46}, {0.14, 0.14, 0.15},
                            {0.42, 0.2, 0.18}, {0.28, 0.34, 0.28}, {0.66, 0.64, 0.6},
                            {0.3, 0.38, 0.5},  {0.5, 0.42, 0.28},  {0.36, 0.3, 0.36}};
constexpr Color kTrousers[] = {{0.17, 0.2, 0.28}, {0.13, 0.13, 0.14}, {0.34, 0.31, 0.27}, {0.3, 0.36, 0.44}};
constexpr Color kSkin[] = {{0.82, 0.64, 0.54}, {0.7, 0.52, 0.42}, {0.5, 0.35, 0.27}, {0.36, 0.25, 0.2}};
constexpr Color kHair[] = {{0.15, 0.12, 0.1}, {0.35, 0.24, 0.15}, {0.55, 0.45, 0.3}, {0.5, 0.49, 0.48}};

struct Clothes {
    Finish top, legs, skin, hair, shoes;

    Clothes(MeshBuilder& m, uint8_t l, KeyedRandom& r)
        : top(m.finish(Pattern::fabric, l, r.pick(kCloth))), legs(m.finish(Pattern::fabric, l, r.pick(kTrousers))),
          skin(m.finish(Pattern::skin, l, r.pick(kSkin))), hair(m.finish(Pattern::skin, l, r.pick(kHair))),
          shoes(m.finish(Pattern::rubber, l))
    {
    }
};

// joints of a body, in its frame; left, right
struct Posture {
    Vector3 hip, neck, head;
    Vector3 knees[2], feet[2], shoulders[2], elbows[2], hands[2];
};

Posture standing_posture(KeyedRandom& r)
{
    const double step = r.chance(0.6) ? r.uniform(0.12, 0.3) : 0.03, bend = r.uniform(0, 0.12);
    Posture p;
    p.hip = {0, 0, 0.94};
    p.neck = {0.02, 0, 1.47};
    p.head = {0.05, 0, 1.64};
    for (int i : {0, 1}) {
        const double side = i ? -1 : 1, swing = step * (i ? -1 : 1);
        p.knees[i] = {swing * 0.6 + 0.04, side * 0.1, 0.5};
        p.feet[i] = {swing, side * 0.11, 0.07 + (swing < -0.1 ? 0.05 : 0)};
        p.shoulders[i] = {0, side * 0.19, 1.41};
        p.elbows[i] = {-swing * 0.45, side * 0.27, 1.13};
        p.hands[i] = {-swing * 0.9 + bend, side * 0.26, 0.88 + bend};
    }
    return p;
}

Posture riding_posture(bool motorcycle)
{
    Posture p;
    const double seat = motorcycle ? 0.82 : 0.95, lean = motorcycle ? 0.2 : 0.26;
    p.hip = {-0.22, 0, seat};
    p.neck = {-0.22 + lean, 0, seat + 0.5};
    p.head = {-0.16 + lean, 0, seat + 0.68};
    for (int i : {0, 1}) {
        const double side = i ? -1 : 1;
        p.knees[i] =
            motorcycle ? Vector3{0.22, side * 0.2, seat - 0.08} : Vector3{0.16, side * 0.11, seat - (i ? 0.12 : 0.3)};
        p.feet[i] =
            motorcycle ? Vector3{0.05, side * 0.22, 0.36} : Vector3{i ? 0.14 : -0.06, side * 0.11, i ? 0.44 : 0.2};
        p.shoulders[i] = {p.neck.x, side * 0.19, p.neck.z - 0.05};
        p.elbows[i] = {p.neck.x + 0.22, side * 0.27, p.neck.z - 0.25};
        p.hands[i] = {0.42, side * 0.27, motorcycle ? 1.02 : 1.06};
    }
    return p;
}

std::vector<Vector3> oval(const Frame& f, const Vector3& c, double x, double y)
{
    std::vector<Vector3> ring;
    for (int i = 0; i < 10; ++i) {
        const double t = 2 * 3.14159265358979 * i / 10;
        ring.push_back(f.at(c.x + x * std::cos(t), c.y + y * std::sin(t), c.z));
    }
    return ring;
}

void add_body(MeshBuilder& m, const Frame& f, const Posture& p, const Clothes& c, bool helmet)
{
    const auto at = [&](const Vector3& v) { return f.at(v); };
    const Vector3 up = p.neck - p.hip;
    m.loft(c.top, {oval(f, p.hip - up * 0.18, 0.1, 0.15), oval(f, p.hip, 0.125, 0.175),
                   oval(f, p.hip + up * 0.4, 0.11, 0.16), oval(f, p.hip + up * 0.8, 0.125, 0.2),
                   oval(f, p.hip + up * 0.95, 0.09, 0.15), oval(f, p.neck + up * 0.02, 0.055, 0.06)});
    m.disc(c.legs, at(p.hip - up * 0.18), f.z * -1, 0.12, 8);
    m.tube(c.skin, at(p.neck - up * 0.03), 0.055, at(p.head), 0.05, 7, 0);
    Frame head = f.moved(p.head.x, p.head.y, p.head.z);
    m.blob(c.skin, head, {0.1, 0.08, 0.125}, 7, 9);
    m.blob(helmet ? c.shoes : c.hair, head.moved(-0.022, 0, 0.035),
           {0.102 + 0.02 * helmet, 0.09 + 0.02 * helmet, 0.108}, 6, 9);
    for (int i : {0, 1}) {
        const double side = i ? -1 : 1;
        const Vector3 hip = p.hip + Vector3{0, side * 0.09, -0.05};
        m.tube(c.legs, at(hip), 0.095, at(p.knees[i]), 0.068, 8, 0);
        m.tube(c.legs, at(p.knees[i]), 0.07, at(p.feet[i]), 0.05, 8, 2);
        m.blob(c.shoes, f.moved(p.feet[i].x + 0.06, p.feet[i].y, p.feet[i].z - 0.02), {0.14, 0.05, 0.05}, 4, 8);
        m.tube(c.top, at(p.shoulders[i]), 0.062, at(p.elbows[i]), 0.048, 7, 1);
        m.tube(c.top, at(p.elbows[i]), 0.05, at(p.hands[i]), 0.036, 7, 0);
        m.blob(c.skin, f.moved(p.hands[i].x, p.hands[i].y, p.hands[i].z - 0.03), {0.035, 0.03, 0.06}, 4, 6);
    }
}

} // namespace

void add_person(MeshBuilder& m, const Frame& foot, KeyedRandom& r)
{
    const ObjectNote note(m, label::kPerson, foot);
    const double size = r.uniform(0.92, 1.05);
    const Frame f{foot.origin, foot.x * size, foot.y * size, foot.z * size};
    const Clothes c(m, label::kPerson, r);
    add_body(m, f, standing_posture(r), c, false);
    if (r.chance(0.35)) // a bag
        m.box(c.shoes, f, {-0.24, -0.15, 1.0}, {-0.11, 0.15, 1.4}, MeshBuilder::kAllSides);
}

void add_rider(MeshBuilder& m, const Frame& middle, bool motorcycle, KeyedRandom& r)
{
    const ObjectNote note(m, label::kRider, middle);
    add_body(m, middle, riding_posture(motorcycle), Clothes(m, label::kRider, r), motorcycle || r.chance(0.5));
}

void add_bicycle(MeshBuilder& m, const Frame& f, KeyedRandom& r)
{
    constexpr Color paints[] = {
        {0.15, 0.15, 0.16}, {0.45, 0.12, 0.1}, {0.16, 0.26, 0.4}, {0.7, 0.7, 0.68}, {0.2, 0.33, 0.25}};
    const uint8_t l = label::kBicycle;
    const ObjectNote note(m, l, f);
    const Finish tyre = m.finish(Pattern::rubber, l), paint = m.finish(Pattern::car_paint, l, r.pick(paints));
    const Finish metal = m.finish(Pattern::metal, l, {0.62, 0.62, 0.62});
    const Vector3 rear{-0.52, 0, 0.34}, front{0.53, 0, 0.34}, crank{-0.08, 0, 0.29}, seat{-0.22, 0, 0.88},
        stem{0.38, 0, 0.92};
    for (const Vector3& hub : {rear, front}) {
        m.torus(tyre, f.at(hub), f.y, 0.325, 0.02, 18, 5);
        for (int i = 0; i < 7; ++i) {
            const double t = 6.2831853 * i / 7;
            m.tube(metal, f.at(hub), 0.006, f.at(hub.x + 0.32 * std::cos(t), 0, hub.z + 0.32 * std::sin(t)), 0.006, 3,
                   0);
        }
    }
    const auto bar = [&](const Vector3& a, const Vector3& b, double thick) {
        m.tube(paint, f.at(a), thick, f.at(b), thick, 6, 3);
    };
    bar(crank, seat, 0.018);
    bar(crank, {0.37, 0, 0.78}, 0.02);
    bar({-0.2, 0, 0.8}, {0.37, 0, 0.84}, 0.018);
    bar(crank, rear, 0.014);
    bar({-0.2, 0, 0.8}, rear, 0.012);
    bar(stem, front, 0.018);
    bar({0.4, -0.28, 1.0}, {0.4, 0.28, 1.0}, 0.014);
    bar(stem, {0.4, 0, 1.0}, 0.014);
    m.blob(tyre, f.moved(-0.24, 0, 0.92), {0.14, 0.075, 0.04}, 4, 8);
    m.tube(metal, f.at(-0.08, -0.12, 0.29), 0.02, f.at(-0.08, 0.12, 0.29), 0.02, 6, 3);
}

void add_motorcycle(MeshBuilder& m, const Frame& f, KeyedRandom& r)
{
    constexpr Color paints[] = {
        {0.5, 0.1, 0.08}, {0.12, 0.12, 0.13}, {0.16, 0.25, 0.42}, {0.78, 0.77, 0.74}, {0.2, 0.3, 0.2}};
    const uint8_t l = label::kMotorcycle;
    const ObjectNote note(m, l, f);
    const Finish tyre = m.finish(Pattern::rubber, l), paint = m.finish(Pattern::car_paint, l, r.pick(paints));
    const Finish metal = m.finish(Pattern::metal, l, {0.5, 0.5, 0.5}), rim = m.finish(Pattern::rim, l);
    for (double x : {-0.68, 0.7}) {
        m.torus(tyre, f.at(x, 0, 0.31), f.y, 0.25, 0.065, 18, 7);
        for (double side : {1.0, -1.0})
            m.disc(rim, f.at(x, side * 0.02, 0.31), f.y * side, 0.2, 12, true);
        m.blob(paint, f.moved(x, 0, 0.5), {0.28, 0.08, 0.14}, 5, 8);
    }
    m.blob(metal, f.moved(0, 0, 0.42), {0.32, 0.16, 0.2}, 5, 8);     // engine
    m.blob(paint, f.moved(0.16, 0, 0.78), {0.32, 0.16, 0.15}, 6, 9); // tank
    m.blob(tyre, f.moved(-0.36, 0, 0.77), {0.4, 0.14, 0.07}, 5, 9);  // seat
    m.blob(paint, f.moved(-0.66, 0, 0.74), {0.22, 0.12, 0.1}, 5, 8);
    for (double side : {1.0, -1.0}) {
        m.tube(metal, f.at(0.45, side * 0.09, 0.92), 0.025, f.at(0.7, side * 0.09, 0.31), 0.025, 6, 0);
        m.tube(tyre, f.at(0.4, side * 0.08, 1.0), 0.018, f.at(0.32, side * 0.36, 1.04), 0.02, 6, 2);
        m.tube(metal, f.at(-0.1, side * 0.19, 0.32), 0.045, f.at(-0.85, side * 0.19, 0.4), 0.055, 8, 3);
    }
    m.blob(metal, f.moved(0.5, 0, 0.92), {0.1, 0.085, 0.085}, 5, 8);
    m.disc(m.finish(Pattern::headlight, l), f.at(0.605, 0, 0.92), f.x, 0.06, 12, true);
    m.picture(m.finish(Pattern::taillight, l), f.at(-0.885, 0.08, 0.7), f.at(-0.885, -0.08, 0.7),
              f.at(-0.885, -0.08, 0.78), f.at(-0.885, 0.08, 0.78));
}

} // namespace semrover
