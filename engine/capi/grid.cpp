// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// grids
#include "engine/capi/edits.h"
#include "engine/capi/handles.h"
#include "engine/scene/cell_reach.h"
#include "engine/scene/palette.h"
#include "engine/scene/tiles.h"
#include "runtime/base/dtype.h"

using namespace semrover;
using namespace semrover::capi;

namespace semrover::capi {

Result<LabelEdits> edits_of(const sr_cell* cells, uint64_t count, const char* name)
{
    if (count && !cells)
        return fail(ErrorCode::usage, "{}: cells is NULL", name);
    LabelEdits edits;
    for (uint64_t n = 0; n < count; ++n) {
        const sr_cell& c = cells[n];
        for (const int32_t coordinate : {c.i, c.j, c.k})
            if (coordinate < -kMaxCoordinate || coordinate > kMaxCoordinate)
                return fail(ErrorCode::bad_input, "{}: voxel {} of {}, ({}, {}, {}), lies beyond 2^20", name, n, count,
                            c.i, c.j, c.k);
        if (c.label >= kClassCount && c.label != SR_NO_CELL)
            return fail(ErrorCode::bad_input, "{}: voxel {} of {} has label {}, there are {}", name, n, count, c.label,
                        kClassCount);
        std::optional<uint8_t>& edit = edits[{c.i, c.j, c.k}];
        edit.reset();
        if (c.label != SR_NO_CELL)
            edit = uint8_t(c.label);
    }
    return edits;
}

} // namespace semrover::capi

namespace {

// numbers of the voxels that a caller asks for
Result<std::pair<size_t, size_t>> range_of(const sr_grid* grid, uint64_t first, uint64_t count, const void* to,
                                           const uint64_t* written, const char* name)
{
    if (!grid || !written || (count && !to))
        return fail(ErrorCode::usage, "{}: NULL", name);
    const size_t all = grid->read().cells.size();
    const size_t begin = size_t(std::min<uint64_t>(first, all));
    return std::pair(begin, begin + size_t(std::min<uint64_t>(count, all - begin)));
}

// x, y, z, r, g, b of each point of a voxel
void write_points(const VoxelGrid& grid, size_t cell, float* to)
{
    const double edge = decimal_voxel_size(grid.voxel_size);
    const size_t n = size_t(grid.points_per_voxel);
    for (size_t p = 0; p < n; ++p)
        for (size_t a = 0; a < 3; ++a) {
            const size_t at = (cell * n + p) * 3 + a;
            const double centre = (grid.cells[cell][a] + 0.5) * edge;
            to[p * 6 + a] = float(centre + double(half_to_float(grid.points[at])));
            to[p * 6 + 3 + a] = float(grid.colors[at]) / 255;
        }
}

} // namespace

extern "C" {

sr_status sr_grid_create(double voxel_size, sr_grid** grid)
{
    return guarded(nullptr, [&]() -> Status {
        if (!grid)
            return fail(ErrorCode::usage, "sr_grid_create: grid is NULL");
        *grid = nullptr;
        if (!(voxel_size >= 1e-3 && voxel_size <= 1e3))
            return fail(ErrorCode::bad_input, "sr_grid_create: expected a voxel size of 0.001 to 1000 m, found {}",
                        voxel_size);
        *grid = new sr_grid;
        (*grid)->grid.voxel_size = float(voxel_size);
        return {};
    });
}

sr_status sr_grid_read(const char* path, sr_grid** grid)
{
    return guarded(nullptr, [&]() -> Status {
        if (!grid || !path)
            return fail(ErrorCode::usage, "sr_grid_read: NULL");
        *grid = nullptr;
        SR_TRY(VoxelGrid read, read_grid_or_tiles(path));
        *grid = new sr_grid{std::move(read), {}};
        return {};
    });
}

void sr_grid_destroy(sr_grid* grid)
{
    delete grid;
}

sr_status sr_grid_write(const sr_grid* grid, const char* path)
{
    return guarded(nullptr, [&]() -> Status {
        if (!grid || !path)
            return fail(ErrorCode::usage, "sr_grid_write: NULL");
        return write_grid(path, grid->read());
    });
}

sr_status sr_grid_get_info(const sr_grid* grid, sr_grid_info* info)
{
    return guarded(nullptr, [&]() -> Status {
        if (!grid)
            return fail(ErrorCode::usage, "sr_grid_get_info: grid is NULL");
        const VoxelGrid& read = grid->read();
        sr_grid_info known{};
        known.points_per_voxel = read.has_points() ? uint32_t(read.points_per_voxel) : 0;
        known.cells = read.cells.size();
        known.voxel_size = decimal_voxel_size(read.voxel_size);
        return write_result(known, info, "sr_grid_get_info");
    });
}

sr_status sr_grid_set_cells(sr_grid* grid, const sr_cell* cells, uint64_t count)
{
    return guarded(nullptr, [&]() -> Status {
        if (!grid)
            return fail(ErrorCode::usage, "sr_grid_set_cells: grid is NULL");
        SR_TRY(const LabelEdits edits, edits_of(cells, count, "sr_grid_set_cells"));
        for (const auto& [cell, label] : edits)
            grid->edits.insert_or_assign(cell, label);
        return {};
    });
}

sr_status sr_grid_get_cells(const sr_grid* grid, uint64_t first, uint64_t count, sr_cell* cells, uint64_t* written)
{
    return guarded(nullptr, [&]() -> Status {
        SR_TRY(const auto range, range_of(grid, first, count, cells, written, "sr_grid_get_cells"));
        for (size_t c = range.first; c < range.second; ++c) {
            const Cell& cell = grid->grid.cells[c];
            cells[c - range.first] = {cell[0], cell[1], cell[2], grid->grid.labels[c]};
        }
        *written = range.second - range.first;
        return {};
    });
}

sr_status sr_grid_get_points(const sr_grid* grid, uint64_t first, uint64_t count, float* points, uint64_t* written)
{
    return guarded(nullptr, [&]() -> Status {
        SR_TRY(const auto range, range_of(grid, first, count, points, written, "sr_grid_get_points"));
        if (!grid->grid.has_points())
            return fail(ErrorCode::bad_input, "sr_grid_get_points: the grid's voxels have no points");
        const size_t width = size_t(grid->grid.points_per_voxel) * 6;
        for (size_t c = range.first; c < range.second; ++c) {
            float* to = points + (c - range.first) * width;
            if (grid->grid.generated[c])
                write_points(grid->grid, c, to);
            else
                std::fill_n(to, width, 0.f);
        }
        *written = range.second - range.first;
        return {};
    });
}

} // extern "C"

static_assert(sizeof(sr_cell) == 16 && sizeof(sr_grid_info) == 24);
