// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/streets/facade.h"

#include "tools/streets/class_label.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

constexpr double kInside = 0.6, kOutside = 0.3; // metres from the wall's face, of an opening's box

// a rectangle of a wall: x to the right, z up
struct Field {
    double x0, z0, x1, z1;

    double width() const { return x1 - x0; }
    double height() const { return z1 - z0; }
};

class Facade {
  public:
    Facade(MeshBuilder& mesh, const FacadeStyle& style, const Frame& wall, double width, KeyedRandom& random)
        : m_(mesh), s_(style), w_(wall), width_(width), r_(random),
          bays_(std::max(1, int(std::lround(width / style.bay)))), bay_(width / bays_)
    {
    }

    void add(bool front)
    {
        ground_floor(front);
        for (int floor = 1; floor < s_.storeys; ++floor)
            s_.curtain_wall ? glass_storey(floor) : storey(floor);
        if (s_.curtain_wall)
            posts();
        ornaments();
    }

  private:
    Vector3 at(double x, double y, double z) const { return w_.at(x, y, z); }

    // y: depth behind the wall's face
    void panel(Finish f, const Field& a, double y = 0)
    {
        m_.quad(f, at(a.x0, y, a.z0), at(a.x1, y, a.z0), at(a.x1, y, a.z1), at(a.x0, y, a.z1), a.x0, a.z0);
    }
    void picture(Finish f, const Field& a, double y)
    {
        m_.picture(f, at(a.x0, y, a.z0), at(a.x1, y, a.z0), at(a.x1, y, a.z1), at(a.x0, y, a.z1));
    }
    // sticks out of the wall by `out`, in front of depth `y`
    void slab(Finish f, const Field& a, double out, double y = 0, bool below = true)
    {
        m_.box(f, w_, {a.x0, y - out, a.z0}, {a.x1, y, a.z1},
               MeshBuilder::kFront | MeshBuilder::kBack | MeshBuilder::kRight | MeshBuilder::kTop |
                   (below ? uint32_t(MeshBuilder::kBottom) : 0u));
    }
    // sides of an opening that reaches to depth y
    void reveal(Finish f, const Field& a, double y, bool sill = true)
    {
        m_.quad(f, at(a.x0, 0, a.z0), at(a.x0, y, a.z0), at(a.x0, y, a.z1), at(a.x0, 0, a.z1));
        m_.quad(f, at(a.x1, y, a.z0), at(a.x1, 0, a.z0), at(a.x1, 0, a.z1), at(a.x1, y, a.z1));
        m_.quad(f, at(a.x0, y, a.z1), at(a.x1, y, a.z1), at(a.x1, 0, a.z1), at(a.x0, 0, a.z1));
        if (sill)
            m_.quad(f, at(a.x0, 0, a.z0), at(a.x1, 0, a.z0), at(a.x1, y, a.z0), at(a.x0, y, a.z0));
    }
    // wall around an opening within a field
    void wall_around(Finish f, const Field& a, const Field& hole)
    {
        panel(f, {a.x0, a.z0, a.x1, hole.z0});
        panel(f, {a.x0, hole.z1, a.x1, a.z1});
        panel(f, {a.x0, hole.z0, hole.x0, hole.z1});
        panel(f, {hole.x1, hole.z0, a.x1, hole.z1});
    }

    void note_opening(const Field& a)
    {
        const Vector3 middle = at((a.x0 + a.x1) / 2, (kInside - kOutside) / 2, (a.z0 + a.z1) / 2);
        m_.objects().push_back({.id = uint32_t(m_.objects().size()),
                                .label = label::kBuilding,
                                .center = {middle.x, middle.y, middle.z},
                                .size = {kInside + kOutside, a.width(), a.height()},
                                .heading = std::atan2(-w_.y.y, -w_.y.x),
                                .part = true});
    }

    // frame and panes at a depth
    void glazing(const Field& a, double y, WindowKind kind, Finish pane)
    {
        const double b = 0.06, t = 0.025; // of the frame; of the bars half
        panel(s_.frame, {a.x0, a.z0, a.x0 + b, a.z1}, y);
        panel(s_.frame, {a.x1 - b, a.z0, a.x1, a.z1}, y);
        panel(s_.frame, {a.x0 + b, a.z0, a.x1 - b, a.z0 + b}, y);
        panel(s_.frame, {a.x0 + b, a.z1 - b, a.x1 - b, a.z1}, y);
        picture(pane, {a.x0 + 0.02, a.z0 + 0.02, a.x1 - 0.02, a.z1 - 0.02}, y + 0.03);
        const double x = (a.x0 + a.x1) / 2, z = a.z0 + a.height() * (kind == WindowKind::sash ? 0.5 : 0.68);
        if (kind != WindowKind::sash)
            panel(s_.frame, {x - t - 0.015, a.z0 + b, x + t + 0.015, a.z1 - b}, y - 0.004);
        if (kind == WindowKind::cross || kind == WindowKind::sash)
            panel(s_.frame, {a.x0 + b, z - t, a.x1 - b, z + t}, y - 0.002);
    }

