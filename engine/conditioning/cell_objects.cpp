// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/conditioning/cell_objects.h"

#include "engine/scene/scene_fields.h"

#include "runtime/base/dtype.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace semrover {

namespace {

// an object with its heading's cosine and sine, which many voxels need
struct Turned {
    const SceneObject& object;
    double reach = 0; // metres by which the box is widened
    double cosine = std::cos(object.heading), sine = std::sin(object.heading);

    std::array<double, 3> place(const std::array<double, 3>& point) const
    {
        const double x = point[0] - object.center[0], y = point[1] - object.center[1];
        return {cosine * x + sine * y, cosine * y - sine * x, point[2] - object.center[2]};
    }
    double depth(const std::array<double, 3>& point) const
    {
        const std::array<double, 3> p = place(point);
        double depth = std::numeric_limits<double>::infinity();
        for (size_t a = 0; a < 3; ++a)
            depth = std::min(depth, object.size[a] / 2 - std::abs(p[a]));
        return depth;
    }
    // of the widened box, along the world's axis 0 or 1: from, to
    std::pair<double, double> extent(size_t axis) const
    {
        const double ahead = object.size[0] / 2 + reach, aside = object.size[1] / 2 + reach;
        const double half = axis == 0 ? std::abs(cosine) * ahead + std::abs(sine) * aside
                                      : std::abs(sine) * ahead + std::abs(cosine) * aside;
        return {object.center[axis] - half, object.center[axis] + half};
    }
};

// the voxels of one class, in the grid's order, cut into slices of equal i
struct ClassCells {
    struct Slice {
        int32_t i;
        size_t first; // of `cells`
    };
    std::vector<uint32_t> cells; // of the grid
    std::vector<Slice> slices;

    void add(uint32_t cell, int32_t i)
    {
        if (slices.empty() || slices.back().i != i)
            slices.push_back({i, cells.size()});
        cells.push_back(cell);
    }
    size_t end_of(size_t slice) const { return slice + 1 < slices.size() ? slices[slice + 1].first : cells.size(); }
};

// of sorted items those whose coordinate, a number of voxels, may be between the ends of the extent
template <typename Items, typename Coordinate>
auto between(const Items& items, std::pair<double, double> extent, double size, const Coordinate& coordinate)
{
    const auto real = [&](const auto& item) { return double(coordinate(item)); };
    const auto first = std::ranges::lower_bound(items, std::floor(extent.first / size), {}, real);
    const auto last = std::ranges::upper_bound(items, std::floor(extent.second / size), {}, real);
    return std::ranges::subrange(first, std::max(first, last));
}

class OwnerSearch {
  public:
    // by_points: of each point of a voxel, else of its centre
    OwnerSearch(const VoxelGrid& grid, bool by_points, double reach, uint64_t most)
        : grid_(grid), places_(by_points ? size_t(grid.points_per_voxel) : 1), by_points_(by_points),
          owners_(grid.cells.size() * places_, kNoObject), depths_(owners_.size(), -reach), reach_(reach), most_(most)
    {
        for (uint32_t v = 0; v < grid.cells.size(); ++v)
            classes_[grid.labels[v]].add(v, grid.cells[v][0]);
    }

    // false: more comparisons than are allowed
    bool add(const SceneObject& object, int32_t index)
    {
        const Turned turned{object, reach_};
        const ClassCells& own = classes_[object.label];
        const double size = double(grid_.voxel_size);
        const auto slices = between(own.slices, turned.extent(0), size, [](const auto& s) { return s.i; });
        if ((pairs_ += slices.size()) > most_)
            return false;
        for (auto slice = slices.begin(); slice != slices.end(); ++slice) {
            const size_t end = own.end_of(size_t(slice - own.slices.begin()));
            const auto cells = between(std::span(own.cells).subspan(slice->first, end - slice->first), turned.extent(1),
                                       size, [&](uint32_t v) { return grid_.cells[v][1]; });
            if ((pairs_ += cells.size()) > most_)
                return false;
            for (uint32_t v : cells)
                compare(v, turned, index);
        }
        return true;
    }
    std::vector<int32_t> take() { return std::move(owners_); }

