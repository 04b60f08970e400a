// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/dataset/dense_labels.h"

#include "tools/dataset/voxel_sizes.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

constexpr double kMaxCells = 1 << 28; // of the box, empty ones too

int64_t floor_div(int64_t a, int64_t b)
{
    return a / b - (a % b != 0 && (a < 0) != (b < 0));
}

// the voxels that a cell reaches along an axis, and how far each reaches into it
struct Reach {
    uint32_t first = 0;
    std::vector<uint64_t> lengths; // 0.1 mm
};

Reach reach_of(int64_t cell, int64_t size, int64_t origin, int64_t edge, uint32_t count)
{
    const int64_t low = cell * size - origin, high = low + size;
    const int64_t first = std::max<int64_t>(floor_div(low, edge), 0);
    Reach reach{static_cast<uint32_t>(first), {}};
    for (int64_t i = first; i < count && i * edge < high; ++i)
        reach.lengths.push_back(static_cast<uint64_t>(std::min(high, (i + 1) * edge) - std::max(low, i * edge)));
    return reach;
}

struct Axis {
    int64_t first = 0; // cell
    std::vector<Reach> cells;
};

Axis axis_of(const DenseLabels& dense, size_t axis, int64_t size)
{
    const int64_t low = dense.origin[axis], high = low + dense.edge[axis] * dense.shape[axis];
    Axis result{floor_div(low, size), {}};
    for (int64_t cell = result.first; cell * size < high; ++cell)
        result.cells.push_back(reach_of(cell, size, low, dense.edge[axis], dense.shape[axis]));
    return result;
}

struct Vote {
    uint8_t label = kEmpty;
    uint64_t volume = 0; // of all labels
    uint64_t area = 0;   // of the columns that have any
};

Vote vote(const DenseLabels& dense, const Reach& x, const Reach& y, const Reach& z)
{
    Vote result;
    std::array<uint64_t, kClassCount> volumes{};
    for (size_t i = 0; i < x.lengths.size(); ++i)
        for (size_t j = 0; j < y.lengths.size(); ++j) {
            const size_t row = (size_t(x.first) + i) * dense.shape[1] + y.first + j;
            const uint8_t* labels = dense.labels.data() + row * dense.shape[2] + z.first;
            bool any = false;
            for (size_t k = 0; k < z.lengths.size(); ++k)
                if (labels[k] < kClassCount) {
                    volumes[labels[k]] += x.lengths[i] * y.lengths[j] * z.lengths[k];
                    any = true;
                }
            result.area += any ? x.lengths[i] * y.lengths[j] : 0;
        }
    uint64_t largest = 0;
    for (uint8_t label = 0; label < kClassCount; ++label) {
        result.volume += volumes[label];
        if (volumes[label] > largest) {
            largest = volumes[label];
            result.label = label;
        }
    }
    return result;
}

} // namespace

Result<int64_t> tenths_of(double metres, std::string_view where)
{
    const double tenths = metres * 1e4;
    // what a float holds of a decimal number is off by up to 6e-8 of it
    if (!(std::abs(tenths) < 1e12) || std::abs(tenths - std::round(tenths)) > std::max(1e-3, 1e-7 * std::abs(tenths)))
        return fail(ErrorCode::bad_input, "{}: {} m: expected whole tenths of a millimetre", where, metres);
    return static_cast<int64_t>(std::round(tenths));
}

namespace {

Result<int64_t> size_of_cell(const DenseLabels& dense, float voxel_size, std::string_view where)
{
    SR_TRY(const int64_t size, tenths_of(voxel_size, fmt::format("{}: voxel size", where)));
    if (size < 10 || size > kMaxEdge)
        return fail(ErrorCode::bad_input, "{}: expected a voxel size of 0.001 to 100 m, found {}", where, voxel_size);
    double cells = 1;
    for (size_t a = 0; a < 3; ++a)
        cells *= double(dense.edge[a] * dense.shape[a]) / double(size) + 1;
    if (cells > kMaxCells)
        return fail(ErrorCode::bad_input,
                    "{}: a voxel size of {} m makes {:.3g} cells of its box, at most {:g} are "
                    "supported",
                    where, voxel_size, cells, kMaxCells);
    return size;
}

} // namespace

