// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

ivec3 grid_cell(vec3 point, float cell_size) { return ivec3(clamp(floor(point / cell_size), vec3(-1e9), vec3(1e9))); }

// Teschner et al. 2003, then mixed so that the low bits depend on all of it
uint grid_hash(ivec3 cell)
{
    uint h = uint(cell.x) * 73856093u ^ uint(cell.y) * 19349663u ^ uint(cell.z) * 83492791u;
    h ^= h >> 16;
    h *= 0x7feb352du;
    return h ^ h >> 15;
}
