// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/mesh/nearest_surface.h"

#include "kernels/mesh.h"
#include "runtime/base/result.h"
#include "runtime/device/program.h"

#include <algorithm>
#include <cmath>
#include <limits>

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

constexpr size_t kPointBatch = 1 << 20; // points at once
constexpr size_t kMostFaces = 1 << 20;  // of a tree

std::array<double, 3> middle_of(const Mesh& mesh)
{
    std::array<double, 3> low, high, middle;
    low.fill(std::numeric_limits<double>::max());
    high.fill(std::numeric_limits<double>::lowest());
    for (const auto& f : mesh.faces)
        for (const uint32_t v : f)
            for (size_t a = 0; a < 3; ++a) {
                low[a] = std::min(low[a], double(mesh.positions[v][a]));
                high[a] = std::max(high[a], double(mesh.positions[v][a]));
            }
    for (size_t a = 0; a < 3; ++a)
        middle[a] = std::round((low[a] + high[a]) / 2) + mesh.origin[a];
    return middle;
}

std::vector<TriangleCorners> corners_of(const Mesh& mesh, size_t first, size_t count,
                                        const std::array<double, 3>& origin)
{
    std::vector<TriangleCorners> corners(count);
    for (size_t f = 0; f < count; ++f)
        for (size_t c = 0; c < 3; ++c)
            for (size_t a = 0; a < 3; ++a)
                corners[f][c][a] = float(mesh.positions[mesh.faces[first + f][c]][a] + (mesh.origin[a] - origin[a]));
    return corners;
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

Result<NearestSurface> NearestSurface::create(Device& device, const Mesh& mesh)
{
    NearestSurface s(device);
    s.origin_ = middle_of(mesh);
    const size_t most = std::min<uint64_t>(kMostFaces, device.limits().max_storage_range / sizeof(TreeTriangle));
    for (size_t first = 0; first < mesh.faces.size(); first += most) {
        const size_t count = std::min(most, mesh.faces.size() - first);
        const TriangleTree tree = triangle_tree(corners_of(mesh, first, count, s.origin_), uint32_t(first));
        Tree& t = s.trees_.emplace_back();
        t.nodes = t.state.slot(uint32_t(tree.nodes.size()), 8, DType::u32, "nodes", 8);
        t.triangles = t.state.slot(uint32_t(tree.triangles.size()), 10, DType::u32, "triangles", 10);
        SR_CHECK(t.state.allocate(device, "triangles"));
        SR_CHECK(t.nodes.write(device, tree.nodes));
        SR_CHECK(t.triangles.write(device, tree.triangles));
    }
    return s;
}

Status NearestSurface::search(std::span<const std::array<float, 4>> points, std::span<NearestFace> nearest) const
{
    const auto rows = uint32_t(points.size());
    State state;
    const Slot queries = state.slot(rows, 4, DType::f32, "points", 4);
    const Slot results = state.slot(rows, 2, DType::u32, "nearest faces", 2);
    SR_CHECK(state.allocate(*device_, "points"));
    SR_CHECK(queries.write(*device_, points));
    SR_CHECK(results.write(*device_, nearest));
    Graph g;
    for (const Tree& tree : trees_)
        surface_distance(g, queries.in(g), {tree.nodes.in(g), tree.triangles.in(g)}, results.in(g));
    SR_TRY(const auto program, Program::create(*device_, g));
    SR_CHECK(program->run());
    return device_->read(results.slice(), std::as_writable_bytes(nearest));
}

Result<std::vector<NearestFace>> NearestSurface::find(std::span<const std::array<float, 4>> points, float radius) const
{
    std::vector<NearestFace> nearest(points.size(), {radius, ~0u});
    for (size_t first = 0; first < points.size(); first += kPointBatch) {
        const size_t count = std::min(kPointBatch, points.size() - first);
        SR_CHECK(search(points.subspan(first, count), std::span(nearest).subspan(first, count)));
    }
    return nearest;
}

} // namespace semrover
