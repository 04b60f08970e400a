// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/mesh/nearest.h"

#include "engine/mesh/bvh.h"
#include "kernels/mesh.h"
#include "runtime/device/executable.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace semrover {

namespace {

constexpr size_t kPointBatch = 1 << 20; // points at once
constexpr size_t kMostFaces = 1 << 20;  // of a tree
constexpr uint64_t kFaceBytes = 64;     // in its larger array: a node has two faces at least

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

using Positions = std::vector<std::array<float, 3>>;

Positions positions_from(const Mesh& mesh, const std::array<double, 3>& origin)
{
    Positions positions = mesh.positions;
    for (auto& p : positions)
        for (size_t a = 0; a < 3; ++a)
            p[a] = float(p[a] + (mesh.origin[a] - origin[a]));
    return positions;
}

// as kernels/mesh.h, SurfaceTree, has them
std::vector<uint32_t> rows_of(std::span<const uint32_t> order, const Positions& positions, const Mesh& mesh,
                              size_t first_face)
{
    std::vector<uint32_t> rows;
    rows.reserve(order.size() * 10);
    for (const uint32_t t : order) {
        for (const uint32_t v : mesh.faces[first_face + t])
            for (const float x : positions[v])
                rows.push_back(std::bit_cast<uint32_t>(x));
        rows.push_back(uint32_t(first_face) + t);
    }
    return rows;
}

} // namespace

Result<NearestSurface> NearestSurface::create(Device& device, const Mesh& mesh)
{
    NearestSurface s(device);
    s.origin_ = middle_of(mesh);
    const Positions positions = positions_from(mesh, s.origin_);
    const size_t most = std::min<uint64_t>(kMostFaces, device.limits().max_storage_range / kFaceBytes);
    for (size_t first = 0; first < mesh.faces.size(); first += most) {
        const size_t count = std::min(most, mesh.faces.size() - first);
        const Bvh tree = build_bvh(positions, std::span(mesh.faces).subspan(first, count));
        Tree& t = s.trees_.emplace_back();
        t.nodes = t.state.tensor(uint32_t(tree.nodes.size()), 16, DType::u32, "nodes", 16);
        t.triangles = t.state.tensor(uint32_t(count), 10, DType::u32, "triangles", 10);
        SR_CHECK(t.state.allocate(device, "triangles"));
        SR_CHECK(t.nodes.write(device, tree.nodes));
        SR_CHECK(t.triangles.write(device, rows_of(tree.order, positions, mesh, first)));
    }
    return s;
}

Status NearestSurface::search(std::span<const std::array<float, 4>> points, std::span<NearestFace> nearest) const
{
    const auto rows = uint32_t(points.size());
    TensorPool state;
    const DeviceTensor queries = state.tensor(rows, 4, DType::f32, "points", 4);
    const DeviceTensor results = state.tensor(rows, 2, DType::u32, "nearest faces", 2);
    SR_CHECK(state.allocate(*device_, "points"));
    SR_CHECK(queries.write(*device_, points));
    SR_CHECK(results.write(*device_, nearest));
    Graph g(device_->limits());
    for (const Tree& tree : trees_)
        surface_distance(g, queries.in(g), {tree.nodes.in(g), tree.triangles.in(g)}, results.in(g));
    SR_TRY(const auto executable, Executable::create(*device_, g));
    SR_CHECK(executable->run());
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
