// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/streets/facade.h"

#include "tools/streets/class_label.h"

#include <algorithm>
#include <numbers>

namespace semrover {

namespace {

constexpr Color kTiles[] = {{0.56, 0.3, 0.22}, {0.5, 0.27, 0.2}, {0.42, 0.26, 0.2}, {0.6, 0.38, 0.28}};
constexpr Color kSlate[] = {{0.33, 0.35, 0.38}, {0.28, 0.29, 0.31}, {0.4, 0.4, 0.41}};

class Roof {
  public:
    Roof(MeshBuilder& mesh, const FacadeStyle& style, const BuildingPlot& plot, KeyedRandom& random)
        : m_(mesh), s_(style), p_(plot), r_(random), top_(style.height())
    {
        cover_ = r_.chance(0.55) ? m_.finish(Pattern::roof_tiles, label::kBuilding, r_.pick(kTiles))
                                 : m_.finish(Pattern::slate, label::kBuilding, r_.pick(kSlate));
        gravel_ = m_.finish(Pattern::gravel, label::kBuilding, {0.62, 0.61, 0.58});
        gutter_ = m_.finish(Pattern::metal, label::kBuilding, {0.45, 0.47, 0.48});
    }

    void add()
    {
        const double kind = r_.uniform();
        if (s_.curtain_wall || s_.storeys > 5 || kind < 0.25)
            flat();
        else if (kind < 0.68)
            gable();
        else
            mansard();
    }

  private:
    Vector3 at(double x, double y, double z) const { return p_.frame.at(x, y, z); }

    void flat()
    {
        const double high = r_.uniform(0.4, 1.0), t = 0.25, w = p_.width, d = p_.depth;
        const uint32_t around = MeshBuilder::kStanding;
        m_.box(s_.wall, p_.frame, {0, 0, top_}, {w, t, top_ + high}, around);
        m_.box(s_.wall, p_.frame, {0, d - t, top_}, {w, d, top_ + high}, around);
        m_.box(s_.wall, p_.frame, {0, t, top_}, {t, d - t, top_ + high}, around);
        m_.box(s_.wall, p_.frame, {w - t, t, top_}, {w, d - t, top_ + high}, around);
        m_.quad(gravel_, at(t, t, top_ + 0.1), at(w - t, t, top_ + 0.1), at(w - t, d - t, top_ + 0.1),
                at(t, d - t, top_ + 0.1));
        m_.box(gutter_, p_.frame, {w * 0.3, d * 0.4, top_ + 0.1}, {w * 0.3 + 2.2, d * 0.4 + 1.8, top_ + 1.9});
        m_.box(gutter_, p_.frame, {w * 0.68, d * 0.3, top_ + 0.1}, {w * 0.68 + 1.1, d * 0.3 + 0.9, top_ + 0.9});
    }

    // ridge along the street
    void gable()
    {
        const double out = 0.45, w = p_.width, d = p_.depth, rise = r_.uniform(0.5, 0.85), ridge = top_ + d / 2 * rise;
        const double low = top_ - out * rise, thick = 0.14;
        for (bool front : {true, false}) {
            const double e = front ? -out : d + out, y = d / 2;
            const Vector3 a = at(front ? 0 : w, e, low + thick), b = at(front ? w : 0, e, low + thick);
            const Vector3 c = at(front ? w : 0, y, ridge + thick), q = at(front ? 0 : w, y, ridge + thick);
            m_.quad(cover_, a, b, c, q);
            m_.quad(s_.trim, at(front ? 0 : w, e, low), at(front ? w : 0, e, low), b, a); // edge of the eaves
            m_.quad(s_.trim, at(front ? 0 : w, front ? 0 : d, top_), at(front ? w : 0, front ? 0 : d, top_),
                    at(front ? w : 0, e, low), at(front ? 0 : w, e, low)); // from below
        }
        m_.tube(gutter_, at(0, -out - 0.06, low + 0.04), 0.07, at(w, -out - 0.06, low + 0.04), 0.07, 6, 3);
        for (bool left : {true, false}) {
            const double x = left ? 0 : w;
            const Vector3 a = at(x, left ? d : 0, top_), b = at(x, left ? 0 : d, top_), c = at(x, d / 2, ridge);
            m_.triangle(s_.wall, a, b, c);
            for (bool front : {true, false}) { // the cover's edge
                const double e = front ? -out : d + out;
                const Vector3 p = at(x, e, low), q = at(x, d / 2, ridge), up = p_.frame.z * thick;
                front == left ? m_.quad(s_.trim, q, p, p + up, q + up) : m_.quad(s_.trim, p, q, q + up, p + up);
            }
        }
        chimney(ridge);
        if (d > 9 && p_.width > 6)
            for (double x : {p_.width * 0.3, p_.width * 0.7})
                skylight(x, rise, thick);
    }

    void skylight(double x, double rise, double thick)
    {
        const auto on = [&](double dx, double y) { return at(x + dx, y, top_ + y * rise + thick + 0.03); };
        m_.quad(s_.metal, on(-0.45, 1.5), on(0.45, 1.5), on(0.45, 2.6), on(-0.45, 2.6));
        const auto pane = [&](double dx, double y) { return at(x + dx, y, top_ + y * rise + thick + 0.05); };
        m_.quad(s_.panes[0], pane(-0.37, 1.58), pane(0.37, 1.58), pane(0.37, 2.52), pane(-0.37, 2.52));
    }

