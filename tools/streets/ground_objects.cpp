// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/streets/ground_objects.h"

#include "engine/conditioning/cell_objects.h"
#include "engine/scene/palette.h"
#include "tools/streets/class_label.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace semrover {

namespace {

constexpr double kPiece = 10;     // metres, about
constexpr double kShortest = 0.1; // metres between two ends that make a piece
constexpr double kHigh = 3;       // of a box, with the surface in its middle: more than the street rises along a piece

class Pieces {
  public:
    Pieces(const RoadNetwork& road, std::vector<SceneObject>& objects)
        : road_(road), c_(road.section()), objects_(objects)
    {
    }

    void add()
    {
        const std::vector<double> cuts = cuts_along();
        for (size_t i = 0; i + 1 < cuts.size(); ++i)
            across(cuts[i], cuts[i + 1]);
        for (const Junction& j : road_.junctions())
            for (int side : {1, -1})
                if (j.opens(side))
                    side_street(j, side);
    }

  private:
    // where junctions begin and end, and evenly between
    std::vector<double> cuts_along() const
    {
        std::vector<double> ends{0, road_.length()}, cuts{0};
        for (const Junction& j : road_.junctions())
            ends.insert(ends.end(), {j.first(), j.middle - j.half, j.middle + j.half, j.last()});
        std::ranges::sort(ends);
        for (size_t i = 0; i + 1 < ends.size(); ++i) {
            const double length = ends[i + 1] - ends[i];
            if (length < kShortest)
                continue;
            const int count = std::max(1, int(std::lround(length / kPiece)));
            for (int n = 1; n <= count; ++n)
                cuts.push_back(ends[i] + length * n / count);
        }
        return cuts;
    }

    void across(double s0, double s1)
    {
        const double s = (s0 + s1) / 2, bays = c_.lane + c_.cycle;
        double asphalt[] = {c_.lane, c_.lane}; // to the left and to the right
        for (int side : {1, -1}) {
            const auto strip = [&](uint8_t label, double from, double to) {
                if (to - from > 0)
                    add(label, s0, s1, side * from, side * to);
            };
            const Junction* j = road_.junction_at(s);
            if (j && j->opens(side)) {
                asphalt[side < 0] = c_.kerb();
            } else {
                strip(label::kRoad, c_.lane, bays);
                strip(label::kRoad, bays, c_.kerb());
                strip(label::kSidewalk, c_.kerb(), c_.facade());
            }
        }
        add(label::kRoad, s0, s1, -asphalt[1], asphalt[0]);
    }

    void side_street(const Junction& j, int side)
    {
        const double from = c_.kerb(), to = c_.facade() + RoadNetwork::kSideReach;
        const int count = int(std::lround((to - from) / kPiece));
        for (int n = 0; n < count; ++n) {
            const double d0 = from + (to - from) * n / count, d1 = from + (to - from) * (n + 1) / count;
            add(label::kRoad, j.middle - j.half, j.middle + j.half, side * d0, side * d1);
            add(label::kSidewalk, j.first(), j.middle - j.half, side * d0, side * d1);
            add(label::kSidewalk, j.middle + j.half, j.last(), side * d0, side * d1);
        }
    }

    // between s0 and s1 along the street, d0 and d1 to the left of it
    void add(uint8_t label, double s0, double s1, double d0, double d1)
    {
        const double s = (s0 + s1) / 2;
        const Vector3 middle = road_.at(s, (d0 + d1) / 2);
        objects_.push_back({.id = uint32_t(objects_.size()),
                            .label = label,
                            .center = {middle.x, middle.y, middle.z},
                            .size = {s1 - s0, std::abs(d1 - d0), kHigh},
                            .heading = road_.heading(s)});
    }

    const RoadNetwork& road_;
    const CrossSection& c_;
    std::vector<SceneObject>& objects_;
};

struct GroundPiece {
    const SceneObject* object;
    Rigid from_world;

    double depth(const Point3& point) const // below the nearest face, along the axes
    {
        const Point3 p = transform(from_world, point);
        double least = object->size[0] / 2 - std::abs(p[0]);
        for (size_t a = 1; a < 3; ++a)
            least = std::min(least, object->size[a] / 2 - std::abs(p[a]));
        return least;
    }
};

uint32_t number_of(const std::vector<GroundPiece>& pieces, const Point3& point)
{
    uint32_t number = 0;
    double deepest = -kObjectReach;
    for (const GroundPiece& piece : pieces)
        if (const double depth = piece.depth(point); depth > deepest) {
            deepest = depth;
            number = piece.object->id + 1;
        }
    return number;
}

} // namespace

void number_ground(TracedImage& image, const CameraFrame& frame, std::span<const SceneObject> objects)
{
    const Rigid to_world = frame.pose.camera_to_world();
    const Point3 eye = translation_of(to_world);
    double farthest = 0;
    for (const float depth : image.depth)
        farthest = std::max(farthest, double(depth));
    const Intrinsics& k = frame.intrinsics;
    const double wide = std::hypot(1, k.width / k.fx, k.height / k.fy); // of the ray through a corner, at most
    std::map<uint8_t, std::vector<GroundPiece>> pieces;                 // that may be seen
    for (const SceneObject& o : objects)
        if (is_ground(o.label) && std::hypot(o.center[0] - eye[0], o.center[1] - eye[1]) < farthest * wide + 2 * kPiece)
            pieces[o.label].push_back({&o, inverse(box_to_world(o))});
    for (size_t i = 0; i < image.label.size(); ++i) {
        const auto ground = pieces.find(image.label[i]);
        if (image.instance[i] != 0 || ground == pieces.end())
            continue;
        const double z = double(image.depth[i]);
        const Point3 seen = {(double(i % image.width) + 0.5 - k.cx) / k.fx * z,
                             (double(i / image.width) + 0.5 - k.cy) / k.fy * z, z};
        image.instance[i] = number_of(ground->second, transform(to_world, seen));
    }
}

void add_ground_objects(const RoadNetwork& road, std::vector<SceneObject>& objects)
{
    Pieces(road, objects).add();
}

} // namespace semrover
