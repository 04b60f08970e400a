// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/rigid.h"
#include "runtime/base/file.h"
#include "runtime/base/json.h"

#include <cstdint>
#include <string>
#include <vector>

namespace semrover {

// a laser of a lidar; it fires in the columns whose number `every` divides
struct LidarBeam {
    double elevation = 0; // radians above the horizon
    double azimuth = 0; // of its rays, clockwise from their column's, radians; with what the lidar turns until it fires
    double delay = 0;   // of its firing after the column begins, microseconds
    uint32_t every = 1;
};

// A lidar that turns about its z axis and sends all rays from one point. Its axes: x forward, y left, z up. A sweep is
// one turn, of columns that follow each other in equal times.
struct Lidar {
    uint32_t columns = 0;
    double rate = 0;                  // turns a second
    bool clockwise = true;            // seen from above
    double start = 0;                 // azimuth of column 0, radians, clockwise from x
    double nearest = 0, farthest = 0; // metres that it measures
    double farthest_at_tenth = 0;     // of a surface that reflects a tenth, at right angles
    bool first_ring_on_top = true;
    std::vector<LidarBeam> beams; // by falling elevation
    Json table = {};              // that it was read from

    double step() const; // from a column to the next, radians clockwise
    double sweep_seconds() const { return 1 / rate; }
    double column_microseconds() const { return 1e6 / rate / columns; }
    double firing_microseconds(uint32_t beam, uint32_t column) const; // after the sweep begins
    uint32_t ring(uint32_t beam) const;
    Point3 ray(uint32_t beam, uint32_t column) const; // unit, in the sensor's axes
};

// Of a file, or `name` of assets/lidar, which are compiled in:
//   {"columns": 3600, "rate": 10,                of a sweep, at most 65535; turns a second
//    "direction": "clockwise" | "counterclockwise",          seen from above; default "clockwise"
//    "start": 180,                               azimuth of column 0, degrees clockwise from straight ahead; default
//    "range": [0.3, 230],                        metres
//    "range_at_10_percent": 200,                 metres; default the farthest
//    "first_ring": "top" | "bottom",             default "top"
//    "elevations": [14.985, ...],                of 1 to 1024 beams, degrees, falling
//    "azimuths": [0.186, ...],                   degrees clockwise from the column's; default 0
//    "times": [46.645, ...],                     microseconds after a column begins; default 0
//    "every": [2, ...]}                          a beam fires every so many columns; default 1
// and "comment". Unknown keys are refused. bad_input, with the file in front
Result<Lidar> read_lidar(const Path& path);
Result<Lidar> named_lidar(std::string_view name);
Result<Lidar> parse_lidar(const Json& table, std::string_view where);

// A sweep as a picture: a row a beam, from the top. Pixel x of row i holds what beam i fires in column x + first -
// shift(i), so that a column of pixels looks into almost one direction: column x + first's, and rest(i) from there.
struct SweepPicture {
    explicit SweepPicture(const Lidar& lidar);

    int first = 0;      // smallest shift
    uint32_t width = 0; // pixels, more than columns where shifts differ
    std::vector<int> shifts;
    std::vector<double> rests; // radians clockwise, at most half a column
};

} // namespace semrover
