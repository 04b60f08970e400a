// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/mesh/labels.h"
#include "engine/mesh/mesh.h"

namespace semrover {

// one reader a format, in the file's own axes; read_mesh() turns and checks what they give
Result<Mesh> read_obj(const Path& path);
Result<Mesh> read_stl(const Path& path);
Result<Mesh> read_off(const Path& path);
Result<Mesh> read_ply_mesh(const Path& path, const MeshLabelMap& map);
Result<Mesh> read_gltf(const Path& path); // .glb or .gltf

constexpr size_t kMaxMeshElements = 1u << 28; // vertices, faces
// and of them those that a glTF makes of little: nodes repeat meshes, primitives share vertices
constexpr size_t kMaxRepeatedElements = 1u << 23;

} // namespace semrover
