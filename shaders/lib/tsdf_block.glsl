// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// blocks of 8 x 8 x 8 voxels in a box, x fastest. Those that exist are bits of a bitmap; their index is the number of
// bits before theirs. Needs readonly buffers `bitmap` and `ranks` (bits before each word).
const uint kNoVoxel = 0xffffffffu;

uvec3 block_at(uint id, uvec3 box) { return uvec3(id % box.x, id / box.x % box.y, id / (box.x * box.y)); }

// index of a voxel of the box in arrays [blocks, 512], kNoVoxel where no block is
uint voxel_index(ivec3 voxel, uvec3 box)
{
    if (any(lessThan(voxel, ivec3(0))))
        return kNoVoxel;
    const uvec3 v = uvec3(voxel), b = v / 8;
    if (any(greaterThanEqual(b, box)))
        return kNoVoxel;
    const uint id = (b.z * box.y + b.y) * box.x + b.x, word = bitmap[id / 32], bit = 1u << (id % 32);
    if ((word & bit) == 0)
        return kNoVoxel;
    const uvec3 l = v % 8;
    return (ranks[id / 32] + bitCount(word & (bit - 1))) * 512 + (l.z * 8 + l.y) * 8 + l.x;
}

// corner i of a cell, or the voxel of a block with index i: x fastest
ivec3 corner_at(uint i) { return ivec3(i & 1, i >> 1 & 1, i >> 2); }
ivec3 local_at(uint i) { return ivec3(i % 8, i / 8 % 8, i / 64); }
