// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/mesh/triangle_tree.h"

#include "runtime/base/result.h"

#include <algorithm>

namespace semrover {

namespace {

constexpr size_t kLeaf = 4;

// three times the centre: its order is all that matters
float center_of(const TreeTriangle& t, size_t axis)
{
    return t.corners[0][axis] + t.corners[1][axis] + t.corners[2][axis];
}

struct Span {
    size_t first, last, parent; // parent: the node whose right child this is, if there is one
    bool is_right;
};

TriangleTree::Node box_of(const std::vector<TreeTriangle>& triangles, const Span& s)
{
    const std::array<float, 3>& any = triangles[s.first].corners[0];
    TriangleTree::Node node{any, uint32_t(s.first), any, uint32_t(s.last - s.first)};
    for (size_t i = s.first; i < s.last; ++i)
        for (const auto& corner : triangles[i].corners)
            for (size_t a = 0; a < 3; ++a) {
                node.low[a] = std::min(node.low[a], corner[a]);
                node.high[a] = std::max(node.high[a], corner[a]);
            }
    return node;
}

size_t longest_axis(const TriangleTree::Node& node)
{
    size_t axis = 0;
    for (size_t a = 1; a < 3; ++a)
        if (node.high[a] - node.low[a] > node.high[axis] - node.low[axis])
            axis = a;
    return axis;
}

} // namespace

TriangleTree triangle_tree(const std::vector<TriangleCorners>& corners, uint32_t first_face)
{
    SR_ASSERT(!corners.empty(), "a tree of no triangles");
    TriangleTree tree;
    std::vector<TreeTriangle>& triangles = tree.triangles;
    for (const TriangleCorners& c : corners)
        triangles.push_back({c, first_face + uint32_t(triangles.size())});
    std::vector<Span> pending = {{0, triangles.size(), 0, false}};
    while (!pending.empty()) {
        const Span s = pending.back();
        pending.pop_back();
        const size_t at = tree.nodes.size();
        if (s.is_right)
            tree.nodes[s.parent].link = uint32_t(at);
        tree.nodes.push_back(box_of(triangles, s));
        if (s.last - s.first <= kLeaf)
            continue;
        const size_t axis = longest_axis(tree.nodes[at]), middle = (s.first + s.last) / 2;
        std::nth_element(triangles.begin() + ptrdiff_t(s.first), triangles.begin() + ptrdiff_t(middle),
                         triangles.begin() + ptrdiff_t(s.last),
                         [&](const auto& a, const auto& b) { return center_of(a, axis) < center_of(b, axis); });
        tree.nodes[at].count = 0;
        pending.push_back({middle, s.last, at, true});
        pending.push_back({s.first, middle, at, false});
    }
    return tree;
}

} // namespace semrover
