// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/grid.h"

// A voxel in 32 bits, for who knows about where it is: the low 12 bits of i and j, 8 of k.
namespace semrover {

inline uint32_t cell_number(const Cell& cell)
{
    return (uint32_t(cell[0]) & 0xfff) | (uint32_t(cell[1]) & 0xfff) << 12 | uint32_t(cell[2]) << 24;
}

// the nearest with this number: within 2048 voxels in i and j, 128 in k
inline Cell cell_of_number(uint32_t number, const Cell& near)
{
    constexpr uint32_t kBits[] = {12, 12, 8};
    Cell cell = near;
    for (uint32_t axis = 0, shift = 0; axis < 3; shift += kBits[axis++]) {
        const int32_t size = 1 << kBits[axis], away = int32_t((number >> shift) - uint32_t(near[axis])) & (size - 1);
        cell[axis] += away < size / 2 ? away : away - size;
    }
    return cell;
}

} // namespace semrover
