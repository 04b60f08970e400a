// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/streets/mesh_builder.h"

#include "engine/scene/srgb.h"

#include <algorithm>
#include <numbers>

namespace semrover {

namespace {

constexpr double kSmallestArea = 1e-9; // square metres

// two directions across an axis, so that (a, b, axis) is right-handed
std::pair<Vector3, Vector3> across(const Vector3& axis)
{
    const Vector3 z = normalized(axis);
    const Vector3 some = std::abs(z.z) < 0.9 ? Vector3{0, 0, 1} : Vector3{1, 0, 0};
    const Vector3 a = normalized(cross(some, z));
    return {a, cross(z, a)};
}

std::vector<Vector3> circle(const Vector3& center, const Vector3& a, const Vector3& b, double radius, int corners)
{
    std::vector<Vector3> points;
    for (int i = 0; i < corners; ++i) {
        const double t = 2 * std::numbers::pi * i / corners;
        points.push_back(center + a * (radius * std::cos(t)) + b * (radius * std::sin(t)));
    }
    return points;
}

} // namespace

uint32_t MeshBuilder::texture_of(Pattern pattern)
{
    const auto [it, fresh] = textures_.try_emplace(pattern, uint32_t(mesh_.textures.size()));
    if (fresh)
        mesh_.textures.push_back({.image = paint_pattern(pattern)});
    return it->second;
}

Finish MeshBuilder::finish(Pattern pattern, uint8_t label, const Color& tint)
{
    std::array<int, 3> key;
    for (size_t c = 0; c < 3; ++c)
        key[c] = int(std::lround(std::clamp(tint[c], 0.0, 1.0) * 63)); // few different materials
    const auto [it, fresh] = materials_.try_emplace({pattern, key}, uint32_t(mesh_.materials.size()));
    if (fresh) {
        Material m{.name = std::string(pattern_info(pattern).name)};
        for (size_t c = 0; c < 3; ++c)
            m.color[c] = float(linear_of_srgb(key[c] / 63.0));
        m.texture = int32_t(texture_of(pattern));
        mesh_.materials.push_back(std::move(m));
        gloss_.push_back(pattern_info(pattern).gloss);
        size_.push_back(pattern_info(pattern).metres);
    }
    return {it->second, label};
}

uint32_t MeshBuilder::vertex(const Vector3& p)
{
    mesh_.positions.push_back({float(p.x), float(p.y), float(p.z)});
    return uint32_t(mesh_.positions.size() - 1);
}

void MeshBuilder::face(Finish f, std::array<uint32_t, 3> corners, const std::array<std::array<double, 2>, 3>& uv)
{
    const auto at = [&](uint32_t i) {
        const auto& p = mesh_.positions[i];
        return Vector3{p[0], p[1], p[2]};
    };
    const Vector3 a = at(corners[0]);
    if (length(cross(at(corners[1]) - a, at(corners[2]) - a)) < 2 * kSmallestArea)
        return;
    mesh_.faces.push_back(corners);
    mesh_.face_materials.push_back(f.material);
    mesh_.face_labels.push_back(f.label);
    auto& out = mesh_.uvs.emplace_back();
    for (size_t i = 0; i < 3; ++i)
        out[i] = {float(uv[i][0]), float(1 - uv[i][1])};
}

void MeshBuilder::picture(Finish f, const Vector3& a, const Vector3& b, const Vector3& c, const Vector3& d,
                          const Span& s)
{
    const uint32_t i = vertex(a);
    vertex(b);
    vertex(c);
    vertex(d);
    face(f, {i, i + 1, i + 2}, {{{s.u0, s.v0}, {s.u1, s.v0}, {s.u1, s.v1}}});
    face(f, {i, i + 2, i + 3}, {{{s.u0, s.v0}, {s.u1, s.v1}, {s.u0, s.v1}}});
}

void MeshBuilder::quad(Finish f, const Vector3& a, const Vector3& b, const Vector3& c, const Vector3& d, double u,
                       double v)
{
    const double size = size_[f.material];
    const double wide = std::max(length(b - a), length(c - d)), high = std::max(length(d - a), length(c - b));
    picture(f, a, b, c, d, {u / size, v / size, (u + wide) / size, (v + high) / size});
}

void MeshBuilder::pictured(Finish f, const std::array<Vector3, 3>& p, const std::array<std::array<double, 2>, 3>& uv)
{
    const uint32_t i = vertex(p[0]);
    vertex(p[1]);
    vertex(p[2]);
    face(f, {i, i + 1, i + 2}, uv);
}

void MeshBuilder::triangle(Finish f, const Vector3& a, const Vector3& b, const Vector3& c)
{
    const double size = size_[f.material], along = length(b - a);
    const Vector3 x = normalized(b - a), y = normalized(cross(cross(b - a, c - a), b - a));
    const uint32_t i = vertex(a);
    vertex(b);
    vertex(c);
    face(f, {i, i + 1, i + 2}, {{{0, 0}, {along / size, 0}, {dot(c - a, x) / size, dot(c - a, y) / size}}});
}

void MeshBuilder::polygon(Finish f, const std::vector<Vector3>& corners)
{
    const double size = size_[f.material];
    const auto uv = [&](const Vector3& p) { return std::array{p.x / size, p.y / size}; };
    const uint32_t first = uint32_t(mesh_.positions.size());
    for (const Vector3& p : corners)
        vertex(p);
    for (uint32_t i = 1; i + 1 < corners.size(); ++i)
        face(f, {first, first + i, first + i + 1}, {uv(corners[0]), uv(corners[i]), uv(corners[i + 1])});
}

void MeshBuilder::box(Finish f, const Frame& m, const Vector3& l, const Vector3& h, uint32_t sides)
{
    const auto p = [&](double x, double y, double z) { return m.at(x, y, z); };
    if (sides & kFront)
        quad(f, p(h.x, l.y, l.z), p(h.x, h.y, l.z), p(h.x, h.y, h.z), p(h.x, l.y, h.z));
    if (sides & kBack)
        quad(f, p(l.x, h.y, l.z), p(l.x, l.y, l.z), p(l.x, l.y, h.z), p(l.x, h.y, h.z));
    if (sides & kLeft)
        quad(f, p(h.x, h.y, l.z), p(l.x, h.y, l.z), p(l.x, h.y, h.z), p(h.x, h.y, h.z));
    if (sides & kRight)
        quad(f, p(l.x, l.y, l.z), p(h.x, l.y, l.z), p(h.x, l.y, h.z), p(l.x, l.y, h.z));
    if (sides & kTop)
        quad(f, p(l.x, l.y, h.z), p(h.x, l.y, h.z), p(h.x, h.y, h.z), p(l.x, h.y, h.z));
    if (sides & kBottom)
        quad(f, p(l.x, h.y, l.z), p(h.x, h.y, l.z), p(h.x, l.y, l.z), p(l.x, l.y, l.z));
}

void MeshBuilder::loft(Finish f, const std::vector<std::vector<Vector3>>& rings, bool closed)
{
    const size_t n = rings[0].size(), spans = closed ? n : n - 1;
    const double size = size_[f.material];
    const uint32_t first = uint32_t(mesh_.positions.size());
    for (const auto& ring : rings)
        for (const Vector3& p : ring)
            vertex(p);
    std::vector<double> along(n + 1, 0); // of the middle ring, for all rings alike
    for (size_t i = 0; i < n; ++i)
        along[i + 1] = along[i] + length(rings[rings.size() / 2][(i + 1) % n] - rings[rings.size() / 2][i]);
    double v = 0;
    for (size_t r = 0; r + 1 < rings.size(); ++r) {
        const double next = v + length(rings[r + 1][0] - rings[r][0]);
        for (size_t i = 0; i < spans; ++i) {
            const uint32_t a = uint32_t(first + r * n + i), b = uint32_t(first + r * n + (i + 1) % n);
            const uint32_t c = uint32_t(b + n), d = uint32_t(a + n);
            const double u0 = along[i] / size, u1 = along[i + 1] / size, v0 = v / size, v1 = next / size;
            face(f, {a, b, c}, {{{u0, v0}, {u1, v0}, {u1, v1}}});
            face(f, {a, c, d}, {{{u0, v0}, {u1, v1}, {u0, v1}}});
        }
        v = next;
    }
}

void MeshBuilder::tube(Finish f, const Vector3& a, double radius_a, const Vector3& b, double radius_b, int corners,
                       int caps)
{
    const auto [x, y] = across(b - a);
    loft(f, {circle(a, x, y, radius_a, corners), circle(b, x, y, radius_b, corners)});
    if (caps & 1)
        disc(f, a, a - b, radius_a, corners);
    if (caps & 2)
        disc(f, b, b - a, radius_b, corners);
}

void MeshBuilder::disc(Finish f, const Vector3& center, const Vector3& normal, double radius, int corners, bool picture)
{
    auto [x, y] = across(normal);
    const double size = picture ? 2 * radius : size_[f.material];
    const auto uv = [&](double t) {
        return std::array{(radius * std::cos(t)) / size + 0.5, (radius * std::sin(t)) / size + 0.5};
    };
    const uint32_t first = uint32_t(mesh_.positions.size());
    for (const Vector3& p : circle(center, x, y, radius, corners))
        vertex(p);
    for (int i = 1; i + 1 < corners; ++i) {
        const double step = 2 * std::numbers::pi / corners;
        face(f, {first, first + uint32_t(i), first + uint32_t(i) + 1}, {uv(0), uv(step * i), uv(step * (i + 1))});
    }
}

void MeshBuilder::blob(Finish f, const Frame& m, const Vector3& r, int rings, int corners)
{
    std::vector<std::vector<Vector3>> points;
    for (int i = 0; i <= rings; ++i) {
        const double t = std::numbers::pi * i / rings - std::numbers::pi / 2, wide = std::max(std::cos(t), 1e-3);
        auto& ring = points.emplace_back();
        for (int k = 0; k < corners; ++k) {
            const double a = 2 * std::numbers::pi * k / corners;
            ring.push_back(m.at(r.x * wide * std::cos(a), r.y * wide * std::sin(a), r.z * std::sin(t)));
        }
    }
    loft(f, points);
}

void MeshBuilder::torus(Finish f, const Vector3& center, const Vector3& axis, double radius, double thickness,
                        int corners, int section)
{
    const auto [x, y] = across(axis);
    const Vector3 z = normalized(axis);
    std::vector<std::vector<Vector3>> rings;
    for (int i = 0; i <= corners; ++i) {
        const double t = 2 * std::numbers::pi * i / corners;
        const Vector3 out = x * std::cos(t) + y * std::sin(t);
        rings.push_back(circle(center + out * radius, out * -1, z, thickness, section));
    }
    loft(f, rings);
}

void MeshBuilder::note_object(uint8_t label, const Frame& frame, size_t first)
{
    const Frame upright = upright_frame({}, std::atan2(frame.x.y, frame.x.x));
    std::array<double, 3> low{}, high{};
    bool any = false;
    owners_.resize(mesh_.faces.size());
    for (size_t f = first; f < mesh_.faces.size(); ++f) {
        if (mesh_.face_labels[f] != label)
            continue;
        if (owners_[f] == 0)
            owners_[f] = uint32_t(objects_.size()) + 1;
        for (uint32_t v : mesh_.faces[f]) {
            const Vector3 at{mesh_.positions[v][0], mesh_.positions[v][1], mesh_.positions[v][2]};
            const std::array<double, 3> p = {dot(at, upright.x), dot(at, upright.y), at.z};
            for (size_t a = 0; a < 3; ++a) {
                low[a] = any ? std::min(low[a], p[a]) : p[a];
                high[a] = any ? std::max(high[a], p[a]) : p[a];
            }
            any = true;
        }
    }
    if (!any)
        return;
    const Vector3 middle = upright.at((low[0] + high[0]) / 2, (low[1] + high[1]) / 2, (low[2] + high[2]) / 2);
    SceneObject o{.id = uint32_t(objects_.size()), .label = label, .center = {middle.x, middle.y, middle.z}};
    for (size_t a = 0; a < 3; ++a)
        o.size[a] = std::max(high[a] - low[a], 0.01);
    o.heading = std::atan2(upright.x.y, upright.x.x);
    objects_.push_back(o);
}

std::vector<uint32_t> MeshBuilder::owners() const
{
    std::vector<uint32_t> all = owners_;
    all.resize(mesh_.faces.size());
    return all;
}

Mesh MeshBuilder::take() &&
{
    return std::move(mesh_);
}

} // namespace semrover
