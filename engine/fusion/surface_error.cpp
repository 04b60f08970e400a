// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/fusion/surface_error.h"

#include "engine/camera/camera_view.h"
#include "engine/mesh/nearest.h"
#include "engine/mesh/transparency.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

// is a depth of `z` metres within those of a pixel and its neighbours?
bool seen_at(const DepthImages& images, const Intrinsics& k, const Projection& at)
{
    if (!(at.x >= 0 && at.y >= 0 && at.x < k.width && at.y < k.height))
        return false;
    const int column = int(at.x), row = int(at.y);
    double low = 1e300, high = 0;
    for (int y = std::max(row - 1, 0); y <= std::min(row + 1, int(k.height) - 1); ++y)
        for (int x = std::max(column - 1, 0); x <= std::min(column + 1, int(k.width) - 1); ++x) {
            const double d = images.depth[size_t(y) * k.width + size_t(x)];
            if (d == 0)
                continue;
            low = std::min(low, d);
            high = std::max(high, d);
        }
    const double slack = std::max(0.1, 0.02 * at.depth);
    return at.depth >= low - slack && at.depth <= high + slack;
}

// the middle of some vertices, relative to the surface's origin
std::array<float, 4> point_of(const Mesh& mesh, std::span<const uint32_t> vertices, const std::array<double, 3>& origin)
{
    std::array<float, 4> point{};
    for (size_t axis = 0; axis < 3; ++axis) {
        double sum = 0;
        for (const uint32_t v : vertices)
            sum += mesh.positions[v][axis];
        point[axis] = float(sum / double(vertices.size()) + (mesh.origin[axis] - origin[axis]));
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

Result<std::vector<uint32_t>> count_views(const Mesh& mesh, const DepthFrames& frames)
{
    std::vector<uint32_t> views(mesh.positions.size());
    for (size_t f = 0; f < frames.cameras.size(); ++f) {
        SR_TRY(const DepthImages images, frames.load(f));
        const CameraFrame& camera = frames.cameras[f];
        for (size_t v = 0; v < views.size(); ++v) {
            const auto& p = mesh.positions[v];
            const auto& o = mesh.origin;
            const auto at = project(camera, {o[0] + p[0], o[1] + p[1], o[2] + p[2]});
            views[v] += at && seen_at(images, camera.intrinsics, *at);
        }
    }
    return views;
}

Result<SurfaceError> measure_surface(Device& device, const Mesh& mesh, const Mesh& truth,
                                     const std::vector<uint32_t>& views, uint32_t min_views, double radius)
{
    SR_ASSERT(views.empty() || views.size() == mesh.positions.size(), "views of {} vertices for {}", views.size(),
              mesh.positions.size());
    if (has_transparency(truth))
        return measure_surface(device, mesh, opaque_parts(truth).mesh, views, min_views, radius);
    std::vector<uint32_t> vertices;
    for (uint32_t v = 0; v < mesh.positions.size(); ++v)
        if (views.empty() || views[v] >= min_views)
            vertices.push_back(v);
    if (vertices.empty())
        return fail(ErrorCode::bad_input, "none of {} vertices was seen by {} frames", mesh.positions.size(),
                    min_views);
    SR_TRY(const NearestSurface surface, NearestSurface::create(device, truth));
    std::vector<std::array<float, 4>> points;
    for (const uint32_t v : vertices)
        points.push_back(point_of(mesh, {&v, 1}, surface.origin()));
    const std::vector<uint32_t> faces = labelled_faces(mesh, views, min_views);
    for (const uint32_t f : faces)
        points.push_back(point_of(mesh, mesh.faces[f], surface.origin()));
    SR_TRY(const std::vector<NearestFace> nearest, surface.find(points, float(radius)));
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
