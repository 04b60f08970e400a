// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/mesh/mesh_files.h"
#include "engine/mesh/mesh_readers.h"
#include "engine/mesh/transparency.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace semrover {

namespace {

constexpr double kNear = 8192;                   // metres: steps of floats are no more than 1 mm up to here
constexpr double kFurthest = 1e9, kWidest = 2e6; // metres

Result<FileMesh> read_by_extension(const Path& path, const std::string& extension, const MeshReadOptions& options)
{
    if (extension == ".obj")
        return read_obj(path, options);
    if (extension == ".ply")
        return read_ply_mesh(path, options);
    if (extension == ".glb" || extension == ".gltf")
        return read_gltf(path, options);
    if (extension == ".stl")
        return read_stl(path);
    if (extension == ".off")
        return read_off(path);
    return fail(ErrorCode::bad_input, "{}: expected a mesh: .obj, .ply, .stl, .off, .glb or .gltf", quote_path(path));
}

using Point = std::array<double, 3>;

Point in_world(Point p, bool y_up, const MeshReadOptions& o)
{
    if (y_up) // x right, y up, z back -> x forward, y left, z up
        p = {-p[2], -p[0], p[1]};
    for (size_t a = 0; a < 3; ++a)
        p[a] = p[a] * o.scale + o.origin[a];
    return p;
}

// the middle of a mesh that reaches further than floats are exact, in whole metres; else 0
Result<Point> origin_for(std::span<const Point> positions, std::string_view where)
{
    Point low, high, middle{};
    low.fill(std::numeric_limits<double>::max());
    high.fill(std::numeric_limits<double>::lowest());
    for (size_t i = 0; i < positions.size(); ++i)
        for (size_t a = 0; a < 3; ++a) {
            const double x = positions[i][a];
            if (!(std::abs(x) <= kFurthest)) // true for NaN
                return fail(ErrorCode::bad_input, "{}: vertex {} is at ({}, {}, {}), expected numbers within {:g}",
                            where, i, positions[i][0], positions[i][1], positions[i][2], kFurthest);
            low[a] = std::min(low[a], x);
            high[a] = std::max(high[a], x);
        }
    double reach = 0;
    for (size_t a = 0; a < 3 && !positions.empty(); ++a) {
        reach = std::max({reach, std::abs(low[a]), std::abs(high[a])});
        middle[a] = std::round((low[a] + high[a]) / 2);
        if (high[a] - low[a] > kWidest)
            return fail(ErrorCode::bad_input, "{}: reaches from {} to {} m, expected at most {:g} m across", where,
                        low[a], high[a], kWidest);
    }
    return reach > kNear ? middle : Point{};
}

Status place(FileMesh& file, const MeshReadOptions& options, bool y_up, std::string_view where)
{
    for (Point& p : file.positions)
        p = in_world(p, y_up, options);
    Mesh& mesh = file.mesh;
    SR_TRY(mesh.origin, origin_for(file.positions, where));
    mesh.positions.reserve(file.positions.size());
    for (const Point& p : file.positions)
        mesh.positions.push_back(
            {float(p[0] - mesh.origin[0]), float(p[1] - mesh.origin[1]), float(p[2] - mesh.origin[2])});
    file.positions = {};
    return {};
}

} // namespace

Result<Mesh> read_mesh(const Path& path, const MeshReadOptions& options)
{
    std::string extension = path.extension().string();
    std::ranges::transform(extension, extension.begin(),
                           [](char c) { return c >= 'A' && c <= 'Z' ? char(c + 32) : c; });
    SR_TRY(FileMesh file, read_by_extension(path, extension, options));
    const std::string where = quote_path(path);
    const bool gltf = extension == ".glb" || extension == ".gltf";
    SR_CHECK(place(file, options, options.up == UpAxis::y || (options.up == UpAxis::file && gltf), where));
    Mesh& mesh = file.mesh;
    if (options.opaque)
        for (Material& m : mesh.materials)
            m.alpha_cutoff = 0;
    SR_CHECK(check_mesh(mesh, where));
    SR_CHECK(drop_transparent(mesh, where));
    return std::move(mesh);
}

} // namespace semrover
