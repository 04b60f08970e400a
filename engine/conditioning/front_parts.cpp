// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/conditioning/street_fronts.h"

#include "runtime/base/keyed_random.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

constexpr double kNearFront = 0.9;    // metres from where most voxels of the front lie
constexpr double kBalconyReach = 2.4; // metres from there, beyond which nothing is a balcony
constexpr double kGroundFloor = 2.4;  // metres above the ground, below which nothing is one
constexpr double kWidestBalcony = 6, kHighestBalcony = 2.4;
constexpr double kSill = 0.9;       // metres from a balcony's floor to the lower edge of windows beside it
constexpr double kThreshold = 0.1;  // of the door behind it
constexpr double kFilled = 0.75;    // of the squares that a part covers, at least
constexpr double kUnderEaves = 0.3; // metres of wall above the highest part

using Square = std::array<int32_t, 2>; // column, row

struct Balcony {
    double left, right, floor; // metres across and up

    double middle() const { return (left + right) / 2; }
};

// the voxels of a front as squares of a picture: columns across the heading, rows up
class Front {
  public:
    Front(const VoxelGrid& grid, const HouseFront& house)
        : size_(double(grid.voxel_size)), cosine_(std::cos(house.heading)), sine_(std::sin(house.heading))
    {
        for (const uint32_t v : house.cells) {
            const Cell& c = grid.cells[v];
            const double x = (c[0] + 0.5) * size_, y = (c[1] + 0.5) * size_, z = (c[2] + 0.5) * size_;
            const double out = x * cosine_ + y * sine_ - house.front, across = y * cosine_ - x * sine_;
            if (out > kNearFront && out < kBalconyReach)
                outside_.insert(square(across, z));
            if (std::abs(out) > kNearFront)
                continue;
            wall_.insert(square(across, z));
            left = std::min(left, across - size_ / 2);
            right = std::max(right, across + size_ / 2);
            bottom = std::min(bottom, z);
            top = std::max(top, z);
        }
    }

    bool has(double across, double up, double width, double height) const
    {
        const Square low = square(across - width / 2, up - height / 2),
                     high = square(across + width / 2, up + height / 2);
        int filled = 0, all = 0;
        for (int32_t i = low[0]; i <= high[0]; ++i)
            for (int32_t k = low[1]; k <= high[1]; ++k, ++all)
                filled += wall_.contains({i, k});
        return filled >= kFilled * all;
    }
    std::array<double, 3> point(double along, double across, double up) const
    {
        return {cosine_ * along - sine_ * across, sine_ * along + cosine_ * across, up};
    }

    // connected squares that stand out, from the lowest column on
    std::vector<Balcony> balconies() const
    {
        std::vector<Balcony> found;
        std::set<Square> left_over = outside_;
        while (!left_over.empty()) {
            Square low = *left_over.begin(), high = low;
            std::vector<Square> group{low};
            left_over.erase(left_over.begin());
            for (size_t n = 0; n < group.size(); ++n)
                for (const Square& step : {Square{1, 0}, {-1, 0}, {0, 1}, {0, -1}})
                    if (const auto next = left_over.find({group[n][0] + step[0], group[n][1] + step[1]});
                        next != left_over.end()) {
                        group.push_back(*next);
                        left_over.erase(next);
                    }
            for (const Square& s : group)
                for (size_t a : {0, 1}) {
                    low[a] = std::min(low[a], s[a]);
                    high[a] = std::max(high[a], s[a]);
                }
            const Balcony b{low[0] * size_, (high[0] + 1) * size_, (low[1] + 0.5) * size_};
            if (b.floor > bottom + kGroundFloor && b.right - b.left <= kWidestBalcony &&
                (high[1] - low[1] + 1) * size_ <= kHighestBalcony)
                found.push_back(b);
        }
        return found;
    }

    double left = INFINITY, right = -INFINITY, bottom = INFINITY, top = -INFINITY; // metres

  private:
    Square square(double across, double up) const
    {
        return {int32_t(std::floor(across / size_)), int32_t(std::floor(up / size_))};
    }

    const double size_, cosine_, sine_;
    std::set<Square> wall_, outside_;
};

// evenly spaced places: first + n pitch
struct Raster {
    double first, pitch;

    // through the lowest and the highest of some places, about `usual` apart, not below `least`
    static Raster through(const std::vector<double>& places, double usual, double least)
    {
        const auto [low, high] = std::ranges::minmax(places);
        const double steps = std::round((high - low) / usual), pitch = steps > 0 ? (high - low) / steps : usual;
        return {low - std::floor((low - least) / pitch) * pitch, pitch};
    }
};

} // namespace

std::vector<SceneObject> front_parts(const VoxelGrid& grid, const HouseFront& house, const UsualParts& usual,
                                     uint64_t seed)
{
    const uint8_t label = grid.labels[house.cells[0]];
    const Cell& lowest = grid.cells[house.cells[0]];
    KeyedRandom random(seed, {label, uint32_t(lowest[0]), uint32_t(lowest[1]), uint32_t(lowest[2]), 1});
    const auto varied = [&](double metres) { return metres * random.uniform(1 - kPartsVary, 1 + kPartsVary); };
    const double across = varied(usual.pitch[0]), up = varied(usual.pitch[1]);
    const double width = varied(usual.size[1]), height = varied(usual.size[2]);
    const Front front(grid, house);
    const double length = front.right - front.left, count = std::max(1.0, std::round(length / across));
    Raster columns{front.left + length / count / 2, length / count}, rows{front.bottom + usual.low, up};
    const std::vector<Balcony> balconies = front.balconies();
    if (!balconies.empty()) {
        std::vector<double> middles, sills;
        for (const Balcony& b : balconies) {
            middles.push_back(b.middle());
            sills.push_back(b.floor + kSill);
        }
        columns = Raster::through(middles, across, front.left + width / 2);
        rows = Raster::through(sills, up, front.bottom + usual.low - up / 4);
    }
    std::vector<SceneObject> parts;
    for (double sill = rows.first; sill + height + kUnderEaves <= front.top; sill += rows.pitch)
        for (double at = columns.first; at + width / 2 <= front.right; at += columns.pitch) {
            const bool door = std::ranges::any_of(balconies, [&](const Balcony& b) {
                return at > b.left && at < b.right && std::abs(b.floor + kSill - sill) < rows.pitch / 4;
            });
            const double low = door ? sill - kSill + kThreshold : sill, middle = (low + sill + height) / 2;
            const uint32_t drawn = random.below(uint32_t(std::max<size_t>(usual.tints.size(), 1)));
            SceneObject part{.label = label, .heading = house.heading};
            part.center = front.point(house.front, at, middle);
            part.size = {usual.size[0], width, sill + height - low};
            if (!front.has(at, middle, width, part.size[2]))
                continue;
            if (!usual.tints.empty())
                part.tint = usual.tints[drawn];
            part.part = true;
            parts.push_back(part);
        }
    return parts;
}

} // namespace semrover
