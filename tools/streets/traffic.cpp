// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/streets/street_objects.h"
#include "tools/streets/street_parts.h"

#include <algorithm>
#include <numbers>

namespace semrover {

namespace {

enum TrafficKey : uint64_t { kParked = 60, kOncoming, kSideCars, kTram, kSpeeds };
enum Lane : uint32_t { kOncomingLane = MovingThing::kOwnWay + 1, kLeftCycleLane, kRightCycleLane };

class Traffic {
  public:
    explicit Traffic(Site& site)
        : site_(site), m_(site.mesh), road_(site.road), c_(site.road.section()), crossings_(crossings_of(site.road))
    {
    }

    void add()
    {
        if (c_.parking > 0)
            for (int side : {1, -1})
                parked(side);
        oncoming();
        if (c_.cycle > 0)
            cyclists();
        for (const Junction& j : road_.junctions())
            for (int side : {1, -1})
                if (j.opens(side))
                    side_street(j, side);
    }

  private:
    bool free(double s0, double s1) const
    {
        if (s0 < 0 || s1 > road_.length())
            return false;
        for (const Crossing& c : crossings_)
            if (s1 > c.first - 2 && s0 < c.last + 2)
                return false;
        for (const Junction& j : road_.junctions())
            if (s1 > j.first() - 3 && s0 < j.last() + 3)
                return false;
        return true;
    }
    // level lengthwise with the road, x along it, or against it
    Frame place(double s, double d, bool against) const
    {
        const Vector3 ahead = road_.at(s + 1.3, d), behind = road_.at(s - 1.3, d);
        Frame f;
        f.origin = mix(behind, ahead, 0.5);
        f.x = normalized(ahead - behind) * (against ? -1.0 : 1.0);
        f.y = normalized(cross({0, 0, 1}, f.x));
        f.z = cross(f.x, f.y);
        return f;
    }

    // Everything since object `first` is one thing that may move. What comes is gone when even a tram has left the
    // street's beginning; what goes waits at the end.
    void may_move(size_t first, double s, double d, int way, Lane lane, double slowest, double fastest)
    {
        constexpr double kBehind = 14, kBeforeEnd = 2;
        KeyedRandom r(site_.seed, {kSpeeds, lane, uint64_t(s * 16)});
        MovingThing thing{.s = s,
                          .d = d,
                          .way = way,
                          .lane = lane,
                          .speed = r.uniform(slowest, fastest),
                          .low = -kBehind,
                          .high = road_.length() - kBeforeEnd,
                          .stays = way > 0};
        for (size_t id = first; id < m_.objects().size(); ++id)
            thing.objects.push_back(uint32_t(id));
        site_.moving.push_back(std::move(thing));
    }

    void parked(int side)
    {
        const double d = side * (c_.lane + c_.cycle + c_.parking / 2);
        for (uint64_t bay = 0; bay * kParkingBay < road_.length(); ++bay) {
            KeyedRandom r(site_.seed, {kParked, uint64_t(side > 0), bay});
            r.uniform(); // decides whether it is taken
            const double s0 = double(bay) * kParkingBay, middle = s0 + kParkingBay / 2 + r.uniform(-0.25, 0.25);
            const uint32_t kind = r.below(100);
            const bool against = (side > 0) != r.chance(0.1);
            if (!taken(bay, side) || !free(s0, s0 + kParkingBay))
                continue;
            const Frame f = place(middle, d + r.uniform(-0.06, 0.06), against);
            if (kind < 88)
                car(f, r);
            else if (kind < 94)
                motorcycles(f, r);
            else if (!taken(bay + 1, side) && free(s0, s0 + 2 * kParkingBay))
                truck(place(s0 + kParkingBay, d, against), r);
            else
                car(f, r);
        }
    }
    // a truck is longer than a bay: only where the next one is free
    void truck(const Frame& f, KeyedRandom& r)
    {
        add_truck(m_, f, r);
        ++site_.objects["truck"];
    }
    // of a bay, before anything else is drawn for it
    bool taken(uint64_t bay, int side) const
    {
        const double full = 0.55 + 0.3 * KeyedRandom(site_.seed, {kParked}).uniform();
        return KeyedRandom(site_.seed, {kParked, uint64_t(side > 0), bay}).chance(full);
    }

