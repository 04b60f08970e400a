// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/scene/cell_reach.h"

#include <algorithm>
#include <charconv>
#include <cmath>

namespace semrover {

namespace {

// voxels with the same (i, j) lie one after the other
struct CellColumn {
    int32_t i, j;
    uint32_t begin, end;
};

std::vector<CellColumn> cell_columns(std::span<const Cell> cells)
{
    std::vector<CellColumn> columns;
    for (uint32_t c = 0; c < cells.size(); ++c) {
        if (columns.empty() || columns.back().i != cells[c][0] || columns.back().j != cells[c][1])
            columns.push_back({cells[c][0], cells[c][1], c, c});
        columns.back().end = c + 1;
    }
    return columns;
}

int64_t floor_root(int64_t square)
{
    int64_t root = int64_t(std::sqrt(double(square)));
    while (root * root > square)
        --root;
    while ((root + 1) * (root + 1) <= square)
        ++root;
    return root;
}

class Marker {
  public:
    Marker(std::span<const Cell> cells, int64_t reach2)
        : cells_(cells), columns_(cell_columns(cells)), reach2_(reach2), reach_(floor_root(reach2)),
          marked_(cells.size(), 0)
    {
    }

    void mark_around(const Cell& source)
    {
        for (int64_t di = -reach_; di <= reach_; ++di) {
            const int64_t i = source[0] + di, across = floor_root(reach2_ - di * di);
            auto column =
                std::ranges::lower_bound(columns_, std::pair(i, source[1] - across), {},
                                         [](const CellColumn& c) { return std::pair(int64_t(c.i), int64_t(c.j)); });
            for (; column != columns_.end() && column->i == i && column->j <= source[1] + across; ++column) {
                const int64_t dj = column->j - int64_t(source[1]);
                mark_column(*column, source[2], floor_root(reach2_ - di * di - dj * dj));
            }
        }
    }

    std::vector<uint32_t> indices() const
    {
        std::vector<uint32_t> out;
        for (uint32_t c = 0; c < marked_.size(); ++c)
            if (marked_[c])
                out.push_back(c);
        return out;
    }

  private:
    void mark_column(const CellColumn& column, int64_t k, int64_t up)
    {
        const auto begin = cells_.begin() + column.begin, end = cells_.begin() + column.end;
        auto cell = std::lower_bound(begin, end, k - up, [](const Cell& c, int64_t low) { return c[2] < low; });
        for (; cell != end && (*cell)[2] <= k + up; ++cell)
            marked_[size_t(cell - cells_.begin())] = 1;
    }

    std::span<const Cell> cells_;
    std::vector<CellColumn> columns_;
    int64_t reach2_, reach_;
    std::vector<uint8_t> marked_;
};

} // namespace

double decimal_voxel_size(float voxel_size)
{
    const std::string text = fmt::format("{}", voxel_size);
    double value = voxel_size;
    std::from_chars(text.data(), text.data() + text.size(), value);
    return value;
}

Cell cell_at(const std::array<double, 3>& metres, float voxel_size)
{
    const double edge = decimal_voxel_size(voxel_size);
    Cell cell;
    for (size_t a = 0; a < 3; ++a)
        cell[a] = int32_t(std::clamp(std::floor(metres[a] / edge + 1e-9), -2e9, 2e9));
    return cell;
}

int64_t reach_squared(double metres, float voxel_size)
{
    const double cells = metres / decimal_voxel_size(voxel_size);
    return int64_t(std::floor(cells * cells * (1 + 1e-9)));
}

std::vector<uint32_t> cells_within(std::span<const Cell> cells, std::span<const Cell> sources, int64_t reach2)
{
    SR_ASSERT(reach2 >= 0 && std::ranges::is_sorted(cells), "voxels must be sorted, a reach of {} squared", reach2);
    Marker marker(cells, reach2);
    for (const Cell& source : sources)
        marker.mark_around(source);
    return marker.indices();
}

} // namespace semrover
