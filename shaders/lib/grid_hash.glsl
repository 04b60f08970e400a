// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// A product, which Vulkan rounds to the nearest float: all shaders must find the same cell. per_metre: 1 / size of a cell
ivec3 grid_cell(vec3 point, float per_metre) { return ivec3(clamp(floor(point * per_metre), vec3(-1e9), vec3(1e9))); }

// Teschner et al. 2003, then mixed so that the low bits depend on all of it
uint grid_hash(ivec3 cell)
{
    uint h = uint(cell.x) * 73856093u ^ uint(cell.y) * 19349663u ^ uint(cell.z) * 83492791u;
    h ^= h >> 16;
    h *= 0x7feb352du;
    return h ^ h >> 15;
}
