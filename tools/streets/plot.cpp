// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/streets/street_parts.h"

#include "tools/streets/class_label.h"
#include "tools/streets/facade.h"
#include "tools/streets/street_objects.h"

#include <algorithm>

namespace semrover {

namespace {

constexpr double kDepth = 11; // of houses

enum PlotKey : uint64_t { kPlot = 20, kStyle, kSide, kClosing };

uint64_t key_of(uint64_t what, uint64_t block, int side, uint64_t index)
{
    return ((what * 4096 + block) * 2 + uint64_t(side > 0)) * 256 + index;
}

class Plots {
  public:
    explicit Plots(Site& site) : site_(site), m_(site.mesh), road_(site.road), c_(site.road.section())
    {
        lawn_ = m_.finish(Pattern::grass, label::kTerrain);
    }

    void add()
    {
        for (const Block& b : road_.blocks())
            for (int side : {1, -1})
                block(b, side);
        for (const Junction& j : road_.junctions())
            for (int side : {1, -1})
                if (j.opens(side))
                    side_street(j, side);
        closing();
    }

  private:
    double base() const { return c_.kerb_height; }
    uint32_t district_of(uint32_t block) const { return KeyedRandom(site_.seed, {5, block}).below(3); }

    const Junction* after(const Block& b) const
    {
        for (const Junction& j : road_.junctions())
            if (j.index == b.index)
                return &j;
        return nullptr;
    }

    // where houses of a block stand: up to the side streets' sidewalks, or through where none opens on this side
    void block(const Block& b, int side)
    {
        const Junction *before = nullptr, *next = after(b);
        for (const Junction& j : road_.junctions())
            if (j.index + 1 == b.index)
                before = &j;
        const double first = before && before->opens(side) ? b.first : before ? before->middle : b.first;
        double last = next && !next->opens(side) ? next->middle : b.last;
        last = std::min(last, road_.length());
        std::vector<Lot> lots;
        double s = first;
        KeyedRandom r(site_.seed, {kPlot, b.index, uint64_t(side > 0)});
        for (uint64_t i = 0; s < last - 0.5; ++i) {
            double wide = r.uniform(7.5, 15);
            const bool beyond = b.last > road_.length();
            if (s + wide * 1.6 > last && !beyond)
                wide = last - s;
            else if (s + wide > last)
                break;
            const double kind = r.uniform();
            const bool opens_before = i == 0 && before && before->opens(side);
            const bool opens_after = s + wide > last - 0.1 && next && next->opens(side);
            const bool corner = opens_before || opens_after;
            Lot lot{s, s + wide, key_of(kPlot, b.index, side, i), kind < 0.84 || corner || wide < 6};
            lot.open_first = opens_before || (i == 0 && !before);
            lot.open_last = opens_after;
            lots.push_back(lot);
            s += wide;
        }
        build(lots, side, district_of(b.index));
    }

    struct Lot {
        double first, last; // along the street
        uint64_t key;
        bool house, open_first = false, open_last = false;
        FacadeStyle style = {};
        double top = 0; // of the house, in the world
    };

    // houses side by side have no walls between them as high as both are
    void build(std::vector<Lot>& lots, int side, uint32_t district)
    {
        for (Lot& lot : lots)
            if (lot.house) {
                KeyedRandom r(site_.seed, {kStyle, lot.key});
                lot.style = random_style(m_, r, district);
                lot.top = plot_between(lot.first, lot.last, side, 0).frame.origin.z + lot.style.height();
            }
        for (size_t i = 0; i < lots.size(); ++i) {
            const Lot& lot = lots[i];
            if (!lot.house) {
                garden(lot.first, lot.last, side, lot.key, district);
                continue;
            }
            BuildingPlot p = plot_between(lot.first, lot.last, side, 0);
            const double before = i && lots[i - 1].house ? lots[i - 1].top - p.frame.origin.z : 0;
            const double after = i + 1 < lots.size() && lots[i + 1].house ? lots[i + 1].top - p.frame.origin.z : 0;
            (side > 0 ? p.hidden_left : p.hidden_right) = before;
            (side > 0 ? p.hidden_right : p.hidden_left) = after;
            (side > 0 ? p.open_left : p.open_right) = lot.open_first;
            (side > 0 ? p.open_right : p.open_left) = lot.open_last;
            add_building(m_, lot.style, p, site_.seed, lot.key);
            ++site_.objects["building"];
        }
    }

