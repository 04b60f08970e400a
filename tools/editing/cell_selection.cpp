// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/editing/cell_selection.h"

#include "engine/scene/cell_reach.h"
#include "engine/scene/palette.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <set>

namespace semrover {

namespace {

constexpr double kFarthest = 1e7; // metres
constexpr uint64_t kMostPlaces = 1u << 22;

// `count` numbers between commas
template <typename T>
Result<std::vector<T>> numbers(std::string_view text, size_t count, std::string_view what)
{
    std::vector<T> values;
    const char *at = text.data(), *end = text.data() + text.size();
    while (true) {
        T value{};
        const auto [next, error] = std::from_chars(at, end, value);
        if (error != std::errc())
            break;
        values.push_back(value);
        at = next;
        if (at == end || *at != ',')
            break;
        ++at;
    }
    if (at != end || values.size() != count)
        return fail(ErrorCode::usage, "expected {}, found {}", what, quote(text));
    return values;
}

Status check_point(const std::array<double, 3>& p)
{
    for (const double v : p)
        if (!(std::abs(v) <= kFarthest))
            return fail(ErrorCode::bad_input, "{} is absurd: expected metres within {}", v, kFarthest);
    return {};
}

std::array<double, 3> center_of(const Cell& cell, double edge)
{
    return {(cell[0] + 0.5) * edge, (cell[1] + 0.5) * edge, (cell[2] + 0.5) * edge};
}

Status as_usage(const Status& status)
{
    if (status)
        return {};
    return fail(ErrorCode::usage, "{}", status.error().message);
}

} // namespace

bool CellSelection::holds_place(const Cell& cell, float voxel_size) const
{
    const std::array<double, 3> c = center_of(cell, decimal_voxel_size(voxel_size));
    double distance2 = 0;
    for (size_t a = 0; a < 3; ++a) {
        if (box && !(c[a] >= box->low[a] - 1e-9 && c[a] <= box->high[a] + 1e-9))
            return false;
        if (sphere)
            distance2 += (c[a] - sphere->center[a]) * (c[a] - sphere->center[a]);
    }
    return !sphere || distance2 <= sphere->radius * sphere->radius + 1e-9;
}

std::vector<Cell> connected_cells(const Cell& start, const std::function<bool(const Cell&)>& same)
{
    std::set<Cell> seen{start};
    std::vector<Cell> open{start};
    while (!open.empty()) {
        const Cell at = open.back();
        open.pop_back();
        for (int32_t n = 0; n < 27; ++n) {
            const Cell next = {at[0] + n / 9 - 1, at[1] + n / 3 % 3 - 1, at[2] + n % 3 - 1};
            if (!seen.contains(next) && same(next)) {
                seen.insert(next);
                open.push_back(next);
            }
        }
    }
    return {seen.begin(), seen.end()};
}

Result<std::vector<uint32_t>> select_cells(const VoxelGrid& grid, const CellSelection& s)
{
    std::vector<uint32_t> chosen;
    const auto fits = [&](uint32_t c) {
        return (!s.label || grid.labels[c] == *s.label) && s.holds_place(grid.cells[c], grid.voxel_size);
    };
    if (!s.object) {
        for (uint32_t c = 0; c < grid.cells.size(); ++c)
            if (fits(c))
                chosen.push_back(c);
        return chosen;
    }
    const auto start = find_cell(grid, *s.object);
    if (!start)
        return fail(ErrorCode::bad_input, "there is no voxel ({}, {}, {}) in the grid", (*s.object)[0], (*s.object)[1],
                    (*s.object)[2]);
    for (const Cell& cell : connected_cells(*s.object, [&](const Cell& c) {
             const auto at = find_cell(grid, c);
             return at && grid.labels[*at] == grid.labels[*start];
         }))
        if (const uint32_t c = uint32_t(*find_cell(grid, cell)); fits(c))
            chosen.push_back(c);
    return chosen;
}

Result<std::vector<Cell>> places_in(const CellSelection& s, float voxel_size)
{
    SR_ASSERT(s.bounded(), "places of a selection without a box or sphere");
    WorldBox bounds{{-kFarthest, -kFarthest, -kFarthest}, {kFarthest, kFarthest, kFarthest}};
    for (size_t a = 0; a < 3; ++a) {
        if (s.box)
            bounds.low[a] = s.box->low[a], bounds.high[a] = s.box->high[a];
        if (s.sphere)
            bounds.low[a] = std::max(bounds.low[a], s.sphere->center[a] - s.sphere->radius),
            bounds.high[a] = std::min(bounds.high[a], s.sphere->center[a] + s.sphere->radius);
    }
    const Cell low = cell_at(bounds.low, voxel_size), high = cell_at(bounds.high, voxel_size);
    std::vector<Cell> places;
    double count = 1;
    for (size_t a = 0; a < 3; ++a)
        count *= std::max(0.0, double(high[a]) - low[a] + 1);
    if (count > double(kMostPlaces))
        return fail(ErrorCode::bad_input, "{:.0f} voxels are too many to fill at once, at most {} are allowed", count,
                    kMostPlaces);
    for (int32_t i = low[0]; i <= high[0]; ++i)
        for (int32_t j = low[1]; j <= high[1]; ++j)
            for (int32_t k = low[2]; k <= high[2]; ++k)
                if (s.holds_place({i, j, k}, voxel_size))
                    places.push_back({i, j, k});
    return places;
}

Result<uint8_t> parse_class(std::string_view text)
{
    if (const auto label = class_of_name(text))
        return *label;
    uint8_t number = 255;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    if (error == std::errc() && end == text.data() + text.size() && number < kClassCount)
        return number;
    std::string names;
    for (const SemanticClass& c : kPalette)
        names += fmt::format("{}{}", names.empty() ? "" : ", ", c.name);
    return fail(ErrorCode::usage, "unknown class {}, expected one of {} (or its number)", quote(text), names);
}

Result<WorldBox> parse_box(std::string_view text)
{
    constexpr const char* kForm = "a box x0,y0,z0:x1,y1,z1 in metres";
    const size_t colon = text.find(':');
    if (colon == std::string_view::npos)
        return fail(ErrorCode::usage, "expected {}, found {}", kForm, quote(text));
    SR_TRY(const auto low, numbers<double>(text.substr(0, colon), 3, kForm));
    SR_TRY(const auto high, numbers<double>(text.substr(colon + 1), 3, kForm));
    const WorldBox box{{low[0], low[1], low[2]}, {high[0], high[1], high[2]}};
    SR_CHECK(as_usage(check_box(box)));
    return box;
}

Result<WorldSphere> parse_sphere(std::string_view text)
{
    SR_TRY(const auto v, numbers<double>(text, 4, "a sphere x,y,z,radius in metres"));
    const WorldSphere sphere{{v[0], v[1], v[2]}, v[3]};
    SR_CHECK(as_usage(check_sphere(sphere)));
    return sphere;
}

Result<Cell> parse_cell(std::string_view text)
{
    SR_TRY(const auto v, numbers<int32_t>(text, 3, "a voxel i,j,k"));
    return Cell{v[0], v[1], v[2]};
}

Result<std::array<double, 3>> parse_point(std::string_view text)
{
    SR_TRY(const auto v, numbers<double>(text, 3, "x,y,z in metres"));
    const std::array<double, 3> point = {v[0], v[1], v[2]};
    SR_CHECK(as_usage(check_point(point)));
    return point;
}

Status check_box(const WorldBox& box)
{
    SR_CHECK(check_point(box.low));
    SR_CHECK(check_point(box.high));
    for (size_t a = 0; a < 3; ++a)
        if (box.low[a] > box.high[a])
            return fail(ErrorCode::bad_input, "the box ends before it begins: {} to {} along {}", box.low[a],
                        box.high[a], "xyz"[a]);
    return {};
}

Status check_sphere(const WorldSphere& sphere)
{
    SR_CHECK(check_point(sphere.center));
    if (!(sphere.radius > 0 && sphere.radius <= kFarthest))
        return fail(ErrorCode::bad_input, "expected a radius above 0 m, found {}", sphere.radius);
    return {};
}

} // namespace semrover
