// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/fusion/surface_error.h"

#include "kernels/fusion.h"
#include "kernels/kernels.h"
#include "runtime/program.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace semrover {

namespace {

constexpr double kMaxCells = 4e6;
constexpr uint32_t kPointsAtATime = 1u << 18;

// triangles by the cells of a grid that their boxes reach into, relative to `origin`
struct HostFaceGrid {
    Point3 origin{};
    std::array<uint32_t, 3> cells{};
    float cell_size = 0;
    std::vector<std::array<float, 4>> corners; // [F * 3]
    std::vector<uint32_t> starts, members;
};

// two boxes of cells that a triangle reaches into, a little more than its own so that rounding loses nothing
std::pair<std::array<uint32_t, 3>, std::array<uint32_t, 3>> reach_of(const HostFaceGrid& g, size_t face)
{
    std::array<uint32_t, 3> low, high;
    for (size_t axis = 0; axis < 3; ++axis) {
        const float a = g.corners[3 * face][axis], b = g.corners[3 * face + 1][axis], c = g.corners[3 * face + 2][axis];
        const float slack = 1e-3f * g.cell_size;
        const auto cell = [&](float x) {
            return uint32_t(std::clamp(std::floor(x / g.cell_size), 0.f, float(g.cells[axis] - 1)));
        };
        low[axis] = cell(std::min({a, b, c}) - slack);
        high[axis] = cell(std::max({a, b, c}) + slack);
    }
    return {low, high};
}

// may the plane of a triangle pass through a cell? Long triangles at an angle reach into few cells of their box.
class PlaneTest {
  public:
    PlaneTest(const HostFaceGrid& g, size_t face) : cell_size_(g.cell_size)
    {
        std::array<double, 3> u, v;
        for (size_t axis = 0; axis < 3; ++axis) {
            corner_[axis] = g.corners[3 * face][axis];
            u[axis] = double(g.corners[3 * face + 1][axis]) - corner_[axis];
            v[axis] = double(g.corners[3 * face + 2][axis]) - corner_[axis];
        }
        normal_ = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
    }
    bool passes(uint32_t x, uint32_t y, uint32_t z) const
    {
        const std::array<uint32_t, 3> cell = {x, y, z};
        double distance = 0, reach = 0;
        for (size_t axis = 0; axis < 3; ++axis) {
            distance += normal_[axis] * ((cell[axis] + 0.5) * cell_size_ - corner_[axis]);
            reach += std::abs(normal_[axis]) * cell_size_ * 0.51;
        }
        return std::abs(distance) <= reach; // true where the normal is 0
    }

