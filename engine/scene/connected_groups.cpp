// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/scene/connected_groups.h"

#include <numeric>

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

} // namespace semrover
