// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/streets/street_parts.h"

#include "tools/streets/street_objects.h"

#include <algorithm>
#include <numbers>

namespace semrover {

namespace {

enum FurnishingKey : uint64_t { kTrees = 40, kLights, kThings, kPeople, kSigns, kBollards, kWalks };

class Furnishing {
  public:
    explicit Furnishing(Site& site)
        : site_(site), m_(site.mesh), road_(site.road), c_(site.road.section()), crossings_(crossings_of(site.road))
    {
    }

    void add()
    {
        for (const Block& b : road_.blocks())
            for (int side : {1, -1}) {
                trees(b, side);
                lights(b, side);
                things(b, side);
                people(b, side);
            }
        for (const Junction& j : road_.junctions())
            junction(j);
    }

  private:
    // on the sidewalk, `in` metres from the kerb, x along the traffic of that side
    Frame place(double s, int side, double in) const
    {
        const Frame f = road_.frame(s, side * (c_.kerb() + in), c_.kerb_height);
        return side < 0 ? f : f.turned(std::numbers::pi);
    }
    bool free(double s, double margin) const
    {
        if (s < 1 || s > road_.length() - 2)
            return false;
        for (const Crossing& c : crossings_)
            if (s > c.first - margin && s < c.last + margin)
                return false;
        const Junction* j = road_.junction_at(s, margin);
        return !j;
    }
    KeyedRandom random(uint64_t what, const Block& b, int side) const
    {
        return KeyedRandom(site_.seed, {what, b.index, uint64_t(side > 0)});
    }

    void trees(const Block& b, int side)
    {
        KeyedRandom r = random(kTrees, b, side);
        constexpr TreeKind kinds[] = {TreeKind::round, TreeKind::tall, TreeKind::young, TreeKind::round};
        const bool any = r.chance(0.68);
        const TreeKind kind = r.pick(kinds);
        const double step = r.uniform(8, 13);
        const Finish soil = m_.finish(Pattern::earth, 9);
        uint64_t i = 0;
        for (double s = b.first + 5; s < b.last - 3; s += step, ++i) {
            KeyedRandom own(site_.seed, {kTrees, b.index, uint64_t(side > 0), i + 1});
            if (!any || own.chance(0.12) || !free(s, 2.5))
                continue;
            const Frame f = place(s, side, 0.75);
            const auto p = [&](double x, double y) { return f.at(x, y, 0.012); };
            m_.quad(soil, p(-0.6, -0.45), p(0.6, -0.45), p(0.6, 0.45), p(-0.6, 0.45));
            add_tree(m_, f, kind, own);
            ++site_.objects["tree"];
        }
    }

    void lights(const Block& b, int side)
    {
        const bool old = KeyedRandom(site_.seed, {kLights}).chance(0.35);
        for (double s = b.first + (side > 0 ? 9 : 20); s < b.last - 2; s += 24)
            if (free(s, 1.5)) {
                // the arm reaches over the road: to the left of its traffic
                add_street_light(m_, place(s, side, 0.45), old ? 3.9 : 6.8, old);
                ++site_.objects["street light"];
            }
    }

    void things(const Block& b, int side)
    {
        KeyedRandom r = random(kThings, b, side);
        for (double s = b.first + 6.5; s < b.last - 3; s += r.uniform(3.5, 7)) {
            const uint32_t kind = r.below(12);
            const bool fits = free(s, 2.2);
            KeyedRandom own(site_.seed, {kThings, b.index, uint64_t(side > 0), uint64_t(s * 16)});
            if (fits)
                thing(kind, s, side, own);
        }
    }
    void thing(uint32_t kind, double s, int side, KeyedRandom& r)
    {
        const Frame kerb = place(s + 1.7, side, 0.5), wall = place(s, side, c_.sidewalk - 0.5);
        const auto count = [&](const char* name) { ++site_.objects[name]; };
        switch (kind) {
        case 0:
            add_bin(m_, kerb, r);
            return count("bin");
        case 1:
            add_bin(m_, wall, r);
            return count("bin");
        case 2:
            add_bench(m_, place(s, side, c_.sidewalk - 0.55));
            return count("bench");
        case 3:
            add_cabinet(m_, wall);
            return count("cabinet");
        case 4:
        case 5:
            add_bike_rack(m_, place(s, side, 1.0), 3, r);
            return count("bicycle rack");
        case 6:
            add_sign(m_, kerb, r.chance(0.5) ? SignKind::parking : SignKind::no_entry);
            return count("sign");
        case 7:
            add_planter(m_, wall, r);
            return count("planter");
        case 8:
            add_sign(m_, kerb, SignKind::speed);
            return count("sign");
        case 9:
            if (c_.sidewalk > 3.1) {
                add_bus_stop(m_, place(s, side, 1.55));
                count("bus stop");
            }
            return;
        default:
            add_bollard(m_, kerb);
            return count("bollard");
        }
    }