    // seen from the street, the left corner of the front: the farther one on the right side
    BuildingPlot plot_between(double s0, double s1, int side, double back)
    {
        const double d = side * (c_.facade() + back);
        const Vector3 a = road_.at(side > 0 ? s0 : s1, d), b = road_.at(side > 0 ? s1 : s0, d);
        BuildingPlot p;
        Vector3 along = b - a;
        const double low = std::min(a.z, b.z), high = std::max(a.z, b.z);
        along.z = 0;
        p.frame = {{a.x, a.y, high + base()}, normalized(along), {}, {0, 0, 1}};
        p.frame.y = cross(p.frame.z, p.frame.x);
        p.width = length(along);
        p.depth = kDepth;
        p.below = high - low + 0.15;
        return p;
    }

    void ground(double s0, double s1, int side, double from, double to, Finish f)
    {
        for (double s = s0; s < s1 - 1e-6; s += 4) {
            const double e = std::min(s + 4, s1), a = side > 0 ? s : e, b = side > 0 ? e : s;
            const auto p = [&](double x, double d) { return road_.at(x, side * (c_.facade() + d), base()); };
            m_.quad(f, p(a, from), p(b, from), p(b, to), p(a, to), a, from);
        }
    }

    Frame place(double s, int side, double back, double up = 0) const
    {
        const Frame f = road_.frame(s, side * (c_.facade() + back), base() + up);
        return side > 0 ? f : f.turned(3.14159265358979323846); // y away from the street
    }

    // a lawn with trees behind a wall, a fence or a hedge; often a house set back
    void garden(double s0, double s1, int side, uint64_t key, uint32_t district)
    {
        KeyedRandom r(site_.seed, {kSide, key});
        ground(s0, s1, side, 0, 22, lawn_);
        border(s0, s1, side, r);
        if (r.chance(0.5)) {
            BuildingPlot p = plot_between(s0 + 1, s1 - 1, side, 6);
            p.open_left = p.open_right = true;
            FacadeStyle style = random_style(m_, r, 1);
            style.storeys = std::min(style.storeys, 2 + int(r.below(2)));
            style.ground = GroundFloor::homes;
            add_building(m_, style, p, site_.seed, key);
            ++site_.objects["building"];
        } else {
            for (int i = 0; i < 3; ++i)
                tree(place(r.uniform(s0 + 1.5, s1 - 1.5), side, r.uniform(5, 14)), r);
            hedge(place(side > 0 ? s0 : s1, side, 20), s1 - s0, 1.2, 3, r);
            house_row(s0, s1, side, key, district);
        }
        for (int i = 0; i < 3; ++i) {
            const double size = r.uniform(0.5, 0.9);
            add_bush(m_, place(r.uniform(s0 + 1, s1 - 1), side, r.uniform(1.3, 4)), {size, size, size * 1.1}, r);
            ++site_.objects["bush"];
        }
    }
    void house_row(double s0, double s1, int side, uint64_t key, uint32_t district)
    {
        BuildingPlot p = plot_between(s0 - 2, s1 + 2, side, 22);
        KeyedRandom r(site_.seed, {kStyle, key, 1});
        add_building(m_, random_style(m_, r, district), p, site_.seed, key + 128);
        ++site_.objects["building"];
    }
    void tree(const Frame& foot, KeyedRandom& r)
    {
        constexpr TreeKind kinds[] = {TreeKind::round, TreeKind::tall, TreeKind::spreading};
        add_tree(m_, foot, r.pick(kinds), r);
        ++site_.objects["tree"];
    }

    void border(double s0, double s1, int side, KeyedRandom& r)
    {
        const double kind = r.uniform();
        const uint8_t what = kind < 0.35 ? label::kWall : kind < 0.75 ? label::kFence : label::kVegetation;
        const ObjectNote note(m_, what, place((s0 + s1) / 2, side, 0.25).turned(-1.5707963267948966));
        for (double s = s0; s < s1 - 0.1; s += 3) {
            const double e = std::min(s + 3, s1), wide = e - s;
            const Frame f = place(side > 0 ? s : e, side, 0.25);
            if (kind < 0.35) {
                const Finish wall = m_.finish(Pattern::brick, label::kWall, {0.6, 0.42, 0.34});
                const Finish cap = m_.finish(Pattern::ashlar, label::kWall, {0.7, 0.68, 0.63});
                m_.box(wall, f, {0, -0.12, -0.2}, {wide, 0.12, 1.45});
                m_.box(cap, f, {0, -0.18, 1.45}, {wide, 0.18, 1.55}, MeshBuilder::kAllSides);
            } else if (kind < 0.75) {
                fence(f, wide, kind < 0.55);
            } else {
                add_hedge(m_, f.moved(0, 0.3, 0), wide, 0.7, 1.5, r);
            }
        }
        ++site_.objects[kind < 0.35 ? "wall" : kind < 0.75 ? "fence" : "hedge"];
    }