  private:
    double cell_size_;
    std::array<double, 3> corner_{}, normal_{};
};

template <typename Visit>
void for_cells(const HostFaceGrid& g, Visit&& visit)
{
    for (size_t face = 0; face < g.corners.size() / 3; ++face) {
        const auto [low, high] = reach_of(g, face);
        const PlaneTest plane(g, face);
        for (uint32_t z = low[2]; z <= high[2]; ++z)
            for (uint32_t y = low[1]; y <= high[1]; ++y)
                for (uint32_t x = low[0]; x <= high[0]; ++x)
                    if (plane.passes(x, y, z))
                        visit((z * g.cells[1] + y) * g.cells[0] + x, uint32_t(face));
    }
}

HostFaceGrid make_grid(const Mesh& truth)
{
    HostFaceGrid g;
    Point3 low, high;
    low.fill(1e300);
    high.fill(-1e300);
    for (const auto& face : truth.faces)
        for (const uint32_t v : face)
            for (size_t axis = 0; axis < 3; ++axis) {
                low[axis] = std::min(low[axis], double(truth.positions[v][axis]));
                high[axis] = std::max(high[axis], double(truth.positions[v][axis]));
            }
    g.origin = low;
    double size = 0.4; // metres
    const auto count = [&](size_t axis) { return std::floor((high[axis] - low[axis]) / size) + 1; };
    while (count(0) * count(1) * count(2) > kMaxCells)
        size *= 1.25;
    g.cell_size = float(size);
    for (size_t axis = 0; axis < 3; ++axis)
        g.cells[axis] = uint32_t(count(axis));
    for (const auto& face : truth.faces)
        for (const uint32_t v : face) {
            auto& corner = g.corners.emplace_back();
            for (size_t axis = 0; axis < 3; ++axis)
                corner[axis] = float(double(truth.positions[v][axis]) - low[axis]);
        }
    g.starts.resize(size_t(g.cells[0]) * g.cells[1] * g.cells[2] + 1);
    for_cells(g, [&](uint32_t cell, uint32_t) { ++g.starts[cell + 1]; });
    for (size_t i = 1; i < g.starts.size(); ++i)
        g.starts[i] += g.starts[i - 1];
    g.members.resize(std::max<size_t>(g.starts.back(), 1));
    std::vector<uint32_t> next(g.starts.begin(), g.starts.end() - 1);
    for_cells(g, [&](uint32_t cell, uint32_t face) { g.members[next[cell]++] = face; });
    return g;
}

struct Nearest {
    float distance;
    uint32_t face;
};

// answers for points relative to the grid's origin
Result<std::vector<Nearest>> find_nearest(Device& device, const HostFaceGrid& grid,
                                          const std::vector<std::array<float, 4>>& points, float radius)
{
    Arena memory;
    const uint32_t batch = uint32_t(std::min<size_t>(points.size(), kPointsAtATime));
    const std::array<std::span<const std::byte>, 3> tables = {std::as_bytes(std::span(grid.corners)),
                                                              std::as_bytes(std::span(grid.starts)),
                                                              std::as_bytes(std::span(grid.members))};
    for (const auto& table : tables)
        memory.add(table.size());
    memory.add(batch * 16ull);
    memory.add(batch * 8ull);
    SR_CHECK(memory.allocate(device, "true surface"));
    for (uint32_t i = 0; i < tables.size(); ++i)
        SR_CHECK(device.write(memory.slice(i).part(0, tables[i].size()), tables[i]));
    Graph g;
    const auto array = [&](uint32_t slice, size_t rows, uint32_t width, DType dtype, const char* name) {
        return g.external(memory.slice(slice), uint32_t(rows), width, dtype, name, width);
    };
    const FaceGrid faces{array(0, grid.corners.size(), 4, DType::f32, "corners"),
                         array(1, grid.starts.size(), 1, DType::u32, "starts"),
                         array(2, grid.members.size(), 1, DType::u32, "members"),
                         grid.cells,
                         {},
                         grid.cell_size};
    const Tensor nearest = nearest_face(g, array(3, batch, 4, DType::f32, "points"), faces, radius);
    g.replace(nearest.resource, array(4, batch, 2, DType::u32, "nearest").resource);
    SR_TRY(const auto program, Program::create(device, g));
    std::vector<Nearest> out(points.size());
    for (size_t first = 0; first < points.size(); first += batch) {
        const size_t count = std::min<size_t>(batch, points.size() - first);
        SR_CHECK(
            device.write(memory.slice(3).part(0, count * 16), std::as_bytes(std::span(points).subspan(first, count))));
        SR_CHECK(program->run());
        SR_CHECK(device.read(memory.slice(4).part(0, count * 8),
                             std::as_writable_bytes(std::span(out).subspan(first, count))));
    }
    return out;
}

// is a depth of `z` metres within those of a pixel and its neighbours?
bool seen_at(const DepthImages& images, const Intrinsics& k, const Projection& at, double depth_scale)
{
    if (!(at.x >= 0 && at.y >= 0 && at.x < k.width && at.y < k.height))
        return false;
    const int column = int(at.x), row = int(at.y);
    double low = 1e300, high = 0;
    for (int y = std::max(row - 1, 0); y <= std::min(row + 1, int(k.height) - 1); ++y)
        for (int x = std::max(column - 1, 0); x <= std::min(column + 1, int(k.width) - 1); ++x) {
            const uint16_t d = images.depth[size_t(y) * k.width + size_t(x)];
            if (d == 0 || d == 65535)
                continue;
            low = std::min(low, d * depth_scale);
            high = std::max(high, d * depth_scale);
        }
    const double slack = std::max(0.1, 0.02 * at.depth);
    return at.depth >= low - slack && at.depth <= high + slack;
}

// the middle of some vertices, relative to the grid's origin
std::array<float, 4> point_of(const Mesh& mesh, std::span<const uint32_t> vertices, const std::array<double, 3>& origin)
{
    std::array<float, 4> point{};
    for (size_t axis = 0; axis < 3; ++axis) {
        double sum = 0;
        for (const uint32_t v : vertices)
            sum += mesh.positions[v][axis];
        point[axis] = float(sum / double(vertices.size()) - origin[axis]);
    }
    return point;
}

// those whose corners were all seen
std::vector<uint32_t> labelled_faces(const Mesh& mesh, const std::vector<uint32_t>& views, uint32_t min_views)
{
    std::vector<uint32_t> faces;
    const auto seen = [&](uint32_t v) { return views.empty() || views[v] >= min_views; };
    for (uint32_t f = 0; f < mesh.face_labels.size(); ++f)
        if (std::ranges::all_of(mesh.faces[f], seen))
            faces.push_back(f);
    return faces;
}

double percentile_of(std::vector<float> values, double share)
{
    if (values.empty())
        return 0;
    const auto at = values.begin() + std::ptrdiff_t(double(values.size() - 1) * share);
    std::nth_element(values.begin(), at, values.end());
    return *at;
}

} // namespace

