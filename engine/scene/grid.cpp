// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/scene/grid.h"

#include "engine/scene/palette.h"
#include "runtime/base/quote.h"
#include "runtime/base/safetensors.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numeric>

namespace semrover {

namespace {

constexpr float kPointSlack = 1e-3f; // metres; f16 at 0.3 m is exact to 0.12 mm
constexpr uint64_t kGridHeaderBytes = 1u << 20;

std::string cell_text(const Cell& cell)
{
    return fmt::format("({}, {}, {})", cell[0], cell[1], cell[2]);
}

template <typename T>
Result<T> number(const std::map<std::string, std::string>& metadata, const std::string& key, std::string_view where)
{
    const auto entry = metadata.find(key);
    if (entry == metadata.end())
        return fail(ErrorCode::bad_input, "{}: metadata has no {}", where, key);
    const std::string& text = entry->second;
    T value{};
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size())
        return fail(ErrorCode::bad_input, "{}: metadata {}: expected a number, found {}", where, key, quote(text));
    return value;
}

// the shapes follow from those of `cells` and `points`
Status check_tensors(const SafetensorsSet& file, std::string_view where)
{
    const TensorInfo* cells = file.find("cells");
    const TensorInfo* points = file.find("points");
    if (cells && cells->shape.size() != 2)
        return fail(ErrorCode::bad_input, "{}: cells: expected shape [V, 3], found {}", where,
                    shape_text(cells->shape));
    if (points && points->shape.size() != 3)
        return fail(ErrorCode::bad_input, "{}: points: expected shape [V, n, 3], found {}", where,
                    shape_text(points->shape));
    const uint64_t v = cells ? cells->shape[0] : 0;
    const uint64_t n = points ? points->shape[1] : 0;
    std::vector<TensorSpec> schema = {{"cells", {v, 3}, false, {DType::i32}}, {"labels", {v}, false, {DType::u8}}};
    if (points || file.find("colors")) {
        schema.push_back({"points", {v, n, 3}, false, {DType::f16}});
        schema.push_back({"colors", {v, n, 3}, false, {DType::u8}});
        schema.push_back({"generated", {v}, true, {DType::u8}});
    }
    if (n > kMaxPointsPerVoxel)
        return fail(ErrorCode::bad_input, "{}: {} points in a voxel, at most {} are allowed", where, n,
                    kMaxPointsPerVoxel);
    return file.require(schema);
}

// voxel_size and points_per_voxel move from the metadata to their fields
Status take_numbers(VoxelGrid& grid, int stored_points, std::string_view where)
{
    SR_TRY(grid.voxel_size, number<float>(grid.metadata, "voxel_size", where));
    if (grid.metadata.contains("points_per_voxel")) {
        SR_TRY(grid.points_per_voxel, number<int>(grid.metadata, "points_per_voxel", where));
        if (grid.points_per_voxel < 0 || grid.points_per_voxel > kMaxPointsPerVoxel)
            return fail(ErrorCode::bad_input, "{}: metadata points_per_voxel: expected 0 to {}, found {}", where,
                        kMaxPointsPerVoxel, grid.points_per_voxel);
        if (stored_points && grid.points_per_voxel != stored_points)
            return fail(ErrorCode::bad_input, "{}: metadata says {} points_per_voxel, but points has {}", where,
                        grid.points_per_voxel, stored_points);
    } else {
        grid.points_per_voxel = stored_points;
    }
    grid.metadata.erase("voxel_size");
    grid.metadata.erase("points_per_voxel");
    return {};
}

// rows of `width` elements in a new order
template <typename T>
void reorder(std::vector<T>& rows, const std::vector<size_t>& order, size_t width)
{
    if (rows.empty())
        return;
    std::vector<T> sorted(rows.size());
    for (size_t i = 0; i < order.size(); ++i)
        std::copy_n(rows.begin() + static_cast<ptrdiff_t>(order[i] * width), width,
                    sorted.begin() + static_cast<ptrdiff_t>(i * width));
    rows = std::move(sorted);
}

Status check_sizes(const VoxelGrid& grid, std::string_view where)
{
    const size_t v = grid.cells.size();
    if (v == 0)
        return fail(ErrorCode::bad_input, "{}: the grid is empty, expected at least one voxel", where);
    if (!(grid.voxel_size >= 1e-3f && grid.voxel_size <= 1e3f))
        return fail(ErrorCode::bad_input, "{}: expected a voxel size of 0.001 to 1000 m, found {}", where,
                    grid.voxel_size);
    const size_t n = grid.has_points() ? static_cast<size_t>(std::max(grid.points_per_voxel, 0)) : 0;
    if (grid.labels.size() != v || grid.points.size() != v * n * 3 || grid.colors.size() != v * n * 3 ||
        grid.generated.size() != (grid.has_points() ? v : 0))
        return fail(ErrorCode::bad_input,
                    "{}: arrays disagree: {} voxels of {} points, {} labels, {} points, {} colors, {} generated", where,
                    v, grid.points_per_voxel, grid.labels.size(), grid.points.size(), grid.colors.size(),
                    grid.generated.size());
    return {};
}

Status check_cells(const VoxelGrid& grid, std::string_view where)
{
    for (size_t i = 0; i < grid.cells.size(); ++i) {
        const Cell& cell = grid.cells[i];
        for (const int32_t c : cell)
            if (c < -kMaxCoordinate || c > kMaxCoordinate)
                return fail(ErrorCode::bad_input, "{}: voxel {} is absurd: expected coordinates within 2^20", where,
                            cell_text(cell));
        if (i > 0 && grid.cells[i - 1] == cell)
            return fail(ErrorCode::bad_input, "{}: voxel {} is given twice", where, cell_text(cell));
        if (i > 0 && cell < grid.cells[i - 1])
            return fail(ErrorCode::bad_input, "{}: voxels are not sorted: {} follows {}", where, cell_text(cell),
                        cell_text(grid.cells[i - 1]));
    }
    return {};
}

Status check_labels(const VoxelGrid& grid, std::string_view where)
{
    std::array<size_t, 256> counts{};
    for (const uint8_t label : grid.labels)
        ++counts[label];
    std::string unknown;
    for (size_t label = kClassCount; label < counts.size(); ++label)
        if (counts[label])
            unknown += fmt::format("{}{} ({} voxels)", unknown.empty() ? "" : ", ", label, counts[label]);
    if (!unknown.empty())
        return fail(ErrorCode::bad_input, "{}: unknown labels, expected 0 to {}: {}", where, kClassCount - 1, unknown);
    return {};
}

Status check_points(const VoxelGrid& grid, std::string_view where)
{
    const float limit = grid.voxel_size / 2 + kPointSlack;
    for (size_t i = 0; i < grid.points.size(); ++i) {
        const float offset = half_to_float(grid.points[i]);
        if (std::abs(offset) <= limit) // false for NaN
            continue;
        const size_t point = i / 3, n = static_cast<size_t>(grid.points_per_voxel);
        return fail(ErrorCode::bad_input, "{}: point {} of voxel {}: {} = {} m, expected within {} m of the centre",
                    where, point % n, cell_text(grid.cells[point / n]), "xyz"[i % 3], offset, limit);
    }
    return {};
}

} // namespace