    void car(const Frame& f, KeyedRandom& r)
    {
        constexpr CarBody bodies[] = {CarBody::hatchback, CarBody::hatchback, CarBody::sedan, CarBody::sedan,
                                      CarBody::estate,    CarBody::suv,       CarBody::suv,   CarBody::van};
        add_car(m_, f, r.pick(bodies), r);
        ++site_.objects["car"];
    }
    void motorcycles(const Frame& f, KeyedRandom& r)
    {
        for (double x : {-1.2, 0.0, 1.2}) {
            add_motorcycle(m_, f.moved(x, 0, 0).turned(std::numbers::pi / 2 + r.uniform(-0.15, 0.15)), r);
            ++site_.objects["motorcycle"];
        }
    }

    // on the other lane, towards the drive
    void oncoming()
    {
        const double d = c_.lane / 2 + 0.12;
        uint64_t i = 0;
        double s = 22;
        if (c_.rails && s + 40 < road_.length()) {
            KeyedRandom r(site_.seed, {kTram});
            s = r.uniform(40, 62);
            if (s + 16 < road_.length()) {
                const size_t first = m_.objects().size();
                add_tram(m_, place(s, c_.lane / 2, true), r);
                may_move(first, s, c_.lane / 2, -1, kOncomingLane, 7, 9);
                ++site_.objects["tram"];
            }
            s += 20;
        }
        while (s < road_.length()) {
            KeyedRandom r(site_.seed, {kOncoming, i++});
            s += r.uniform(14, 44);
            const double half = 6.5;
            if (s + half > road_.length())
                break;
            const Frame f = place(s, d, true);
            const double kind = r.uniform();
            const size_t first = m_.objects().size();
            if (kind < 0.45)
                car(f, r);
            else if (kind < 0.58)
                truck(f, r);
            else if (kind < 0.76) {
                add_bus(m_, f, r);
                ++site_.objects["bus"];
            } else {
                ride(f, kind < 0.88, r);
            }
            const bool bicycle = kind >= 0.88, heavy = kind >= 0.45 && kind < 0.76;
            may_move(first, s, d, -1, kOncomingLane, bicycle ? 4.5 : 7, bicycle ? 6.5 : heavy ? 9.5 : 12);
            s += half;
        }
    }
    void ride(const Frame& f, bool motorcycle, KeyedRandom& r)
    {
        motorcycle ? add_motorcycle(m_, f, r) : add_bicycle(m_, f, r);
        add_rider(m_, f, motorcycle, r);
        ++site_.objects[motorcycle ? "motorcycle" : "bicycle"];
        ++site_.objects["rider"];
    }
    void cyclists()
    {
        for (uint64_t i = 0; i * 31.0 + 26 < road_.length(); ++i)
            for (int side : {1, -1}) {
                KeyedRandom r(site_.seed, {kOncoming, 1000 + i, uint64_t(side > 0)});
                const double s = double(i) * 31 + 12 + r.uniform(0, 14);
                if (!r.chance(0.6) || s >= road_.length() - 3)
                    continue;
                const double d = side * (c_.lane + c_.cycle / 2);
                const size_t first = m_.objects().size();
                ride(place(s, d, side > 0), false, r);
                may_move(first, s, d, -side, side > 0 ? kLeftCycleLane : kRightCycleLane, 3.5, 6.5);
            }
    }

    // waiting at the end, parked along the way
    void side_street(const Junction& j, int side)
    {
        KeyedRandom r(site_.seed, {kSideCars, j.index, uint64_t(side > 0)});
        const double half = j.half / 2;
        const auto at = [&](double way, double out, bool towards) {
            Frame f = road_.frame(j.middle + way * half, side * (c_.facade() + out));
            return f.turned((side > 0) != towards ? std::numbers::pi / 2 : -std::numbers::pi / 2);
        };
        const double own = -side; // the lane of those who come out
        if (r.chance(0.5))
            car(at(own, 3.6, true), r);
        for (double out = 12; out < RoadNetwork::kSideReach - 4; out += 7)
            if (r.chance(0.5))
                car(at(own * 1.05, out, true), r);
            else if (r.chance(0.3))
                car(at(-own * 1.05, out, false), r);
    }

    Site& site_;
    MeshBuilder& m_;
    const RoadNetwork& road_;
    CrossSection c_;
    std::vector<Crossing> crossings_;
};

} // namespace

void add_traffic(Site& site)
{
    Traffic(site).add();
}

} // namespace semrover
