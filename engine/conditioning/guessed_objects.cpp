// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/conditioning/guessed_objects.h"

#include "engine/conditioning/cell_objects.h"
#include "engine/conditioning/object_blocks.h"
#include "engine/conditioning/street_fronts.h"
#include "runtime/base/keyed_random.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <ranges>

namespace semrover {

namespace {

// union-find over cell indices; the root is the lowest index of a group
class Groups {
  public:
    explicit Groups(size_t count) : parents_(count) { std::iota(parents_.begin(), parents_.end(), 0u); }

    uint32_t root(uint32_t cell)
    {
        while (parents_[cell] != cell)
            cell = parents_[cell] = parents_[parents_[cell]];
        return cell;
    }
    void join(uint32_t a, uint32_t b)
    {
        a = root(a);
        b = root(b);
        parents_[std::max(a, b)] = std::min(a, b);
    }

  private:
    std::vector<uint32_t> parents_;
};

// half of the 26 neighbours: the other half is met from the other side
template <typename Visit>
void each_earlier_neighbor(const Cell& c, const Visit& visit)
{
    for (int n = 0; n < 13; ++n)
        visit(Cell{c[0] + n / 9 - 1, c[1] + n / 3 % 3 - 1, c[2] + n % 3 - 1});
}

constexpr uint8_t kRoad = 0, kSidewalk = 1, kBuilding = 2, kFirstVehicle = 13, kLastVehicle = 18, kLaneMark = 19;
constexpr double kLowestHouse = 4;  // metres; what is lower is a kiosk or a shelter
constexpr double kThinnest = 0.3;   // metres of a box
constexpr double kUsuallyOne = 1.5; // usual lengths that are still one thing
constexpr double kFragment = 0.25;  // of usual sizes: of what is less in all three too little is seen to make an object
constexpr double kGap = 0.9;        // metres between things of a row
constexpr double kCutReach = 1;     // metres to either side of an even cut, where a better one is looked for
constexpr double kElongated = 1.3;  // length over width from which a box is turned
constexpr double kBlock = 32;       // metres, in which houses near a thing are looked for
constexpr double kParallel = 0.4;   // radians from a wall's direction, within which things are taken to stand along it
constexpr int kSidewalkReach = 8;   // voxels from a vehicle to the sidewalk that decides its front

using Cells = std::vector<uint32_t>;

struct Extent {
    double low = INFINITY, high = -INFINITY;

    void add(double x)
    {
        low = std::min(low, x);
        high = std::max(high, x);
    }
    double middle() const { return (low + high) / 2; }
    // of a surface that touches voxels between these centres: as often longer as shorter
    double length() const { return std::max(high - low, kThinnest); }
};

class Guess {
  public:
    Guess(const VoxelGrid& grid, const UsualObjects& usual, uint64_t seed)
        : grid_(grid), usual_(usual), seed_(seed), size_(double(grid.voxel_size)),
          street_(columns_of(grid, {kRoad, kSidewalk, kLaneMark})), sidewalk_(columns_of(grid, {kSidewalk}))
    {
    }

    Result<std::vector<SceneObject>> run()
    {
        const std::vector<Cells> groups = connected_groups(grid_);
        std::vector<bool> done(groups.size());
        for (size_t g = 0; g < groups.size(); ++g)
            done[g] = usual_for(groups[g]) && label_ == kBuilding && add_houses(groups[g]);
        SR_TRY(const std::vector<int32_t> houses, objects_of_cells(grid_, objects_));
        for (size_t o = 0; o < objects_.size(); ++o)
            walls_[block_of(objects_[o].center)].push_back(o);
        // what is seen of a roof or a yard belongs to the house around it
        const auto in_a_house = [&](uint32_t v) { return houses[v] != kNoObject; };
        for (size_t g = 0; g < groups.size(); ++g)
            if (!done[g] && usual_for(groups[g]) && !std::ranges::all_of(groups[g], in_a_house))
                add_row(groups[g]);
        add_ground();
        std::ranges::for_each(parts_, [&](const SceneObject& part) { keep(part); });
        return std::move(objects_);
    }

  private:
    bool usual_for(const Cells& group)
    {
        label_ = grid_.labels[group[0]];
        return usual_[label_].known() && !is_ground(label_);
    }
    std::array<double, 3> place(uint32_t v, double heading) const // along the heading, across it, up
    {
        const Cell& c = grid_.cells[v];
        const double x = (c[0] + 0.5) * size_, y = (c[1] + 0.5) * size_;
        return {x * std::cos(heading) + y * std::sin(heading), y * std::cos(heading) - x * std::sin(heading),
                (c[2] + 0.5) * size_};
    }
    std::array<Extent, 3> extents(const Cells& cells, double heading) const
    {
        std::array<Extent, 3> e;
        for (uint32_t v : cells)
            for (size_t a = 0; a < 3; ++a)
                e[a].add(place(v, heading)[a]);
        return e;
    }

