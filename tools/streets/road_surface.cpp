// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/streets/street_parts.h"

#include "runtime/base/keyed_random.h"
#include "tools/streets/class_label.h"

#include <algorithm>
#include <functional>

namespace semrover {

namespace {

constexpr double kCrossing = 3.4;       // length along the street
constexpr double kBefore = 1.9;         // from the end of the rounded kerb to the crossing
constexpr double kDash = 3, kGap = 4.5; // of the middle line
constexpr double kLine = 0.07;          // half the width of a line
constexpr double kLowered = 0.025;      // kerb at crossings

struct Surfaces {
    Finish asphalt, cycle, bay, gutter, paint, rail, kerb, slabs, edge;
};

Surfaces surfaces_of(MeshBuilder& m, const RoadNetwork& road, uint64_t seed)
{
    KeyedRandom r(seed, {4});
    const double warm = r.uniform(0.95, 1.0);
    const Color paving = {0.68 * r.uniform(0.9, 1.1), 0.66 * warm, 0.63 * warm};
    Surfaces s;
    const double dark = r.uniform(0.82, 1.0);
    s.asphalt = m.finish(Pattern::asphalt, label::kRoad, {dark, dark, dark});
    s.cycle = road.section().red_cycle_lane ? m.finish(Pattern::asphalt, label::kRoad, {1, 0.68, 0.6}) : s.asphalt;
    s.bay = r.chance(0.5) ? m.finish(Pattern::setts, label::kRoad, {0.5, 0.48, 0.46})
                          : m.finish(Pattern::asphalt, label::kRoad, {0.9, 0.9, 0.9});
    s.gutter = m.finish(Pattern::concrete, label::kRoad, {0.52, 0.52, 0.5});
    s.paint = m.finish(Pattern::road_paint, label::kRoadLane);
    s.rail = m.finish(Pattern::metal, label::kRoad, {0.5, 0.48, 0.46});
    s.kerb = m.finish(Pattern::kerb, label::kSidewalk);
    s.slabs = m.finish(Pattern::slabs, label::kSidewalk, paving);
    s.edge = m.finish(Pattern::setts, label::kSidewalk, {0.52, 0.5, 0.47});
    return s;
}

void sort_cuts(std::vector<double>& cuts, double first, double last)
{
    cuts.push_back(first);
    cuts.push_back(last);
    std::erase_if(cuts, [&](double c) { return c < first || c > last; });
    std::ranges::sort(cuts);
    // closer ones are the same
    cuts.erase(std::unique(cuts.begin(), cuts.end(), [](double a, double b) { return b - a < 0.004; }), cuts.end());
}

class Layer {
  public:
    Layer(MeshBuilder& mesh, const RoadNetwork& road, uint64_t seed)
        : mesh_(mesh), road_(road), c_(road.section()), crossings_(crossings_of(road)),
          s_(surfaces_of(mesh, road, seed))
    {
    }

    void add()
    {
        carriageway();
        for (int side : {1, -1}) {
            double from = 0;
            for (const Junction& j : road_.junctions())
                if (j.opens(side)) {
                    sidewalk(side, from, j.first());
                    side_street(j, side);
                    from = j.last();
                }
            sidewalk(side, from, road_.length());
        }
    }

  private:
    using Paint = std::function<Finish(double s, double d)>;
    using Height = std::function<double(double s, double d)>;

    // neighbours across the street of the same finish become one face
    void row(double s0, double s1, const std::vector<double>& d, const Paint& paint, const Height& height)
    {
        for (size_t i = 0; i + 1 < d.size();) {
            const Finish f = paint((s0 + s1) / 2, (d[i] + d[i + 1]) / 2);
            size_t end = i + 1;
            while (end + 1 < d.size() && same(paint((s0 + s1) / 2, (d[end] + d[end + 1]) / 2), f) &&
                   std::abs(height(s0, d[end + 1]) - height(s0, d[i])) < 1e-6 &&
                   std::abs(height(s1, d[end + 1]) - height(s1, d[i])) < 1e-6)
                ++end;
            const auto p = [&](double s, double x) { return road_.at(s, x, height(s, x)); };
            mesh_.quad(f, p(s0, d[i]), p(s1, d[i]), p(s1, d[end]), p(s0, d[end]), s0, d[i]);
            i = end;
        }
    }
    static bool same(Finish a, Finish b) { return a.material == b.material && a.label == b.label; }

    const Crossing* crossing_at(double s) const
    {
        for (const Crossing& c : crossings_)
            if (s > c.first && s < c.last)
                return &c;
        return nullptr;
    }

