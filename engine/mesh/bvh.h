// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace semrover {

// A binary tree of boxes over triangles, flat for the GPU. A node holds the boxes of its two children:
//   left low xyz, left reference; left high xyz, right reference; right low xyz, 0; right high xyz, 0
// A reference is the number of an inner node, or kBvhLeaf | count << 28 | first, of triangles in `order`; a leaf
// without triangles may be entered and holds nothing. Node 0 is the root and always there. No path is longer than
// kBvhDepth.
struct Bvh {
    std::vector<std::array<uint32_t, 16>> nodes; // floats as bits, and references
    std::vector<uint32_t> order;                 // [T] triangles by leaf
};

constexpr uint32_t kBvhLeaf = 1u << 31, kBvhLeafTriangles = 4, kBvhDepth = 48;

// Binned surface area heuristic (Wald, "On fast construction of SAH-based bounding volume hierarchies", 2007): 16 bins
// an axis; halves by number where the tree grows deep or centres fall together. The same triangles give the same tree.
// At most 2^28 - 1 triangles (asserted); positions must be finite.
Bvh build_bvh(std::span<const std::array<float, 3>> positions, std::span<const std::array<uint32_t, 3>> faces);

} // namespace semrover