    bool add_houses(const Cells& group)
    {
        const std::array<double, 3>& usual = usual_[label_].size;
        const Extent height = extents(group, 0)[2];
        if (height.high - height.low < kLowestHouse)
            return false;
        const auto houses = street_fronts(grid_, group, street_, usual[1], usual[0], seed_);
        for (const HouseFront& house : houses) {
            std::array<Extent, 3> e = extents(house.cells, house.heading);
            e[0] = {std::min(e[0].low, house.front - usual[0]), house.front};
            add(house.cells, e, house.heading);
            if (const auto& parts = usual_[label_].parts)
                std::ranges::copy(front_parts(grid_, house, *parts, seed_), std::back_inserter(parts_));
        }
        return !houses.empty();
    }

    static Column block_of(const std::array<double, 3>& point)
    {
        return {int32_t(std::floor(point[0] / kBlock)), int32_t(std::floor(point[1] / kBlock))};
    }

    // the direction of the nearest house's walls that is nearest to `angle`, or `angle` where none is near it
    double along_walls(double angle, const Cells& cells) const
    {
        const auto e = extents(cells, 0);
        const std::array<double, 3> at = {e[0].middle(), e[1].middle(), 0};
        double least = INFINITY, off = INFINITY;
        for (int n = 0; n < 9; ++n) {
            const Column block = block_of(at);
            const auto found = walls_.find({block[0] + n / 3 - 1, block[1] + n % 3 - 1});
            if (found == walls_.end())
                continue;
            for (size_t o : found->second) {
                const double apart = std::hypot(objects_[o].center[0] - at[0], objects_[o].center[1] - at[1]);
                if (apart < least) {
                    least = apart;
                    off = std::remainder(objects_[o].heading - angle, std::numbers::pi / 2);
                }
            }
        }
        return std::abs(off) < kParallel ? angle + off : angle;
    }

    void add_row(const Cells& group)
    {
        const double heading = along_walls(axis_of(group), group);
        for (const Cells& part : cut(group, heading, 0))
            for (const Cells& thing : cut(part, heading, 1)) {
                const double front =
                    label_ >= kFirstVehicle && label_ <= kLastVehicle ? front_of(thing, heading) : heading;
                const auto e = extents(thing, front);
                if (!is_fragment(e))
                    add(thing, e, front);
            }
    }

    bool is_fragment(const std::array<Extent, 3>& e) const
    {
        const std::array<double, 3>& usual = usual_[label_].size;
        return std::ranges::all_of(std::views::iota(0u, 3u),
                                   [&](size_t a) { return e[a].length() < kFragment * usual[a]; });
    }

    // along which voxels are spread most, seen from above; 0 where that is hardly more than across
    double axis_of(const Cells& cells) const
    {
        double x = 0, y = 0, xx = 0, xy = 0, yy = 0;
        for (uint32_t v : cells) {
            x += grid_.cells[v][0];
            y += grid_.cells[v][1];
        }
        x /= double(cells.size());
        y /= double(cells.size());
        for (uint32_t v : cells) {
            const double dx = grid_.cells[v][0] - x, dy = grid_.cells[v][1] - y;
            xx += dx * dx;
            xy += dx * dy;
            yy += dy * dy;
        }
        const double angle = std::atan2(2 * xy, xx - yy) / 2;
        const auto e = extents(cells, angle);
        return e[0].length() >= kElongated * e[1].length() ? angle : 0;
    }

    // pieces of usual length along an axis, cut where fewest voxels are
    std::vector<Cells> cut(const Cells& cells, double heading, size_t axis) const
    {
        const double usual = usual_[label_].size[axis];
        const Extent e = extents(cells, heading)[axis];
        const double length = e.high - e.low;
        if (length <= kUsuallyOne * std::max(usual, size_))
            return {cells};
        const int count = std::max(1, int(std::lround((length + kGap) / (std::max(usual, size_) + kGap))));
        std::vector<size_t> filled(size_t(length / size_) + 2);
        for (uint32_t v : cells)
            ++filled[size_t((place(v, heading)[axis] - e.low) / size_)];
        std::vector<double> cuts;
        for (int n = 1; n < count; ++n)
            cuts.push_back(emptiest(filled, length * n / count));
        std::vector<Cells> pieces(cuts.size() + 1);
        for (uint32_t v : cells) {
            const auto after = std::ranges::upper_bound(cuts, place(v, heading)[axis] - e.low);
            pieces[size_t(after - cuts.begin())].push_back(v);
        }
        std::erase_if(pieces, [](const Cells& piece) { return piece.empty(); });
        return pieces;
    }

