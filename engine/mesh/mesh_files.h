// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/mesh/labels.h"
#include "engine/mesh/mesh.h"
#include "runtime/base/file.h"

namespace semrover {

// how axes of a file become the world's (x forward, y left, z up)
enum class UpAxis {
    file, // as the format says: glTF is y up (-z forward), the others are taken as z up
    y,    // y up, -z forward
    z,
};

enum class MissingTextures { refuse, white };

struct MeshReadOptions {
    UpAxis up = UpAxis::file;
    MeshLabelMap map = {};                 // of labels in the file
    double scale = 1;                      // metres in a unit of the file
    std::array<double, 3> origin = {};     // where the file's origin lies in the world, metres
    MissingTextures missing_textures = {}; // and those that cannot be read
    bool labels = true;                    // of faces and vertices are read
    bool opaque = false;                   // what is transparent is a surface, too
};

// .obj (with .mtl), .ply, .stl, .off, .glb, .gltf by extension. Untrusted input: sizes are limited before anything is
// allocated. bad_input names the file and what is wrong: a texture that is missing, indices out of range, numbers that
// are not finite. Polygons become triangles. Labels of a PLY's faces or vertices go through `map`; a GLB's material may
// say {"label": n} in its extras. Vertex colours of an OBJ or PLY that has textures are dropped. Faces that are
// transparent are left out. Positions are composed in double; a mesh that reaches further than 8192 m has an origin of
// its own. What is not needed may be missing (a .mtl), with a line in Mesh::warnings. The mesh passes check_mesh.
Result<Mesh> read_mesh(const Path& path, const MeshReadOptions& options = {});

// binary glTF 2.0, y up as the format wants it; textures inside as PNG; a face's label goes into its material: name,
// and extras {"label": n}. The same mesh gives the same bytes; atomic.
Status write_glb(const Path& path, const Mesh& mesh);

// binary little-endian PLY: x y z [red green blue]; faces with vertex_indices [label]. Textures are not written.
// Both writers are for meshes whose origin is 0.
Status write_mesh_ply(const Path& path, const Mesh& mesh);

} // namespace semrover
