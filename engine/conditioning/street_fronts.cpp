// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/conditioning/street_fronts.h"

#include "runtime/base/keyed_random.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <map>
#include <numbers>

namespace semrover {

namespace {

constexpr int kStreetReach = 6;     // columns from a wall to its street
constexpr int32_t kHeightStep = 2;  // voxels between the tops of two houses
constexpr double kNarrowest = 3.6;  // metres of a house
constexpr double kLongSplit = 1.6;  // widths that are still one house
constexpr double kLongSide = 1.2;   // depths that are still a side of a house
constexpr double kCutSpread = 0.15; // of a width, to either side
constexpr int kNoSide = -1;

struct WallColumn {
    std::vector<uint32_t> cells;
    double x = 0, y = 0; // towards the street, longer where it is nearer
    int side = kNoSide;  // which of four directions
    int row = -1;        // which group of one direction
};
using Wall = std::map<Column, WallColumn>;

template <typename Visit>
void each_neighbor(const Column& c, const Visit& visit)
{
    for (int n = 0; n < 9; ++n)
        if (n != 4)
            visit(Column{c[0] + n / 3 - 1, c[1] + n % 3 - 1});
}

void look_for_street(Wall& wall, const std::set<Column>& street)
{
    for (auto& [at, column] : wall)
        for (int di = -kStreetReach; di <= kStreetReach; ++di) {
            auto found = street.lower_bound({at[0] + di, at[1] - kStreetReach});
            for (; found != street.end() && (*found)[0] == at[0] + di && (*found)[1] <= at[1] + kStreetReach; ++found) {
                const double dj = (*found)[1] - at[1], squared = di * di + dj * dj;
                if (squared > 0 && squared <= kStreetReach * kStreetReach) {
                    column.x += di / squared;
                    column.y += dj / squared;
                }
            }
        }
}

// the angle of a cross whose arms the directions to the street follow best, or none without a street
std::optional<double> cross_of(const Wall& wall)
{
    double s = 0, c = 0;
    for (const auto& [at, column] : wall) {
        const double length = std::hypot(column.x, column.y), angle = std::atan2(column.y, column.x);
        s += length * std::sin(4 * angle);
        c += length * std::cos(4 * angle);
    }
    return s == 0 && c == 0 ? std::nullopt : std::optional(std::atan2(s, c) / 4);
}

// walls without a street of their own take the side of those they adjoin
void choose_sides(Wall& wall, double cross)
{
    std::deque<Column> front;
    for (auto& [at, column] : wall)
        if (column.x != 0 || column.y != 0) {
            const double turns = (std::atan2(column.y, column.x) - cross) * 2 / std::numbers::pi;
            column.side = (int(std::lround(turns)) + 4) % 4;
            front.push_back(at);
        }
    for (; !front.empty(); front.pop_front())
        each_neighbor(front.front(), [&](const Column& next) {
            const auto found = wall.find(next);
            if (found != wall.end() && found->second.side == kNoSide) {
                found->second.side = wall[front.front()].side;
                front.push_back(next);
            }
        });
}

struct Row {
    std::vector<Column> columns;
    int side = 0;
};

std::vector<Row> rows_of(Wall& wall)
{
    std::vector<Row> rows;
    for (auto& [at, column] : wall) {
        if (column.row >= 0 || column.side == kNoSide)
            continue;
        Row row{{at}, column.side};
        column.row = int(rows.size());
        for (size_t next = 0; next < row.columns.size(); ++next)
            each_neighbor(Column(row.columns[next]), [&](const Column& c) {
                const auto found = wall.find(c);
                if (found == wall.end() || found->second.row >= 0 || found->second.side != row.side)
                    return;
                found->second.row = int(rows.size());
                row.columns.push_back(c);
            });
        rows.push_back(std::move(row));
    }
    return rows;
}

// along the row, to the left of where it looks
double along(const Column& c, double heading)
{
    return c[1] * std::cos(heading) - c[0] * std::sin(heading);
}

double length_of(const Row& row, double heading)
{
    double low = INFINITY, high = -INFINITY;
    for (const Column& c : row.columns) {
        low = std::min(low, along(c, heading));
        high = std::max(high, along(c, heading));
    }
    return high - low + 1;
}

// a short side joins the longest row that it touches
void join_sides(std::vector<Row>& rows, Wall& wall, double cross, double longest_side)
{
    std::vector<double> lengths;
    for (const Row& row : rows)
        lengths.push_back(length_of(row, cross + row.side * std::numbers::pi / 2));
    for (size_t r = 0; r < rows.size(); ++r) {
        if (lengths[r] > longest_side)
            continue;
        int best = -1;
        for (const Column& c : rows[r].columns)
            each_neighbor(c, [&](const Column& next) {
                const auto found = wall.find(next);
                const int other = found == wall.end() ? -1 : found->second.row;
                if (other >= 0 && other != int(r) && lengths[size_t(other)] > lengths[r] &&
                    (best < 0 || lengths[size_t(other)] > lengths[size_t(best)]))
                    best = other;
            });
        if (best < 0)
            continue;
        for (const Column& c : rows[r].columns)
            wall[c].row = best;
        std::ranges::move(rows[r].columns, std::back_inserter(rows[size_t(best)].columns));
        rows[r].columns.clear();
    }
}

// heights along a row, a bin a voxel; a hole takes the height beside it, and what stands out alone is smoothed away
std::vector<int32_t> tops_of(const VoxelGrid& grid, const Wall& wall, const Row& row, double heading, double low)
{
    constexpr int32_t kNone = INT32_MIN;
    std::vector<int32_t> tops;
    for (const Column& c : row.columns) {
        const size_t bin = size_t(std::floor(along(c, heading) - low));
        tops.resize(std::max(tops.size(), bin + 1), kNone);
        for (uint32_t v : wall.at(c).cells)
            tops[bin] = std::max(tops[bin], grid.cells[v][2]);
    }
    for (size_t b = 1; b < tops.size(); ++b)
        if (tops[b] == kNone)
            tops[b] = tops[b - 1];
    const std::vector<int32_t> raw = tops;
    for (size_t b = 1; b + 1 < tops.size(); ++b)
        tops[b] = std::max(std::min(raw[b - 1], raw[b]), std::min(std::max(raw[b - 1], raw[b]), raw[b + 1]));
    return tops;
}

// where houses begin, in bins: 0 first
std::vector<double> cuts_of(std::span<const int32_t> tops, double narrowest, double width, KeyedRandom& random)
{
    std::vector<size_t> steps{0};
    for (size_t b = 1; b < tops.size(); ++b)
        if (std::abs(tops[b] - tops[b - 1]) >= kHeightStep && double(b - steps.back()) >= narrowest &&
            double(tops.size() - b) >= narrowest)
            steps.push_back(b);
    steps.push_back(tops.size());
    std::vector<double> cuts;
    for (size_t s = 0; s + 1 < steps.size(); ++s) {
        const double begin = double(steps[s]), length = double(steps[s + 1]) - begin;
        const int houses = length > kLongSplit * width ? int(std::lround(length / width)) : 1;
        for (int h = 0; h < houses; ++h) {
            const double off = h ? random.uniform(-kCutSpread, kCutSpread) : 0;
            cuts.push_back(begin + length * (h + off) / houses);
        }
    }
    return cuts;
}

// where most voxels lie along the heading, in voxels
double plane_of(const VoxelGrid& grid, std::span<const uint32_t> cells, double heading)
{
    std::map<int64_t, std::pair<size_t, double>> bins;
    for (uint32_t v : cells) {
        const Cell& c = grid.cells[v];
        const double at = (c[0] + 0.5) * std::cos(heading) + (c[1] + 0.5) * std::sin(heading);
        auto& [count, sum] = bins[int64_t(std::floor(at))];
        ++count;
        sum += at;
    }
    const auto most = std::ranges::max_element(bins, {}, [](const auto& bin) { return bin.second.first; });
    return most->second.second / double(most->second.first);
}

// width: voxels
std::vector<HouseFront> houses_of(const VoxelGrid& grid, const Wall& wall, const Row& row, double cross, double width,
                                  uint64_t seed)
{
    const double size = double(grid.voxel_size), heading = cross + row.side * std::numbers::pi / 2;
    double low = INFINITY;
    for (const Column& c : row.columns)
        low = std::min(low, along(c, heading));
    const auto [i, j] = *std::ranges::min_element(row.columns);
    KeyedRandom random(seed, {uint64_t(uint32_t(i)), uint64_t(uint32_t(j))});
    const std::vector<double> cuts = cuts_of(tops_of(grid, wall, row, heading, low), kNarrowest / size, width, random);
    std::vector<HouseFront> houses(cuts.size());
    for (const Column& c : row.columns) {
        const auto after = std::ranges::upper_bound(cuts, along(c, heading) - low);
        auto& house = houses[size_t(std::max<ptrdiff_t>(after - cuts.begin() - 1, 0))].cells;
        house.insert(house.end(), wall.at(c).cells.begin(), wall.at(c).cells.end());
    }
    std::erase_if(houses, [](const HouseFront& house) { return house.cells.empty(); });
    for (HouseFront& house : houses) {
        std::ranges::sort(house.cells);
        house.heading = heading;
        house.front = plane_of(grid, house.cells, heading) * size;
    }
    return houses;
}

} // namespace

std::set<Column> columns_of(const VoxelGrid& grid, std::initializer_list<uint8_t> labels)
{
    std::set<Column> columns;
    for (size_t v = 0; v < grid.cells.size(); ++v)
        if (std::ranges::find(labels, grid.labels[v]) != labels.end())
            columns.insert(columns.end(), {grid.cells[v][0], grid.cells[v][1]});
    return columns;
}

std::vector<HouseFront> street_fronts(const VoxelGrid& grid, std::span<const uint32_t> cells,
                                      const std::set<Column>& street, double width, double depth, uint64_t seed)
{
    const double size = double(grid.voxel_size);
    Wall wall;
    for (uint32_t v : cells)
        wall[{grid.cells[v][0], grid.cells[v][1]}].cells.push_back(v);
    look_for_street(wall, street);
    const std::optional<double> cross = cross_of(wall);
    if (!cross)
        return {};
    choose_sides(wall, *cross);
    std::vector<Row> rows = rows_of(wall);
    join_sides(rows, wall, *cross, kLongSide * depth / size);
    std::vector<HouseFront> houses;
    for (const Row& row : rows)
        if (!row.columns.empty())
            std::ranges::move(houses_of(grid, wall, row, *cross, width / size, seed), std::back_inserter(houses));
    return houses;
}

} // namespace semrover