Result<VoxelGrid> resample(const DenseLabels& dense, float voxel_size, double min_fill, std::string_view where,
                           std::vector<std::string>* warnings)
{
    SR_TRY(const int64_t size, size_of_cell(dense, voxel_size, where));
    const Axis x = axis_of(dense, 0, size), y = axis_of(dense, 1, size), z = axis_of(dense, 2, size);
    for (const Axis* axis : {&x, &y, &z})
        if (axis->first < -kMaxCoordinate || axis->first + int64_t(axis->cells.size()) > kMaxCoordinate)
            return fail(ErrorCode::bad_input, "{}: cell {} is absurd: expected coordinates within 2^20", where,
                        axis->first);
    const double volume = double(size) * double(size) * double(size), least = min_fill * volume * (1 - 1e-9);
    std::vector<CellFill> fills;
    VoxelGrid grid;
    grid.voxel_size = voxel_size;
    for (size_t i = 0; i < x.cells.size(); ++i)
        for (size_t j = 0; j < y.cells.size(); ++j)
            for (size_t k = 0; k < z.cells.size(); ++k) {
                const Vote v = vote(dense, x.cells[i], y.cells[j], z.cells[k]);
                if (v.volume == 0 || double(v.volume) < least)
                    continue;
                grid.cells.push_back(
                    {int32_t(x.first + int64_t(i)), int32_t(y.first + int64_t(j)), int32_t(z.first + int64_t(k))});
                grid.labels.push_back(v.label);
                fills.push_back(
                    {float(double(v.volume) / volume), float(double(v.volume) / double(v.area) / double(size))});
            }
    if (grid.cells.empty())
        return fail(ErrorCode::bad_input, "{}: no voxel is occupied", where);
    if (warnings)
        for (const std::string& line : doubled_ground(grid, fills, double(dense.edge[2]) / 1e4))
            warnings->push_back(line);
    return grid;
}

std::vector<UnusedOption> unused_options(const DenseLabels& dense, float voxel_size)
{
    const auto size = tenths_of(double(voxel_size), "");
    for (size_t a = 0; a < 3; ++a)
        if (!size || dense.edge[a] != *size || dense.origin[a] % *size != 0)
            return {};
    return {{"min_fill", "a cell is a voxel"}};
}

Status split_into(DenseLabels& dense, const VoxelGrid& grid, std::string_view where)
{
    SR_TRY(const int64_t size, tenths_of(grid.voxel_size, fmt::format("{}: voxel size", where)));
    for (const int64_t edge : dense.edge)
        if (size % edge != 0)
            return fail(ErrorCode::bad_input, "{}: cells of {} m cannot be split into voxels of {} m", where,
                        grid.voxel_size, double(edge) / 1e4);
    dense.labels.assign(size_t(dense.shape[0]) * dense.shape[1] * dense.shape[2], kEmpty);
    size_t outside = 0;
    for (size_t v = 0; v < grid.cells.size(); ++v) {
        std::array<Reach, 3> reach;
        for (size_t a = 0; a < 3; ++a)
            reach[a] = reach_of(grid.cells[v][a], size, dense.origin[a], dense.edge[a], dense.shape[a]);
        const auto& [x, y, z] = reach;
        outside += x.lengths.empty() || y.lengths.empty() || z.lengths.empty();
        for (size_t i = x.first; i < x.first + x.lengths.size(); ++i)
            for (size_t j = y.first; j < y.first + y.lengths.size(); ++j)
                for (size_t k = z.first; k < z.first + z.lengths.size(); ++k)
                    dense.labels[(i * dense.shape[1] + j) * dense.shape[2] + k] = grid.labels[v];
    }
    if (outside)
        return fail(ErrorCode::bad_input,
                    "{}: {} of {} cells are outside its box of {:g} to {:g}, {:g} to {:g}, {:g} to "
                    "{:g} m",
                    where, outside, grid.cells.size(), double(dense.origin[0]) / 1e4,
                    double(dense.origin[0] + dense.edge[0] * dense.shape[0]) / 1e4, double(dense.origin[1]) / 1e4,
                    double(dense.origin[1] + dense.edge[1] * dense.shape[1]) / 1e4, double(dense.origin[2]) / 1e4,
                    double(dense.origin[2] + dense.edge[2] * dense.shape[2]) / 1e4);
    return {};
}

} // namespace semrover
