// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/mesh/mesh_files.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

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

constexpr size_t kMaxFaceCorners = 1 << 16; // of a polygon in a file; readers refuse more

// A polygon as triangles of its corners (numbers from 0), corners - 2 of them: a fan from corner 0 where it is convex,
// else by cutting ears off (Meisters 1975); a fan again for more than 256 corners, or where no ear is found.
std::vector<std::array<uint32_t, 3>> triangulated(std::span<const std::array<double, 3>> corners);

} // namespace semrover
