// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/mesh/mesh_files.h"

namespace semrover {

// what a reader gives: Mesh::positions are still empty, the file's own are in its axes and units
struct FileMesh {
    Mesh mesh;
    std::vector<std::array<double, 3>> positions; // [V]
};

// one reader a format; read_mesh() turns, moves and checks what they give
Result<FileMesh> read_obj(const Path& path, const MeshReadOptions& options);
Result<FileMesh> read_stl(const Path& path);
Result<FileMesh> read_off(const Path& path);
Result<FileMesh> read_ply_mesh(const Path& path, const MeshReadOptions& options);
Result<FileMesh> read_gltf(const Path& path, const MeshReadOptions& options); // .glb or .gltf

constexpr size_t kMaxMeshElements = 1u << 28; // vertices, faces
// and of them those that a glTF makes of little: nodes repeat meshes, primitives share vertices
constexpr size_t kMaxRepeatedElements = 1u << 23;

} // namespace semrover