    void window(const Field& a)
    {
        note_opening(a);
        reveal(s_.surrounds ? s_.trim : s_.wall, a, s_.recess + 0.03);
        glazing(a, s_.recess, s_.window, s_.panes[r_.below(uint32_t(s_.panes.size()))]);
        slab(s_.trim, {a.x0 - 0.07, a.z0 - 0.07, a.x1 + 0.07, a.z0}, 0.09);
        if (s_.surrounds) {
            slab(s_.trim, {a.x0 - 0.11, a.z0, a.x0, a.z1}, 0.035, 0, false);
            slab(s_.trim, {a.x1, a.z0, a.x1 + 0.11, a.z1}, 0.035, 0, false);
            slab(s_.trim, {a.x0 - 0.14, a.z1, a.x1 + 0.14, a.z1 + 0.17}, 0.06);
        }
        if (s_.shutters)
            for (double x : {a.x0 - a.width() / 2 - 0.14, a.x1 + 0.14})
                slab(s_.shutter, {x, a.z0, x + a.width() / 2, a.z1}, 0.045);
    }

    void balcony(double x0, double x1, double z)
    {
        const double out = 1.05, high = 1.02;
        slab(s_.trim, {x0, z - 0.16, x1, z}, out);
        const Finish rail = s_.metal;
        const auto bar = [&](const Vector3& low, const Vector3& top) {
            m_.box(rail, w_, low, top, MeshBuilder::kAllSides);
        };
        bar({x0 + 0.03, -out + 0.02, z + high - 0.04}, {x1 - 0.03, -out + 0.06, z + high});
        for (double x : {x0 + 0.03, x1 - 0.07})
            bar({x, -out + 0.06, z + high - 0.04}, {x + 0.04, 0, z + high});
        const int bars = std::max(2, int((x1 - x0) / 0.16));
        for (int i = 0; i <= bars; ++i) {
            const double x = x0 + 0.04 + (x1 - x0 - 0.08) * i / bars;
            m_.box(rail, w_, {x - 0.009, -out + 0.03, z}, {x + 0.009, -out + 0.05, z + high - 0.04}, 15);
        }
        for (double x : {x0 + 0.04, x1 - 0.06})
            for (double y = -out + 0.2; y < -0.05; y += 0.16)
                m_.box(rail, w_, {x, y, z}, {x + 0.018, y + 0.018, z + high - 0.04}, 15);
    }

    void storey(int floor)
    {
        const double z0 = s_.ground_height + s_.storey * (floor - 1), z1 = z0 + s_.storey;
        const bool with_balcony = s_.balconies;
        for (int b = 0; b < bays_; ++b) {
            const double middle = (b + 0.5) * bay_;
            const bool here = with_balcony && (bays_ < 3 ? b == 0 : b % 3 == 1);
            const double half = std::min(s_.window_width * (here ? 1.25 : 1), bay_ - 0.5) / 2;
            const double sill = here || s_.window == WindowKind::french ? z0 + 0.12 : z0 + 0.9;
            const double head = std::min(std::max(sill + s_.window_height, z0 + 2.3), z1 - 0.35);
            const Field hole{middle - half, sill, middle + half, head};
            wall_around(s_.wall, {b * bay_, z0, (b + 1) * bay_, z1}, hole);
            window(hole);
            if (here)
                balcony(std::max(middle - 1.3, 0.1), std::min(middle + 1.3, width_ - 0.1), z0 + 0.05);
            else if (s_.window == WindowKind::french)
                railing(hole);
        }
    }

    void railing(const Field& a)
    {
        m_.box(s_.metal, w_, {a.x0, -0.08, a.z0 + 0.95}, {a.x1, -0.045, a.z0 + 0.99}, MeshBuilder::kAllSides);
        for (double x = a.x0 + 0.04; x < a.x1; x += 0.13)
            m_.box(s_.metal, w_, {x, -0.07, a.z0 + 0.05}, {x + 0.016, -0.054, a.z0 + 0.95}, 15);
    }