    // metres from the first voxel; of equals the nearest to `at`
    double emptiest(std::span<const size_t> filled, double at) const
    {
        const ptrdiff_t middle = ptrdiff_t(at / size_), reach = ptrdiff_t(kCutReach / size_);
        ptrdiff_t best = middle;
        for (ptrdiff_t off = 1; off <= reach; ++off)
            for (ptrdiff_t b : {middle - off, middle + off})
                if (b > 0 && b < ptrdiff_t(filled.size()) && filled[size_t(b)] < filled[size_t(best)])
                    best = b;
        return (double(best) + 0.5) * size_;
    }

    // vehicles stand with the sidewalk to their right
    double front_of(const Cells& cells, double heading) const
    {
        const auto e = extents(cells, 0);
        const Column at = {int32_t(std::floor(e[0].middle() / size_)), int32_t(std::floor(e[1].middle() / size_))};
        double left = 0;
        for (int di = -kSidewalkReach; di <= kSidewalkReach; ++di)
            for (int dj = -kSidewalkReach; dj <= kSidewalkReach; ++dj)
                if (sidewalk_.contains({at[0] + di, at[1] + dj}))
                    left += dj * std::cos(heading) - di * std::sin(heading);
        return left > 0 ? heading + (heading > 0 ? -1 : 1) * std::numbers::pi : heading;
    }

    // of a class one colour, in squares of the world's own: wherever a guess begins, it has the same
    void add_ground()
    {
        const int32_t edge = object_block_cells(grid_.voxel_size);
        std::map<std::pair<uint8_t, TileIndex>, Extent> heights;
        for (uint32_t v = 0; v < grid_.cells.size(); ++v)
            if (const uint8_t label = grid_.labels[v]; is_ground(label) && !usual_[label].tints.empty())
                heights[{label, tile_of(grid_.cells[v], edge)}].add((grid_.cells[v][2] + 0.5) * size_);
        for (const auto& [of, height] : heights) {
            const auto& [label, square] = of;
            SceneObject o{.label = label};
            o.center = {(square[0] + 0.5) * edge * size_, (square[1] + 0.5) * edge * size_, height.middle()};
            o.size = {edge * size_, edge * size_, height.length()};
            o.tint = drawn_tint(label, {seed_, {label}});
            keep(o);
        }
    }

    std::array<double, 3> drawn_tint(uint8_t label, KeyedRandom random) const
    {
        const auto& tints = usual_[label].tints;
        return tints[random.below(uint32_t(tints.size()))];
    }

    void add(const Cells& cells, const std::array<Extent, 3>& e, double heading)
    {
        SceneObject o{.label = label_, .heading = heading};
        const double c = std::cos(heading), s = std::sin(heading), u = e[0].middle(), v = e[1].middle();
        o.center = {c * u - s * v, s * u + c * v, e[2].middle()};
        o.size = {e[0].length(), e[1].length(), e[2].length()};
        if (!usual_[label_].tints.empty()) {
            const Cell& lowest = grid_.cells[cells[0]];
            o.tint =
                drawn_tint(label_, {seed_, {label_, uint32_t(lowest[0]), uint32_t(lowest[1]), uint32_t(lowest[2])}});
        }
        keep(o);
    }

    void keep(SceneObject o)
    {
        o.id = uint32_t(objects_.size());
        if (objects_.size() < kMaxObjects)
            objects_.push_back(o);
    }

    const VoxelGrid& grid_;
    const UsualObjects& usual_;
    const uint64_t seed_;
    const double size_;
    const std::set<Column> street_, sidewalk_;
    uint8_t label_ = 0;
    std::vector<SceneObject> objects_;            // houses first
    std::vector<SceneObject> parts_;              // of houses
    std::map<Column, std::vector<size_t>> walls_; // houses by where they are
};

} // namespace

std::vector<std::vector<uint32_t>> connected_groups(const VoxelGrid& grid)
{
    Groups groups(grid.cells.size());
    for (uint32_t v = 0; v < grid.cells.size(); ++v)
        each_earlier_neighbor(grid.cells[v], [&](const Cell& neighbor) {
            const auto found = find_cell(grid, neighbor);
            if (found && grid.labels[*found] == grid.labels[v])
                groups.join(v, uint32_t(*found));
        });
    std::vector<std::vector<uint32_t>> cells;
    std::vector<uint32_t> numbers(grid.cells.size());
    for (uint32_t v = 0; v < grid.cells.size(); ++v) {
        const uint32_t root = groups.root(v);
        if (root == v) {
            numbers[v] = uint32_t(cells.size());
            cells.emplace_back();
        }
        cells[numbers[root]].push_back(v);
    }
    return cells;
}

Result<std::vector<SceneObject>> guess_objects(const VoxelGrid& grid, const UsualObjects& usual, uint64_t seed)
{
    return Guess(grid, usual, seed).run();
}

} // namespace semrover
