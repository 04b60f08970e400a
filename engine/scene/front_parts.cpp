// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/scene/front_parts.h"

#include "runtime/base/keyed_random.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

constexpr double kNearFront = 0.9;  // metres from where most cells of the front lie; balconies stand out further
constexpr double kFilled = 0.75;    // of the squares that a part covers, at least
constexpr double kUnderEaves = 0.3; // metres of wall above the highest part

using Square = std::array<int32_t, 2>; // column, row

// the front's cells as squares of a picture: columns across the heading, rows up
class Front {
  public:
    Front(const VoxelGrid& grid, const HouseFront& house)
        : size_(double(grid.voxel_size)), cosine_(std::cos(house.heading)), sine_(std::sin(house.heading))
    {
        for (const uint32_t v : house.cells) {
            const Cell& c = grid.cells[v];
            const double x = (c[0] + 0.5) * size_, y = (c[1] + 0.5) * size_, z = (c[2] + 0.5) * size_;
            if (std::abs(x * cosine_ + y * sine_ - house.front) > kNearFront)
                continue;
            const double across = y * cosine_ - x * sine_;
            squares_.insert(square(across, z));
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
                filled += squares_.contains({i, k});
        return filled >= kFilled * all;
    }
    std::array<double, 3> point(double along, double across, double up) const
    {
        return {cosine_ * along - sine_ * across, sine_ * along + cosine_ * across, up};
    }

    double left = INFINITY, right = -INFINITY, bottom = INFINITY, top = -INFINITY; // metres

  private:
    Square square(double across, double up) const
    {
        return {int32_t(std::floor(across / size_)), int32_t(std::floor(up / size_))};
    }

    const double size_, cosine_, sine_;
    std::set<Square> squares_;
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
    const double length = std::max(front.right - front.left, 0.0);
    const int columns = std::max(1, int(std::lround(length / across)));
    std::vector<SceneObject> parts;
    for (double z = front.bottom + usual.low; z + height + kUnderEaves <= front.top; z += up)
        for (int i = 0; i < columns; ++i) {
            const double at = front.left + length * (i + 0.5) / columns, middle = z + height / 2;
            const uint32_t drawn = random.below(uint32_t(std::max<size_t>(usual.tints.size(), 1)));
            if (!front.has(at, middle, width, height))
                continue;
            SceneObject part{.label = label, .size = {usual.size[0], width, height}, .heading = house.heading};
            part.center = front.point(house.front, at, middle);
            if (!usual.tints.empty())
                part.tint = usual.tints[drawn];
            part.part = true;
            parts.push_back(part);
        }
    return parts;
}

} // namespace semrover
