// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/splat/blocks.h"

#include "engine/scene/palette.h"

namespace semrover {

namespace {

constexpr int kPerSide = 5;      // splats along an edge of a face
constexpr float kOverlap = 0.7f; // sigma over spacing: alpha stays above 0.98 between four splats

// faces of different directions get different shades, so that blocks stay apart
float shade(int axis, int side)
{
    return axis == 2 ? (side > 0 ? 1.f : 0.6f) : axis == 0 ? 0.8f : 0.9f;
}

void add_face(Blocks& blocks, const VoxelGrid& grid, size_t cell, int axis, int side)
{
    Splats& out = blocks.splats;
    const std::array<float, 3> center = cell_center(grid.cells[cell], grid.voxel_size),
                               color = label_color(grid.labels[cell]);
    const float spacing = grid.voxel_size / kPerSide;
    for (int u = 0; u < kPerSide; ++u)
        for (int v = 0; v < kPerSide; ++v) {
            std::array<float, 3> p = center, n{};
            n[size_t(axis)] = float(side);
            p[size_t(axis)] +=
                float(side) * grid.voxel_size * 0.499f; // inside the voxel: faces of neighbours do not tie
            p[size_t(axis + 1) % 3] += (float(u) - (kPerSide - 1) / 2.f) * spacing;
            p[size_t(axis + 2) % 3] += (float(v) - (kPerSide - 1) / 2.f) * spacing;
            out.position.push_back(p);
            out.normal.push_back(n);
            const float light = shade(axis, side);
            out.color.push_back({color[0] * light, color[1] * light, color[2] * light});
            out.sigma_u.push_back(kOverlap * spacing);
            out.sigma_v.push_back(kOverlap * spacing);
            out.opacity.push_back(1);
            out.label.push_back(grid.labels[cell]);
            blocks.cells.push_back(uint32_t(cell));
        }
}

} // namespace

Blocks block_splats(const VoxelGrid& grid)
{
    Blocks out;
    for (size_t cell = 0; cell < grid.cells.size(); ++cell)
        for (int axis = 0; axis < 3; ++axis)
            for (int side : {-1, 1}) {
                Cell neighbor = grid.cells[cell];
                neighbor[size_t(axis)] += side;
                if (!find_cell(grid, neighbor))
                    add_face(out, grid, cell, axis, side);
            }
    return out;
}

} // namespace semrover