    // offices: a parapet of wall, then glass from post to post
    void glass_storey(int floor)
    {
        const double z0 = s_.ground_height + s_.storey * (floor - 1), z1 = z0 + s_.storey, sill = z0 + 0.75;
        panel(s_.wall, {0, z0, width_, sill});
        panel(s_.wall, {0, z1 - 0.25, width_, z1});
        note_opening({0, sill, width_, z1 - 0.25});
        reveal(s_.metal, {0, sill, width_, z1 - 0.25}, 0.1);
        const int count = std::max(1, int(std::lround(width_ / 1.5)));
        for (int i = 0; i < count; ++i) {
            const Field pane{width_ * i / count, sill, width_ * (i + 1) / count, z1 - 0.25};
            picture(s_.panes[r_.below(uint32_t(s_.panes.size()))], pane, 0.1);
            if (i)
                m_.box(s_.metal, w_, {pane.x0 - 0.03, 0.03, sill}, {pane.x0 + 0.03, 0.1, z1 - 0.25},
                       MeshBuilder::kFront | MeshBuilder::kBack | MeshBuilder::kRight);
        }
    }
    void posts()
    {
        const int count = std::max(1, int(std::lround(width_ / 4.5)));
        for (int i = 0; i <= count; ++i) {
            const double x = std::clamp(width_ * i / count, 0.12, width_ - 0.12);
            slab(s_.trim, {x - 0.12, s_.ground_height, x + 0.12, s_.height()}, 0.12);
        }
    }

    void ground_floor(bool front)
    {
        if (!front)
            return plain_ground_floor();
        if (s_.ground == GroundFloor::homes)
            return home_ground_floor();
        shop_ground_floor();
    }

    void plain_ground_floor()
    {
        for (int b = 0; b < bays_; ++b) {
            const double middle = (b + 0.5) * bay_, half = std::min(s_.window_width, bay_ - 0.5) / 2;
            const Field hole{middle - half, 1.0, middle + half,
                             std::min(1.0 + s_.window_height, s_.ground_height - 0.4)};
            wall_around(s_.base, {b * bay_, 0, (b + 1) * bay_, s_.ground_height}, hole);
            window(hole);
        }
    }

    void home_ground_floor()
    {
        const int door = int(r_.below(uint32_t(bays_)));
        for (int b = 0; b < bays_; ++b) {
            const Field bay{b * bay_, 0, (b + 1) * bay_, s_.ground_height};
            const double middle = (b + 0.5) * bay_;
            if (b == door) {
                entrance(bay, middle, 1.1);
            } else if (s_.garages && b == (door + 1) % bays_ && bay_ > 2.6) {
                const Field hole{middle - 1.2, 0.02, middle + 1.2, 2.3};
                wall_around(s_.base, bay, hole);
                note_opening(hole);
                reveal(s_.trim, hole, 0.2, false);
                picture(s_.garage, hole, 0.2);
            } else {
                const double half = std::min(s_.window_width, bay_ - 0.5) / 2;
                const Field hole{middle - half, 1.0, middle + half,
                                 std::min(1.0 + s_.window_height, s_.ground_height - 0.4)};
                wall_around(s_.base, bay, hole);
                window(hole);
            }
        }
    }

    void entrance(const Field& bay, double middle, double wide)
    {
        const double top = std::min(2.85, bay.z1 - 0.35), light = 2.25;
        const Field hole{middle - wide / 2, 0.02, middle + wide / 2, top};
        wall_around(s_.base, bay, hole);
        note_opening(hole);
        reveal(s_.trim, hole, 0.28, false);
        picture(s_.ground == GroundFloor::homes ? s_.door : s_.glass_door, {hole.x0, 0.02, hole.x1, light}, 0.28);
        slab(s_.frame, {hole.x0, light, hole.x1, light + 0.07}, 0.03, 0.28);
        picture(s_.panes[0], {hole.x0, light + 0.07, hole.x1, top}, 0.28);
        slab(s_.trim, {hole.x0 - 0.15, 0, hole.x0, top + 0.1}, 0.06, 0, false);
        slab(s_.trim, {hole.x1, 0, hole.x1 + 0.15, top + 0.1}, 0.06, 0, false);
        slab(s_.trim, {hole.x0 - 0.22, top + 0.1, hole.x1 + 0.22, top + 0.28}, 0.14);
        m_.box(s_.base, w_, {hole.x0 - 0.1, -0.3, -0.2}, {hole.x1 + 0.1, 0.28, 0.1},
               MeshBuilder::kFront | MeshBuilder::kBack | MeshBuilder::kRight | MeshBuilder::kTop);
    }

