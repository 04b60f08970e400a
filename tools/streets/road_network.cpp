// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/streets/road_network.h"

#include "runtime/base/keyed_random.h"

#include <algorithm>

namespace semrover {

namespace {

constexpr double kStep = 0.5;
constexpr double kStraightEnd = 8; // of a block, next to a junction

CrossSection section_of(uint64_t seed)
{
    KeyedRandom r(seed, {1});
    CrossSection c;
    c.lane = r.uniform(3.0, 3.5);
    c.parking = r.chance(0.78) ? r.uniform(2.0, 2.3) : 0;
    c.cycle = r.chance(0.35) ? r.uniform(1.4, 1.8) : 0;
    c.sidewalk = r.uniform(2.6, 4.4);
    c.kerb_height = r.uniform(0.12, 0.15);
    c.rails = r.chance(0.22);
    c.red_cycle_lane = r.chance(0.5);
    return c;
}

} // namespace

RoadNetwork::RoadNetwork(uint64_t seed, double length) : length_(length), section_(section_of(seed))
{
    lay_out(seed);
    integrate(seed);
}

void RoadNetwork::lay_out(uint64_t seed)
{
    double s = 0;
    for (uint32_t i = 0; s < length_ + 100; ++i) {
        KeyedRandom r(seed, {2, i});
        const double size = i == 0 ? r.uniform(34, 62) : r.uniform(44, 92);
        blocks_.push_back({s, s + size, i});
        curvature_.push_back(i > 0 && r.chance(0.6) ? (r.chance(0.5) ? 1 : -1) / r.uniform(90, 260) : 0);
        Junction j;
        j.half = r.uniform(2.8, 3.6);
        j.walk = r.uniform(2.2, 3.0);
        const uint32_t shape = r.below(4); // a crossing, a T to the left or the right
        j.left = shape != 1;
        j.right = shape != 2;
        j.lights = r.chance(0.55);
        j.index = i;
        j.middle = s + size + j.half + j.walk;
        if (j.last() + 6 < length_)
            junctions_.push_back(j);
        s = j.last();
    }
}

void RoadNetwork::integrate(uint64_t seed)
{
    Knot k{0, 0, 0, 0};
    size_t block = 0;
    double slope = 0, s = 0;
    for (; s < length_ + 80; s += kStep) {
        knots_.push_back(k);
        while (block + 1 < blocks_.size() && s > blocks_[block].last)
            ++block;
        const Block& b = blocks_[block];
        const double inside = (s - b.first - kStraightEnd) / std::max(b.last - b.first - 2 * kStraightEnd, 1.0);
        const double ramp = std::clamp(std::min(inside, 1 - inside) * 4, 0.0, 1.0); // clothoid, arc, clothoid
        const double curvature = curvature_[block] * ramp;
        KeyedRandom r(seed, {3, uint64_t(s / 40)});
        const double wanted = r.uniform(-0.03, 0.03);
        slope += (wanted - slope) * kStep / 25;
        const double middle = k.heading + curvature * kStep / 2;
        k.x += kStep * std::cos(middle);
        k.y += kStep * std::sin(middle);
        k.z += kStep * slope;
        k.heading += curvature * kStep;
    }
}

Vector3 RoadNetwork::at(double s, double d, double h) const
{
    const double t = std::clamp(s / kStep, -20.0 / kStep, double(knots_.size() - 1));
    const size_t i = size_t(std::clamp(t, 0.0, double(knots_.size() - 2)));
    const Knot &a = knots_[i], &b = knots_[i + 1];
    const double f = t - double(i), turn = a.heading + (b.heading - a.heading) * f;
    return {a.x + (b.x - a.x) * f - d * std::sin(turn), a.y + (b.y - a.y) * f + d * std::cos(turn),
            a.z + (b.z - a.z) * f + h};
}

double RoadNetwork::heading(double s) const
{
    const double t = std::clamp(s / kStep, 0.0, double(knots_.size() - 1) - 1e-6);
    const size_t i = size_t(t);
    return knots_[i].heading + (knots_[i + 1].heading - knots_[i].heading) * (t - double(i));
}

Frame RoadNetwork::frame(double s, double d, double h) const
{
    return upright_frame(at(s, d, h), heading(s));
}

const Junction* RoadNetwork::junction_at(double s, double margin) const
{
    for (const Junction& j : junctions_)
        if (s > j.first() - margin && s < j.last() + margin)
            return &j;
    return nullptr;
}

} // namespace semrover