std::array<float, 3> cell_center(const Cell& cell, float voxel_size)
{
    std::array<float, 3> center;
    for (size_t axis = 0; axis < 3; ++axis)
        center[axis] = static_cast<float>((cell[axis] + 0.5) * voxel_size);
    return center;
}

std::optional<size_t> find_cell(const VoxelGrid& grid, const Cell& cell)
{
    const auto found = std::ranges::lower_bound(grid.cells, cell);
    if (found == grid.cells.end() || *found != cell)
        return std::nullopt;
    return static_cast<size_t>(found - grid.cells.begin());
}

void append_cell(VoxelGrid& to, const VoxelGrid& from, size_t index)
{
    to.cells.push_back(from.cells[index]);
    to.labels.push_back(from.labels[index]);
    if (!from.has_points())
        return;
    const size_t width = size_t(from.points_per_voxel) * 3;
    const auto at = ptrdiff_t(index * width), end = ptrdiff_t((index + 1) * width);
    to.points.insert(to.points.end(), from.points.begin() + at, from.points.begin() + end);
    to.colors.insert(to.colors.end(), from.colors.begin() + at, from.colors.begin() + end);
    to.generated.push_back(from.generated[index]);
}

void sort_cells(VoxelGrid& grid)
{
    const size_t v = grid.cells.size();
    if (std::ranges::is_sorted(grid.cells))
        return;
    const size_t width = grid.points.size() / v;
    SR_ASSERT(grid.labels.size() == v && grid.points.size() == v * width && grid.colors.size() == grid.points.size() &&
                  (grid.generated.empty() || grid.generated.size() == v),
              "arrays of a grid of {} voxels disagree", v);
    std::vector<size_t> order(v);
    std::iota(order.begin(), order.end(), size_t(0));
    std::ranges::stable_sort(order, {}, [&](size_t i) { return grid.cells[i]; });
    reorder(grid.cells, order, 1);
    reorder(grid.labels, order, 1);
    reorder(grid.points, order, width);
    reorder(grid.colors, order, width);
    reorder(grid.generated, order, 1);
}