    void carriageway()
    {
        std::vector<double> s, d{0};
        for (double x = 0; x < road_.length(); x += 2)
            s.push_back(x);
        for (double x = 0; x < road_.length(); x += kDash + kGap)
            s.insert(s.end(), {x, x + kDash});
        if (c_.parking > 0)
            for (double x = 0; x < road_.length(); x += kParkingBay)
                s.insert(s.end(), {x, x + 0.1});
        for (const Crossing& c : crossings_) {
            const double stop = c.before ? c.first - 1 : c.last + 0.7;
            s.insert(s.end(), {c.first, c.last, stop, stop + 0.3});
        }
        for (const Junction& j : road_.junctions())
            s.insert(s.end(), {j.middle - j.half, j.middle + j.half, j.first(), j.last()});
        sort_cuts(s, 0, road_.length());
        for (double side : {1.0, -1.0}) {
            for (double x : {kLine, c_.lane - kLine, c_.lane + kLine, c_.lane + c_.cycle - 0.05,
                             c_.lane + c_.cycle + 0.05, c_.kerb() - 0.3, c_.kerb()})
                d.push_back(side * x);
            if (c_.rails)
                for (double x : {-0.75, -0.69, 0.69, 0.75})
                    d.push_back(side * (c_.lane / 2 + x));
        }
        std::vector<double> striped = d;
        for (double x = 0; x < c_.kerb(); x += 0.5)
            striped.insert(striped.end(), {x, -x});
        sort_cuts(d, -c_.kerb(), c_.kerb());
        sort_cuts(striped, -c_.kerb(), c_.kerb());
        const auto flat = [](double, double) { return 0.0; };
        const auto paint = [this](double x, double y) { return carriageway_finish(x, y); };
        for (size_t i = 0; i + 1 < s.size(); ++i)
            row(s[i], s[i + 1], crossing_at((s[i] + s[i + 1]) / 2) ? striped : d, paint, flat);
    }

    bool is_line(double s, double d) const
    {
        const double a = std::abs(d);
        const Junction* j = road_.junction_at(s);
        if (j && std::abs(s - j->middle) < j->half + j->corner())
            return false;
        for (const Crossing& c : crossings_) {
            const double stop = c.before ? c.first - 1 : c.last + 0.7;
            const bool own_lane = c.before ? d < 0 : d > 0; // one drives on the right
            if (s > stop && s < stop + 0.3 && own_lane && a > kLine && a < c_.lane - kLine)
                return true;
        }
        if (a < kLine && !c_.rails)
            return s - std::floor(s / (kDash + kGap)) * (kDash + kGap) < kDash;
        if (c_.cycle > 0 && std::abs(a - c_.lane) < kLine)
            return true;
        const double bays = c_.lane + c_.cycle;
        if (c_.parking > 0 && (std::abs(a - bays) < 0.05 || (a > bays && a < c_.kerb() - 0.3 && !j)))
            return s - std::floor(s / kParkingBay) * kParkingBay < 0.1;
        return false;
    }

    Finish carriageway_finish(double s, double d) const
    {
        const double a = std::abs(d);
        if (crossing_at(s))
            return std::fmod(a, 1.0) < 0.5 && a < c_.kerb() - 0.3 ? s_.paint : s_.asphalt;
        if (c_.rails && std::abs(std::abs(a - c_.lane / 2) - 0.72) < 0.03)
            return s_.rail;
        if (is_line(s, d))
            return s_.paint;
        const Junction* j = road_.junction_at(s);
        if (j && j->opens(d > 0 ? 1 : -1))
            return s_.asphalt;
        if (a > c_.kerb() - 0.3)
            return s_.gutter;
        if (c_.parking > 0 && a > c_.lane + c_.cycle)
            return s_.bay;
        return c_.cycle > 0 && a > c_.lane ? s_.cycle : s_.asphalt;
    }

    double kerb_height(double s) const
    {
        double low = 1;
        for (const Crossing& c : crossings_)
            low = std::min(low, std::clamp(std::max(c.first - s, s - c.last) / 0.8, 0.0, 1.0));
        return kLowered + (c_.kerb_height - kLowered) * low;
    }

    void sidewalk(int side, double first, double last)
    {
        if (last - first < 0.1)
            return;
        std::vector<double> s, d;
        for (double x = std::floor(first / 2) * 2; x < last; x += 2)
            s.push_back(x);
        for (const Crossing& c : crossings_)
            s.insert(s.end(), {c.first - 0.8, c.first, c.last, c.last + 0.8});
        sort_cuts(s, first, last);
        const double k = c_.kerb(), f = c_.facade();
        for (double x : {k, k + 0.15, k + 1.1, f - 0.35, f})
            d.push_back(side * x);
        std::ranges::sort(d);
        const auto height = [&](double x, double y) {
            const double t = std::clamp((std::abs(y) - k) / 1.1, 0.0, 1.0);
            return kerb_height(x) + (c_.kerb_height - kerb_height(x)) * t;
        };
        const auto paint = [&](double, double y) {
            const double a = std::abs(y);
            return a < k + 0.15 ? s_.kerb : a > f - 0.35 ? s_.edge : s_.slabs;
        };
        for (size_t i = 0; i + 1 < s.size(); ++i) {
            row(s[i], s[i + 1], d, paint, height);
            const double a = side > 0 ? s[i] : s[i + 1], b = side > 0 ? s[i + 1] : s[i], y = side * k;
            mesh_.quad(s_.kerb, road_.at(a, y, 0), road_.at(b, y, 0), road_.at(b, y, kerb_height(b)),
                       road_.at(a, y, kerb_height(a)), a);
        }
    }