    void hedge(const Frame& f, double length, double width, double height, KeyedRandom& r)
    {
        const ObjectNote note(m_, label::kVegetation, f.turned(-1.5707963267948966));
        add_hedge(m_, f, length, width, height, r);
    }

    void fence(const Frame& f, double wide, bool wood)
    {
        const Finish bar = wood ? m_.finish(Pattern::planks, label::kFence, {0.62, 0.48, 0.36})
                                : m_.finish(Pattern::metal, label::kFence, {0.2, 0.23, 0.22});
        const Finish foot = m_.finish(Pattern::concrete, label::kFence, {0.62, 0.61, 0.58});
        m_.box(foot, f, {0, -0.1, -0.2}, {wide, 0.1, 0.3});
        for (double z : {0.5, 1.25})
            m_.box(bar, f, {0, -0.02, z}, {wide, 0.02, z + 0.06}, MeshBuilder::kAllSides);
        const double step = wood ? 0.14 : 0.13, thick = wood ? 0.1 : 0.02;
        for (double x = step / 2; x + thick < wide; x += step)
            m_.box(bar, f, {x, wood ? -0.045 : -0.01, 0.3}, {x + thick, wood ? -0.02 : 0.01, wood ? 1.4 : 1.5},
                   MeshBuilder::kStanding);
    }

    // two rows of houses and one across at the end
    void side_street(const Junction& j, int side)
    {
        const double reach = RoadNetwork::kSideReach;
        for (int way : {-1, 1}) {
            const double s = j.middle + way * (j.half + j.walk);
            KeyedRandom r(site_.seed, {kSide, j.index, uint64_t(side + 1), uint64_t(way + 1)});
            double from = kDepth;
            for (uint64_t i = 0; from < reach - 4; ++i) {
                const double wide = std::min(r.uniform(8, 13), reach - from);
                // x to the right seen from the side street
                const bool outward = (way < 0) == (side > 0);
                const double start = outward ? from : from + wide;
                Frame f = road_.frame(s, side * (c_.facade() + start), base());
                const Vector3 out = f.y * double(side);
                f = {f.origin, outward ? out : out * -1, f.x * double(way), f.z};
                f.y = cross(f.z, f.x);
                BuildingPlot p{.frame = f, .width = wide, .depth = 9, .below = 0.3};
                const FacadeStyle style = random_style(m_, r, district_of(j.index));
                add_building(m_, style, p, site_.seed, key_of(kSide, j.index * 2 + uint64_t(way > 0), side, i));
                ++site_.objects["building"];
                from += wide;
            }
        }
        const double half = j.half + j.walk + 4;
        BuildingPlot p = plot_between(j.middle - half, j.middle + half, side, reach);
        KeyedRandom r(site_.seed, {kClosing, j.index, uint64_t(side + 1)});
        add_building(m_, random_style(m_, r, 0), p, site_.seed, key_of(kClosing, j.index, side, 0));
        ++site_.objects["building"];
    }

    // a green and houses across the end of the street
    void closing()
    {
        const double end = road_.length(), half = c_.facade() + 14;
        KeyedRandom r(site_.seed, {kClosing});
        const Frame f = road_.frame(end, 0, 0);
        const auto p = [&](double x, double y) { return f.at(x, y, 0.1); };
        m_.quad(lawn_, p(0, -half), p(14, -half), p(14, half), p(0, half));
        for (int i = 0; i < 7; ++i)
            tree(f.moved(r.uniform(4, 9), (i - 3) * 5 + r.uniform(-1, 1), 0.1), r);
        hedge(f.moved(1, half, 0.1).turned(-1.5707963267948966), 2 * half, 1, 1.3, r);
        for (int i = 0; i < 4; ++i) {
            const double wide = half / 2;
            const Frame wall{f.at(14, half - i * wide, 0.1), f.y * -1, f.x, f.z};
            add_building(m_, random_style(m_, r, 0), {.frame = wall, .width = wide}, site_.seed,
                         key_of(kClosing, 4000, 1, uint64_t(i)));
            ++site_.objects["building"];
        }
    }

    Site& site_;
    MeshBuilder& m_;
    const RoadNetwork& road_;
    CrossSection c_;
    Finish lawn_;
};

} // namespace

void add_plots(Site& site)
{
    Plots(site).add();
}

} // namespace semrover