    // a steep slope with dormers, then flat
    void mansard()
    {
        const double high = r_.uniform(2.3, 2.9), in = 0.9, w = p_.width, d = p_.depth, z = top_ + high;
        m_.quad(cover_, at(0, 0, top_), at(w, 0, top_), at(w, in, z), at(0, in, z));
        m_.quad(cover_, at(w, d, top_), at(0, d, top_), at(0, d - in, z), at(w, d - in, z));
        m_.quad(gravel_, at(0, in, z), at(w, in, z), at(w, d - in, z), at(0, d - in, z));
        m_.quad(s_.wall, at(w, 0, top_), at(w, d, top_), at(w, d - in, z), at(w, in, z));
        m_.quad(s_.wall, at(0, d, top_), at(0, 0, top_), at(0, in, z), at(0, d - in, z));
        m_.tube(gutter_, at(0, -0.32, top_ - 0.02), 0.07, at(w, -0.32, top_ - 0.02), 0.07, 6, 3);
        const int count = std::max(1, int(std::lround(w / s_.bay / 1.4)));
        for (int i = 0; i < count; ++i)
            dormer((i + 0.5) * w / count, high);
        chimney(z);
    }

    void dormer(double x, double high)
    {
        const double half = 0.65, z0 = top_ + 0.45, z1 = top_ + high - 0.15, y = 0.12;
        const uint32_t sides = MeshBuilder::kFront | MeshBuilder::kBack | MeshBuilder::kTop;
        m_.box(gutter_, p_.frame, {x - half, y, z0}, {x + half, 0.95, z1}, sides);
        const auto face = [&](Finish f, double x0, double a, double x1, double b, double depth) {
            m_.picture(f, at(x0, depth, a), at(x1, depth, a), at(x1, depth, b), at(x0, depth, b));
        };
        face(s_.frame, x - half, z0, x + half, z1, y);
        face(s_.panes[r_.below(uint32_t(s_.panes.size()))], x - half + 0.12, z0 + 0.12, x + half - 0.12, z1 - 0.14,
             y - 0.01);
        face(s_.frame, x - 0.03, z0 + 0.12, x + 0.03, z1 - 0.14, y - 0.015);
        m_.box(gutter_, p_.frame, {x - half - 0.1, y - 0.15, z1}, {x + half + 0.1, 1.0, z1 + 0.1},
               MeshBuilder::kAllSides);
    }

    void chimney(double z)
    {
        const Finish stone = m_.finish(Pattern::brick, label::kBuilding, {0.55, 0.36, 0.3});
        const double x = p_.width * (r_.chance(0.5) ? 0.15 : 0.78), y = p_.depth * 0.55;
        m_.box(stone, p_.frame, {x, y, z - 1.8}, {x + 0.9, y + 0.6, z + 0.9});
        for (double dx : {0.22, 0.62})
            m_.tube(m_.finish(Pattern::trim, label::kBuilding, {0.6, 0.36, 0.26}), at(x + dx, y + 0.3, z + 0.9), 0.11,
                    at(x + dx, y + 0.3, z + 1.3), 0.1, 8, 2);
    }

    MeshBuilder& m_;
    const FacadeStyle& s_;
    const BuildingPlot& p_;
    KeyedRandom& r_;
    double top_;
    Finish cover_, gravel_, gutter_;
};

// the plot's box from the ground up to what stands highest of the faces from number `first` on
void note_building(MeshBuilder& m, const BuildingPlot& p, size_t first)
{
    const size_t count = m.objects().size();
    m.note_object(label::kBuilding, p.frame.turned(-std::numbers::pi / 2), first); // its front looks against y
    SR_ASSERT(m.objects().size() == count + 1, "a building without faces");
    SceneObject& o = m.objects().back();
    const Vector3 middle = p.frame.at(p.width / 2, p.depth / 2, 0);
    const double top = o.center[2] + o.size[2] / 2;
    o.center = {middle.x, middle.y, (middle.z + top) / 2};
    o.size = {p.depth, p.width, top - middle.z};
}

} // namespace

void add_building(MeshBuilder& m, const FacadeStyle& s, const BuildingPlot& p, uint64_t seed, uint64_t key)
{
    KeyedRandom r(seed, {10, key});
    const size_t first = m.faces();
    const Frame& f = p.frame;
    const double w = p.width, d = p.depth, top = s.height();
    add_facade(m, s, f, w, true, r);
    m.box(s.base, f, {0, -0.05, -p.below}, {w, 0, 0.35}, MeshBuilder::kRight | MeshBuilder::kTop | 3); // plinth
    const auto side = [&](const Frame& wall, double width, bool open, double hidden) {
        const double z = std::clamp(hidden, 0.0, top);
        if (open)
            add_facade(m, s, wall, width, false, r);
        else
            m.quad(s.wall, wall.at(0, 0, z), wall.at(width, 0, z), wall.at(width, 0, top), wall.at(0, 0, top));
        if (z == 0)
            m.quad(s.base, wall.at(0, 0, -p.below), wall.at(width, 0, -p.below), wall.at(width, 0, 0),
                   wall.at(0, 0, 0));
    };
    side({f.at(w, 0, 0), f.y, f.x * -1, f.z}, d, p.open_right, p.hidden_right);
    side({f.at(0, d, 0), f.y * -1, f.x, f.z}, d, p.open_left, p.hidden_left);
    side({f.at(w, d, 0), f.x * -1, f.y * -1, f.z}, w, false, 0);
    const Finish pipe = m.finish(Pattern::metal, label::kBuilding, {0.5, 0.51, 0.5});
    m.tube(pipe, f.at(0.12, -0.1, 0), 0.05, f.at(0.12, -0.1, top - 0.4), 0.05, 6, 0);
    Roof(m, s, p, r).add();
    note_building(m, p, first);
}

} // namespace semrover