  private:
    void compare(uint32_t v, const Turned& turned, int32_t index)
    {
        const double size = double(grid_.voxel_size);
        const Cell& c = grid_.cells[v];
        const std::array<double, 3> center = {(c[0] + 0.5) * size, (c[1] + 0.5) * size, (c[2] + 0.5) * size};
        for (size_t i = v * places_; i < (v + 1) * places_; ++i) {
            std::array<double, 3> place = center;
            for (size_t a = 0; by_points_ && a < 3; ++a)
                place[a] += double(half_to_float(grid_.points[3 * i + a]));
            const double depth = turned.depth(place);
            if (depth > depths_[i]) {
                depths_[i] = depth;
                owners_[i] = index;
            }
        }
    }

    const VoxelGrid& grid_;
    std::array<ClassCells, 256> classes_;
    size_t places_; // of a voxel
    bool by_points_;
    std::vector<int32_t> owners_;
    std::vector<double> depths_;
    double reach_;
    uint64_t most_, pairs_ = 0;
};

Result<std::vector<int32_t>> owners_among(const VoxelGrid& grid, std::span<const SceneObject> objects, bool parts,
                                          uint64_t most, bool by_points = false)
{
    OwnerSearch search(grid, by_points, parts ? kPartReach : kObjectReach, most);
    for (size_t o = 0; o < objects.size(); ++o)
        if (objects[o].part == parts && !search.add(objects[o], int32_t(o)))
            return fail(ErrorCode::bad_input,
                        "object {} of {}: the boxes so far lie over more than {} voxels of their classes, counted with "
                        "each box; the grid has {} voxels",
                        o + 1, objects.size(), most, grid.cells.size());
    return search.take();
}

using Rgb = std::array<uint8_t, 3>;

// luma of Rec. 709, of levels, times 10,000
uint32_t lightness(const Rgb& color)
{
    return 2126u * color[0] + 7152u * color[1] + 722u * color[2];
}

// the lighter two fifths: what windows, tyres and shadows leave out is the paint
void keep_lighter_part(std::vector<Rgb>& colors)
{
    std::vector<uint32_t> levels(colors.size());
    std::ranges::transform(colors, levels.begin(), lightness);
    const auto first = levels.begin() + ptrdiff_t(levels.size() * 3 / 5);
    std::ranges::nth_element(levels, first);
    std::erase_if(colors, [least = *first](const Rgb& color) { return lightness(color) < least; });
}

// colors: one at least -> their median, channel by channel, 0..1
std::array<double, 3> median_color(std::span<const Rgb> colors)
{
    std::array<double, 3> median{};
    std::vector<uint8_t> levels(colors.size());
    for (size_t c = 0; c < 3; ++c) {
        std::ranges::transform(colors, levels.begin(), [c](const Rgb& color) { return color[c]; });
        const auto middle = levels.begin() + ptrdiff_t((levels.size() - 1) / 2);
        std::ranges::nth_element(levels, middle);
        median[c] = *middle / 255.0;
    }
    return median;
}

// the colours of the points of some voxels that `chosen` takes: voxel and index of the point -> bool
template <typename Chosen>
std::vector<Rgb> colors_of(const VoxelGrid& grid, std::span<const uint32_t> cells, const Chosen& chosen)
{
    const size_t points = size_t(grid.points_per_voxel);
    std::vector<Rgb> colors;
    for (const uint32_t v : cells)
        for (size_t i = v * points; i < (v + 1) * points; ++i)
            if (chosen(v, i))
                colors.push_back({grid.colors[i * 3], grid.colors[i * 3 + 1], grid.colors[i * 3 + 2]});
    return colors;
}

std::array<double, 3> paint_color(const VoxelGrid& grid, std::span<const uint32_t> cells)
{
    std::vector<Rgb> colors = colors_of(grid, cells, [](uint32_t, size_t) { return true; });
    keep_lighter_part(colors);
    return median_color(colors);
}

constexpr double kWithin = 0.02; // metres: the sides of an opening lie on its box

// of the points in the box; none where there are none
std::optional<std::array<double, 3>> color_within(const SceneObject& object, const VoxelGrid& grid,
                                                  std::span<const uint32_t> cells)
{
    const Turned turned{object};
    const double size = double(grid.voxel_size);
    const std::vector<Rgb> colors = colors_of(grid, cells, [&](uint32_t v, size_t i) {
        std::array<double, 3> at{};
        for (size_t a = 0; a < 3; ++a)
            at[a] = (grid.cells[v][a] + 0.5) * size + double(half_to_float(grid.points[i * 3 + a]));
        return turned.depth(at) > kWithin;
    });
    return colors.empty() ? std::optional<std::array<double, 3>>() : median_color(colors);
}

// calls of(owner, voxels) for each owner of voxels that have points
template <typename Of>
void each_owner(const VoxelGrid& grid, std::span<const int32_t> owners, const Of& of)
{
    std::vector<uint32_t> cells;
    for (uint32_t v = 0; v < owners.size(); ++v)
        if (owners[v] != kNoObject && grid.generated[v])
            cells.push_back(v);
    std::ranges::stable_sort(cells, {}, [&](uint32_t v) { return owners[v]; });
    for (size_t first = 0, last; first < cells.size(); first = last) {
        const int32_t owner = owners[cells[first]];
        for (last = first; last < cells.size() && owners[cells[last]] == owner;)
            ++last;
        of(size_t(owner), std::span(cells).subspan(first, last - first));
    }
}

} // namespace