    // panes between piers under a sign; a glass door in one of the bays
    void shop_ground_floor()
    {
        const int shops = std::max(1, int(std::lround(width_ / 4.2)));
        const double wide = width_ / shops, head = s_.ground_height - 0.85;
        const int door = int(r_.below(uint32_t(shops)));
        const bool left = r_.chance(0.5);
        for (int i = 0; i < shops; ++i) {
            const Field bay{i * wide, 0, (i + 1) * wide, s_.ground_height};
            const Field hole{bay.x0 + 0.22, 0.05, bay.x1 - 0.22, head};
            wall_around(s_.base, bay, hole);
            note_opening(hole);
            reveal(s_.metal, hole, 0.22, false);
            const double split = i != door ? hole.x0 : left ? hole.x0 + 1.1 : hole.x1 - 1.1;
            const Field display = i != door ? hole
                                  : left    ? Field{split, hole.z0, hole.x1, head}
                                            : Field{hole.x0, hole.z0, split, head};
            panel(s_.base, {display.x0, 0.05, display.x1, 0.5}, 0.16);
            m_.quad(s_.base, at(display.x0, 0.16, 0.5), at(display.x1, 0.16, 0.5), at(display.x1, 0.22, 0.5),
                    at(display.x0, 0.22, 0.5));
            glazing({display.x0, 0.5, display.x1, head}, 0.19,
                    display.width() > 2.6 ? WindowKind::casement : WindowKind::sash,
                    s_.ground == GroundFloor::lobby ? s_.panes[0] : s_.shop_panes[r_.below(2)]);
            if (i == door)
                picture(s_.glass_door, left ? Field{hole.x0, 0.02, split, head} : Field{split, 0.02, hole.x1, head},
                        0.22);
        }
        if (s_.ground == GroundFloor::shops)
            shop_front(head);
    }

    void shop_front(double head)
    {
        const Field board{0.12, head + 0.08, width_ - 0.12, s_.ground_height - 0.16};
        slab(s_.trim, board, 0.08);
        const double wide = std::min(width_ - 0.4, board.height() * 7), x = (width_ - wide) / 2;
        picture(s_.sign, {x, board.z0 + 0.04, x + wide, board.z1 - 0.04}, -0.09);
        if (!s_.awnings)
            return;
        const double out = 1.25, low = head - 0.62, top = head + 0.06, x0 = 0.3, x1 = width_ - 0.3;
        m_.quad(s_.awning, at(x0, -out, low), at(x1, -out, low), at(x1, -0.02, top), at(x0, -0.02, top));
        m_.quad(s_.awning, at(x0, -0.02, top - 0.015), at(x1, -0.02, top - 0.015), at(x1, -out, low - 0.015),
                at(x0, -out, low - 0.015)); // seen from below
        m_.quad(s_.awning, at(x0, -out, low - 0.22), at(x1, -out, low - 0.22), at(x1, -out, low), at(x0, -out, low));
        m_.triangle(s_.awning, at(x0, -0.02, low), at(x0, -out, low), at(x0, -0.02, top));
        m_.triangle(s_.awning, at(x1, -out, low), at(x1, -0.02, low), at(x1, -0.02, top));
    }

    void ornaments()
    {
        const double top = s_.height();
        slab(s_.trim, {0, s_.ground_height - 0.14, width_, s_.ground_height}, 0.07);
        if (s_.courses && !s_.curtain_wall)
            for (int floor = 2; floor < s_.storeys; ++floor) {
                const double z = s_.ground_height + s_.storey * (floor - 1);
                slab(s_.trim, {0, z - 0.1, width_, z}, 0.04);
            }
        if (s_.cornice) {
            slab(s_.trim, {0, top - 0.35, width_, top - 0.18}, 0.12);
            slab(s_.trim, {0, top - 0.18, width_, top}, 0.28);
        }
    }

    MeshBuilder& m_;
    const FacadeStyle& s_;
    Frame w_;
    double width_;
    KeyedRandom& r_;
    int bays_;
    double bay_;
};

} // namespace

void add_facade(MeshBuilder& mesh, const FacadeStyle& style, const Frame& wall, double width, bool front,
                KeyedRandom& random)
{
    Facade(mesh, style, wall, width, random).add(front);
}

} // namespace semrover
