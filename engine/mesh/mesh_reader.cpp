// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/mesh/mesh_files.h"
#include "engine/mesh/mesh_readers.h"
#include "runtime/base/quote.h"

#include <algorithm>

namespace semrover {

namespace {

Result<Mesh> read_by_extension(const Path& path, const std::string& extension, const MeshLabelMap& map)
{
    if (extension == ".obj")
        return read_obj(path);
    if (extension == ".ply")
        return read_ply_mesh(path, map);
    if (extension == ".glb" || extension == ".gltf")
        return read_gltf(path);
    if (extension == ".stl")
        return read_stl(path);
    if (extension == ".off")
        return read_off(path);
    return fail(ErrorCode::bad_input, "{}: expected a mesh: .obj, .ply, .stl, .off, .glb or .gltf", quote_path(path));
}

} // namespace

Result<Mesh> read_mesh(const Path& path, UpAxis up, const MeshLabelMap& map)
{
    std::string extension = path.extension().string();
    std::ranges::transform(extension, extension.begin(),
                           [](char c) { return c >= 'A' && c <= 'Z' ? char(c + 32) : c; });
    SR_TRY(Mesh mesh, read_by_extension(path, extension, map));
    const bool gltf = extension == ".glb" || extension == ".gltf";
    if (up == UpAxis::y || (up == UpAxis::file && gltf))
        for (auto& p : mesh.positions) // x right, y up, z back -> x forward, y left, z up
            p = {-p[2], -p[0], p[1]};
    SR_CHECK(check_mesh(mesh, quote_path(path)));
    return mesh;
}

} // namespace semrover
