// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/streets/vector3.h"

#include <cstdint>
#include <vector>

namespace semrover {

// Widths across the street, the same on both sides, all along it; metres
struct CrossSection {
    double lane = 3.2;    // one in each direction
    double cycle = 0;     // cycle lane, 0: none
    double parking = 2.1; // bay, 0: none
    double sidewalk = 3.2;
    double kerb_height = 0.13;
    bool rails = false; // a tram runs in the lanes
    bool red_cycle_lane = false;

    double kerb() const { return lane + cycle + parking; } // from the middle
    double facade() const { return kerb() + sidewalk; }
};

// where a side street joins, on one side (T) or both
struct Junction {
    double middle = 0; // along the street
    double half = 3.2; // half the width of the side street's carriageway
    double walk = 2.4; // width of its sidewalks
    bool left = true, right = true;
    bool lights = false;
    uint32_t index = 0;

    double corner() const { return 2.0; }                 // radius of the kerb
    double first() const { return middle - half - walk; } // where the sidewalks of the street end
    double last() const { return middle + half + walk; }
    bool opens(int side) const { return side > 0 ? left : right; } // side: +1 left, -1 right
};

// the houses between two junctions
struct Block {
    double first = 0, last = 0;
    uint32_t index = 0;
};

// A street of any length: a centre line of straight parts and curves whose curvature grows and falls linearly (as
// clothoids do), gently up and down, with junctions in straight parts. What lies before a place depends on the seed
// and what came before only, so a longer street begins like a shorter one.
class RoadNetwork {
  public:
    RoadNetwork(uint64_t seed, double length);

    static constexpr double kSideReach = 42; // of side streets, from the facades

    // s along the centre line, d to the left of it, h above the road
    Vector3 at(double s, double d, double h = 0) const;
    double heading(double s) const;
    Frame frame(double s, double d, double h = 0) const; // upright, x along the street

    double length() const { return length_; }
    const CrossSection& section() const { return section_; }
    const std::vector<Block>& blocks() const { return blocks_; }          // the last may end beyond the street
    const std::vector<Junction>& junctions() const { return junctions_; } // whole ones only
    // the junction whose opening, less `margin`, holds s; null: none
    const Junction* junction_at(double s, double margin = 0) const;

  private:
    struct Knot {
        double x, y, z, heading;
    };
    void lay_out(uint64_t seed);
    void integrate(uint64_t seed);

    double length_;
    CrossSection section_;
    std::vector<Block> blocks_;
    std::vector<Junction> junctions_;
    std::vector<double> curvature_; // of the middle of each block, 1/m
    std::vector<Knot> knots_;       // every half metre
};

} // namespace semrover