double SurfaceError::percentile(double share) const
{
    return percentile_of(distances, share);
}

double SurfaceError::percentile(double share, uint8_t label) const
{
    std::vector<float> of_class;
    for (size_t i = 0; i < distances.size(); ++i)
        if (classes[i] == label)
            of_class.push_back(distances[i]);
    return percentile_of(std::move(of_class), share);
}

Result<std::vector<uint32_t>> count_views(const Mesh& mesh, const DepthFrames& frames, const ViewOptions& options)
{
    std::vector<uint32_t> views(mesh.positions.size());
    for (size_t f = 0; f < frames.cameras.size(); ++f) {
        SR_TRY(const DepthImages images, frames.load(f));
        const CameraFrame& camera = frames.cameras[f];
        for (size_t v = 0; v < views.size(); ++v) {
            const auto& p = mesh.positions[v];
            const auto at = project(camera, {p[0], p[1], p[2]});
            views[v] += at && seen_at(images, camera.intrinsics, *at, options.depth_scale);
        }
    }
    return views;
}

Result<SurfaceError> measure_surface(Device& device, const Mesh& mesh, const Mesh& truth,
                                     const std::vector<uint32_t>& views, uint32_t min_views, double radius)
{
    SR_ASSERT(views.empty() || views.size() == mesh.positions.size(), "views of {} vertices for {}", views.size(),
              mesh.positions.size());
    const HostFaceGrid grid = make_grid(truth);
    std::vector<uint32_t> vertices;
    for (uint32_t v = 0; v < mesh.positions.size(); ++v)
        if (views.empty() || views[v] >= min_views)
            vertices.push_back(v);
    if (vertices.empty())
        return fail(ErrorCode::bad_input, "none of {} vertices was seen by {} frames", mesh.positions.size(),
                    min_views);
    std::vector<std::array<float, 4>> points;
    for (const uint32_t v : vertices)
        points.push_back(point_of(mesh, {&v, 1}, grid.origin));
    const std::vector<uint32_t> faces = labelled_faces(mesh, views, min_views);
    for (const uint32_t f : faces)
        points.push_back(point_of(mesh, mesh.faces[f], grid.origin));
    SR_TRY(const std::vector<Nearest> nearest, find_nearest(device, grid, points, float(radius)));
    const auto label_at = [&](size_t i) {
        const bool known = nearest[i].face != ~0u && !truth.face_labels.empty();
        return known ? truth.face_labels[nearest[i].face] : kNoLabel;
    };
    SurfaceError error;
    error.vertices = mesh.positions.size();
    for (size_t i = 0; i < vertices.size(); ++i) {
        error.distances.push_back(nearest[i].distance);
        error.beyond += nearest[i].face == ~0u;
        error.classes.push_back(label_at(i));
    }
    for (size_t i = 0; i < faces.size(); ++i) {
        const uint8_t expected = label_at(vertices.size() + i), found = mesh.face_labels[faces[i]];
        if (expected == kNoLabel)
            continue;
        const double area = face_area(mesh, faces[i]);
        error.labelled += area;
        error.right += expected == found ? area : 0;
        error.confusion[expected][found] += area;
    }
    return error;
}

} // namespace semrover