    void people(const Block& b, int side)
    {
        KeyedRandom r = random(kPeople, b, side);
        for (double s = b.first + r.uniform(1, 8); s < b.last; s += r.uniform(4, 17)) {
            const double in = r.uniform(1.5, std::max(1.6, c_.sidewalk - 0.9)),
                         turn = r.chance(0.5) ? 0 : std::numbers::pi;
            KeyedRandom own(site_.seed, {kPeople, b.index, uint64_t(side > 0), uint64_t(s * 16)});
            if (!free(s, 0.5))
                continue;
            const Frame f = place(s, side, in).turned(turn + own.uniform(-0.3, 0.3));
            const size_t first = m_.objects().size();
            add_person(m_, f, own);
            ++site_.objects["person"];
            if (own.chance(0.25) && c_.sidewalk - in > 1.2) { // two walk together
                add_person(m_, f.moved(0.1, side * (turn > 0 ? -0.65 : 0.65), 0), own);
                ++site_.objects["person"];
            }
            walk(b, first, s, side, in, turn > 0);
        }
    }
    // whoever was added since object `first` walks as far as the kerb is high, and stands there
    void walk(const Block& b, size_t first, double s, int side, double in, bool back)
    {
        constexpr double kLook = 0.25;
        KeyedRandom r(site_.seed, {kWalks, b.index, uint64_t(side > 0), uint64_t(s * 16)});
        MovingThing thing{.s = s,
                          .d = side * (c_.kerb() + in),
                          .way = (side > 0) != back ? -1 : 1, // the traffic on the left comes
                          .speed = r.uniform(1.0, 1.6),
                          .low = s,
                          .high = s,
                          .stays = true,
                          .upright = true};
        while (free(thing.low - kLook, 0.5))
            thing.low -= kLook;
        while (free(thing.high + kLook, 0.5))
            thing.high += kLook;
        for (size_t id = first; id < m_.objects().size(); ++id)
            thing.objects.push_back(uint32_t(id));
        site_.moving.push_back(std::move(thing));
    }

    void junction(const Junction& j)
    {
        KeyedRandom r(site_.seed, {kSigns, j.index});
        const bool red = r.chance(0.5), arms = r.chance(0.6);
        for (const Crossing& c : crossings_)
            if (c.junction == &j) {
                // for those who come: on their right, before the crossing
                const int side = c.before ? -1 : 1;
                const double s = c.before ? c.first - 0.6 : c.last + 0.6;
                if (j.lights) {
                    add_traffic_light(m_, place(s, side, 0.45), arms, red);
                    ++site_.objects["traffic light"];
                } else {
                    add_sign(m_, place(s, side, 0.45), r.chance(0.5) ? SignKind::crossing : SignKind::priority);
                    ++site_.objects["sign"];
                }
                const Frame across = place(c.before ? c.last + 0.4 : c.first - 0.4, -side, 0.45);
                if (r.chance(0.5)) {
                    add_railing(m_, place(c.before ? c.first - 1 : c.last + 1, -side, 0.3), 2.5);
                    ++site_.objects["railing"];
                } else {
                    add_bollard(m_, across);
                    ++site_.objects["bollard"];
                }
            }
        for (int side : {1, -1})
            if (j.opens(side))
                mouth(j, side, red, r);
    }

    // signs and lights for those who come out of a side street; bollards around its corners
    void mouth(const Junction& j, int side, bool red, KeyedRandom& r)
    {
        // they drive towards the street: along -y on the left side, and their right hand is at greater s there
        const double s = j.middle - side * (j.half + 0.5), d = c_.facade() + 0.4;
        const Frame f =
            road_.frame(s, side * d, c_.kerb_height).turned(side > 0 ? -std::numbers::pi / 2 : std::numbers::pi / 2);
        if (j.lights)
            add_traffic_light(m_, f, false, !red);
        else
            add_sign(m_, f, r.chance(0.5) ? SignKind::stop : SignKind::yield);
        ++site_.objects[j.lights ? "traffic light" : "sign"];
        add_sign(m_, road_.frame(j.middle + j.half + 0.6, side * (c_.kerb() + 1.9), c_.kerb_height),
                 SignKind::street_name);
        ++site_.objects["sign"];
        for (int way : {-1, 1})
            for (double x : {0.4, 1.8}) {
                const double in = c_.kerb() + j.corner() + 0.6 + x;
                add_bollard(m_, road_.frame(j.middle + way * (j.half + 0.35), side * in, c_.kerb_height));
                ++site_.objects["bollard"];
            }
    }

    Site& site_;
    MeshBuilder& m_;
    const RoadNetwork& road_;
    CrossSection c_;
    std::vector<Crossing> crossings_;
};

} // namespace

void add_furnishing(Site& site)
{
    Furnishing(site).add();
}

} // namespace semrover