Status check_grid(const VoxelGrid& grid, std::string_view where)
{
    SR_CHECK(check_sizes(grid, where));
    SR_CHECK(check_cells(grid, where));
    SR_CHECK(check_labels(grid, where));
    return check_points(grid, where);
}

Result<VoxelGrid> read_grid(const Path& path)
{
    const std::string where = quote_path(path);
    SR_TRY(const SafetensorsSet file, SafetensorsSet::open(path, {.header_bytes = kGridHeaderBytes}));
    SR_CHECK(check_tensors(file, where));
    VoxelGrid grid;
    grid.metadata = file.shards()[0].metadata();
    const TensorInfo* points = file.find("points");
    SR_CHECK(take_numbers(grid, points ? static_cast<int>(points->shape[1]) : 0, where));
    const std::vector<int32_t> coordinates = elements<int32_t>(file, "cells");
    grid.cells.resize(coordinates.size() / 3);
    for (size_t i = 0; i < coordinates.size(); ++i)
        grid.cells[i / 3][i % 3] = coordinates[i];
    grid.labels = elements<uint8_t>(file, "labels");
    grid.points = elements<uint16_t>(file, "points");
    grid.colors = elements<uint8_t>(file, "colors");
    grid.generated = elements<uint8_t>(file, "generated");
    if (grid.has_points() && grid.generated.empty())
        grid.generated.assign(grid.cells.size(), 1);
    if (!grid.has_points())
        grid.generated.clear();
    sort_cells(grid);
    SR_CHECK(check_grid(grid, where));
    return grid;
}

Status write_grid(const Path& path, const VoxelGrid& grid)
{
    SR_CHECK(check_grid(grid, quote_path(path)));
    const uint64_t v = grid.cells.size(), n = static_cast<uint64_t>(grid.points_per_voxel);
    std::map<std::string, std::string> metadata = grid.metadata;
    metadata["voxel_size"] = fmt::format("{}", grid.voxel_size); // the shortest text that reads back the same
    if (n)
        metadata["points_per_voxel"] = fmt::format("{}", n);
    std::vector<TensorData> tensors = {{"cells", DType::i32, {v, 3}, std::as_bytes(std::span(grid.cells))},
                                       {"labels", DType::u8, {v}, std::as_bytes(std::span(grid.labels))}};
    if (grid.has_points()) {
        tensors.push_back({"points", DType::f16, {v, n, 3}, std::as_bytes(std::span(grid.points))});
        tensors.push_back({"colors", DType::u8, {v, n, 3}, std::as_bytes(std::span(grid.colors))});
        tensors.push_back({"generated", DType::u8, {v}, std::as_bytes(std::span(grid.generated))});
    }
    return write_safetensors(path, tensors, metadata);
}

} // namespace semrover