    void side_street(const Junction& j, int side)
    {
        const double k = c_.kerb(), end = c_.facade() + RoadNetwork::kSideReach, stop = c_.facade() + 0.6;
        std::vector<double> s{j.middle - kLine, j.middle + kLine}, d{k, stop, stop + 0.3};
        for (double x = k; x < end; x += 3)
            d.push_back(x);
        sort_cuts(s, j.middle - j.half, j.middle + j.half);
        sort_cuts(d, k, end);
        if (side < 0) {
            for (double& x : d)
                x = -x;
            std::ranges::reverse(d);
        }
        const auto paint = [&](double x, double y) {
            const double a = std::abs(y);
            const bool own_lane = side > 0 ? x < j.middle : x > j.middle;
            if (a > stop && a < stop + 0.3 && own_lane && std::abs(x - j.middle) > kLine)
                return s_.paint;
            const bool dash = a > stop && a - std::floor(a / 6) * 6 < 3;
            return dash && std::abs(x - j.middle) < kLine ? s_.paint : s_.asphalt;
        };
        const auto flat = [](double, double) { return 0.0; };
        for (size_t i = 0; i + 1 < s.size(); ++i)
            row(s[i], s[i + 1], d, paint, flat);
        for (int way : {-1, 1})
            corner(j, side, way);
        seam(j, side);
    }

    // the carriageway and the side street are cut at different places: where the street bends up or down, their common
    // edge gapes by a millimetre, which this strip below closes
    void seam(const Junction& j, int side)
    {
        const double a = side * (c_.kerb() - 0.1), b = side * (c_.kerb() + 0.1);
        std::vector<double> d{std::min(a, b), std::max(a, b)};
        const auto low = [](double, double) { return -0.005; };
        const auto paint = [this](double, double) { return s_.asphalt; };
        for (double s = j.first(); s < j.last() - 0.01; s += 2)
            row(s, std::min(s + 2, j.last()), d, paint, low);
    }

    // sidewalk along the side street and its rounded corner; way: -1 before, +1 behind the side street
    void corner(const Junction& j, int side, int way)
    {
        const double k = c_.kerb(), f = c_.facade(), end = f + RoadNetwork::kSideReach, h = c_.kerb_height;
        const double inner = j.middle + way * j.half, outer = inner + way * j.walk, r = j.corner();
        const auto p = [&](double s, double d, double up) { return road_.at(s, side * d, up); };
        std::vector<std::pair<double, double>> edge; // of the kerb, from the street into the side street
        edge.emplace_back(outer, k);
        for (int i = 0; i <= 6; ++i) {
            const double t = 3.14159265358979 / 2 * i / 6;
            edge.emplace_back(inner + way * r * (1 - std::sin(t)), k + r * (1 - std::cos(t)));
        }
        for (double x = k + r + 3; x < end; x += 3)
            edge.emplace_back(inner, x);
        edge.emplace_back(inner, end);
        const bool flip = (way > 0) == (side > 0); // seen from above, or from the road
        const auto face = [&](Finish finish, Vector3 a, Vector3 b, Vector3 c) {
            flip ? mesh_.polygon(finish, {a, c, b}) : mesh_.polygon(finish, {a, b, c});
        };
        for (size_t i = 0; i + 1 < edge.size(); ++i) {
            const auto [s0, d0] = edge[i];
            const auto [s1, d1] = edge[i + 1];
            face(s_.slabs, p(outer, d0, h), p(s0, d0, h), p(s1, d1, h));
            face(s_.slabs, p(outer, d0, h), p(s1, d1, h), p(outer, d1, h));
            const Vector3 a = p(s0, d0, 0), b = p(s1, d1, 0), c = p(s1, d1, h), d = p(s0, d0, h);
            flip ? mesh_.quad(s_.kerb, b, a, d, c) : mesh_.quad(s_.kerb, a, b, c, d);
            if (d1 <= k + r + 1e-9 && i > 0) // between the arc and the corner that it rounds
                face(s_.asphalt, p(inner, k, 0), p(s1, d1, 0), p(s0, d0, 0));
        }
    }

    MeshBuilder& mesh_;
    const RoadNetwork& road_;
    CrossSection c_;
    std::vector<Crossing> crossings_;
    Surfaces s_;
};

} // namespace

std::vector<Crossing> crossings_of(const RoadNetwork& road)
{
    std::vector<Crossing> all;
    for (const Junction& j : road.junctions()) {
        const double away = j.half + j.corner() + kBefore;
        all.push_back({j.middle - away - kCrossing, j.middle - away, &j, true});
        all.push_back({j.middle + away, j.middle + away + kCrossing, &j, false});
    }
    return all;
}

void add_road_surface(MeshBuilder& mesh, const RoadNetwork& road, uint64_t seed)
{
    Layer(mesh, road, seed).add();
}

} // namespace semrover