std::array<double, 3> place_in(const SceneObject& object, const std::array<double, 3>& point)
{
    return Turned{object}.place(point);
}

Result<std::vector<uint32_t>> instances_of_points(const VoxelGrid& grid, std::span<const SceneObject> objects,
                                                  uint64_t most)
{
    SR_TRY(const std::vector<int32_t> owners, owners_among(grid, objects, false, most, grid.has_points()));
    const size_t places = grid.has_points() ? size_t(grid.points_per_voxel) : 1;
    std::vector<uint32_t> numbers;
    for (size_t i = 0; i < owners.size(); ++i)
        if (!grid.has_points() || grid.generated[i / places])
            numbers.push_back(owners[i] == kNoObject ? 0 : instance_number(objects[size_t(owners[i])].id));
    return numbers;
}

Result<std::vector<int32_t>> objects_of_cells(const VoxelGrid& grid, std::span<const SceneObject> objects,
                                              uint64_t most)
{
    return owners_among(grid, objects, false, most);
}

Result<std::vector<int32_t>> parts_of_cells(const VoxelGrid& grid, std::span<const SceneObject> objects, uint64_t most)
{
    return owners_among(grid, objects, true, most);
}

std::vector<size_t> objects_meant(std::span<const int32_t> owners, size_t objects, std::span<const uint32_t> cells)
{
    std::vector<size_t> all(objects), chosen(objects), meant;
    for (const int32_t owner : owners)
        if (owner != kNoObject)
            ++all[size_t(owner)];
    for (const uint32_t cell : cells)
        if (owners[cell] != kNoObject)
            ++chosen[size_t(owners[cell])];
    for (size_t o = 0; o < objects; ++o)
        if (chosen[o] * 2 > all[o])
            meant.push_back(o);
    const auto most = std::ranges::max_element(chosen);
    if (meant.empty() && most != chosen.end() && *most > 0)
        meant.push_back(size_t(most - chosen.begin()));
    return meant;
}

Status tint_objects(std::span<SceneObject> objects, const VoxelGrid& grid)
{
    if (!grid.has_points())
        return {};
    SR_TRY(const std::vector<int32_t> owners, objects_of_cells(grid, objects));
    each_owner(grid, owners,
               [&](size_t o, std::span<const uint32_t> cells) { objects[o].tint = paint_color(grid, cells); });
    SR_TRY(const std::vector<int32_t> parts, parts_of_cells(grid, objects));
    each_owner(grid, parts, [&](size_t o, std::span<const uint32_t> cells) {
        if (const auto color = color_within(objects[o], grid, cells))
            objects[o].tint = color;
    });
    return {};
}

} // namespace semrover
