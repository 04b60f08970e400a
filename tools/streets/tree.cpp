// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/streets/street_objects.h"

#include "tools/streets/class_label.h"

#include <algorithm>
#include <numbers>

namespace semrover {

namespace {

constexpr Color kGreens[] = {{0.34, 0.43, 0.17}, {0.28, 0.39, 0.16}, {0.4, 0.46, 0.19},
                             {0.3, 0.4, 0.2},    {0.44, 0.46, 0.18}, {0.25, 0.35, 0.17}};
constexpr Color kBarks[] = {{0.5, 0.44, 0.37}, {0.4, 0.34, 0.28}, {0.6, 0.57, 0.5}};

Vector3 direction(KeyedRandom& r)
{
    const double z = r.uniform(-1, 1), t = r.uniform(0, 2 * std::numbers::pi), w = std::sqrt(1 - z * z);
    return {w * std::cos(t), w * std::sin(t), z};
}

// three finishes of like colour, so that leaves differ
struct Greens {
    Finish dark, plain, light;

    Greens(MeshBuilder& m, const Color& c)
    {
        const auto shade = [&](double f) {
            return m.finish(Pattern::leaves, label::kVegetation, {c[0] * f, c[1] * f, c[2] * f});
        };
        dark = shade(1.02);
        plain = shade(1.3);
        light = shade(1.5);
    }
};

// a spray of leaves: a triangle of random shape, from anywhere in the picture
void add_spray(MeshBuilder& m, Finish f, const Vector3& at, const Vector3& out, double size, KeyedRandom& r)
{
    const Vector3 normal = normalized(out + direction(r) * 0.9);
    const Vector3 x = normalized(cross(normal, direction(r))), y = cross(normal, x);
    const double a = size * r.uniform(0.7, 1.25), b = size * r.uniform(0.45, 0.8), bend = size * 0.25;
    const double u = r.uniform(), v = r.uniform(), wide = a * 1.6;
    m.pictured(
        f, {at - x * a - normal * bend, at + y * b * 1.3 + x * (a * r.uniform(-0.3, 0.3)), at + x * a - y * (b * 0.4)},
        {{{u, v}, {u + wide / 2, v + wide}, {u + wide, v}}});
}

// leaves over a ball
void add_cluster(MeshBuilder& m, const Greens& g, const Vector3& center, double radius, int leaves, double size,
                 KeyedRandom& r)
{
    for (int i = 0; i < leaves; ++i) {
        const Vector3 d = direction(r);
        const Vector3 at = center + d * (radius * (0.55 + 0.45 * std::sqrt(r.uniform())));
        const double tone = d.z * 0.5 + r.uniform(-0.6, 0.6);
        add_spray(m, tone < -0.3 ? g.dark : tone < 0.4 ? g.plain : g.light, at, d, size, r);
    }
}

struct Shape {
    double height, trunk, radius; // of the tree, of the stem below the crown, of the crown
    double thickness;             // of the stem
    int clusters, leaves;         // leaves of a cluster
};

Shape shape_of(TreeKind kind, KeyedRandom& r)
{
    switch (kind) {
    case TreeKind::round:
        return {r.uniform(6.5, 9), r.uniform(2.3, 2.9), r.uniform(2.0, 2.8), 0.15, 22, 120};
    case TreeKind::tall:
        return {r.uniform(9, 13), r.uniform(2.2, 2.8), r.uniform(1.4, 1.9), 0.16, 24, 112};
    case TreeKind::spreading:
        return {r.uniform(8, 11), r.uniform(2.8, 3.6), r.uniform(3.0, 4.0), 0.24, 30, 130};
    default:
        return {r.uniform(4.2, 5.4), r.uniform(1.9, 2.3), r.uniform(0.9, 1.3), 0.06, 9, 110};
    }
}

} // namespace

void add_tree(MeshBuilder& m, const Frame& foot, TreeKind kind, KeyedRandom& r)
{
    const ObjectNote note(m, label::kVegetation, foot);
    const Shape s = shape_of(kind, r);
    const Greens greens(m, r.pick(kGreens));
    const Finish bark = m.finish(Pattern::bark, label::kVegetation, r.pick(kBarks));
    const Vector3 lean = foot.x * r.uniform(-0.25, 0.25) + foot.y * r.uniform(-0.25, 0.25);
    const Vector3 root = foot.at(0, 0, -0.05), fork = foot.at(0, 0, s.trunk) + lean * 0.4;
    m.tube(bark, root, s.thickness * 1.5, foot.at(0, 0, 0.35), s.thickness * 1.05, 9, 0);
    m.tube(bark, foot.at(0, 0, 0.35), s.thickness * 1.05, fork, s.thickness * 0.82, 9, 0);
    const double high = s.height - s.trunk, middle = s.trunk + high * 0.5;
    const Vector3 heart = foot.at(0, 0, middle) + lean;
    m.tube(bark, fork, s.thickness * 0.8, heart + foot.z * (high * 0.25), s.thickness * 0.25, 7, 0);
    for (int i = 0; i < s.clusters; ++i) {
        // spread evenly over an ellipsoid, more outside than inside
        const double z = 1 - 2 * (i + 0.5) / s.clusters, t = i * 2.399963 + r.uniform(-0.3, 0.3);
        const double wide = std::sqrt(std::max(0.0, 1 - z * z)), from = r.uniform(0.55, 0.86);
        const Vector3 d{wide * std::cos(t), wide * std::sin(t), z};
        const Vector3 at = heart + Vector3{d.x * s.radius, d.y * s.radius, d.z * high * 0.5} * from;
        const double radius = s.radius * r.uniform(0.34, 0.5);
        add_cluster(m, greens, at, radius, s.leaves, kind == TreeKind::young ? 0.14 : 0.2, r);
        if (i % 3 == 0)
            m.tube(bark, mix(fork, heart, r.uniform(0.0, 0.8)), s.thickness * 0.4, at, s.thickness * 0.12, 5, 0);
    }
}

void add_bush(MeshBuilder& m, const Frame& foot, const Vector3& radii, KeyedRandom& r)
{
    const ObjectNote note(m, label::kVegetation, foot);
    const Greens greens(m, r.pick(kGreens));
    const int leaves = int(240 * radii.x * radii.y + 90);
    for (int i = 0; i < leaves; ++i) {
        Vector3 d = direction(r);
        d.z = std::abs(d.z);
        const double deep = 0.75 + 0.3 * std::sqrt(r.uniform());
        const Vector3 at = foot.at(d.x * radii.x * deep, d.y * radii.y * deep, d.z * radii.z * deep + 0.05);
        const double tone = d.z - 0.4 + r.uniform(-0.5, 0.5);
        add_spray(m,
                  tone < -0.3  ? greens.dark
                  : tone < 0.4 ? greens.plain
                               : greens.light,
                  at, foot.x * d.x + foot.y * d.y + foot.z * d.z, 0.15, r);
    }
}

void add_hedge(MeshBuilder& m, const Frame& foot, double length, double width, double height, KeyedRandom& r)
{
    const Color& c = r.pick(kGreens);
    const Finish hedge = m.finish(Pattern::hedge, label::kVegetation, {c[0] * 0.95, c[1] * 0.95, c[2] * 0.95});
    const Greens greens(m, c);
    m.box(hedge, foot, {0, -width / 2, 0}, {length, width / 2, height});
    const int leaves = int(length * 26);
    for (int i = 0; i < leaves; ++i) { // loose twigs on top and in front
        const double x = r.uniform(0, length), y = r.uniform(-0.5, 0.5) * width;
        const bool top = r.chance(0.5);
        const Vector3 at =
            top ? foot.at(x, y, height) : foot.at(x, r.chance(0.5) ? width / 2 : -width / 2, r.uniform(0.1, height));
        add_spray(m, r.chance(0.5) ? greens.plain : greens.light, at, top ? foot.z : foot.y * (y < 0 ? -1.0 : 1.0),
                  0.11, r);
    }
}

} // namespace semrover
