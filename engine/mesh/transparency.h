// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/mesh/mesh.h"

namespace semrover {

// where a mesh has no surface: Material::alpha_cutoff

// whether alpha decides anything in the mesh
bool has_transparency(const Mesh& mesh);

// alpha that the texture times the vertices must reach for a surface; 0: all of the material is one
float alpha_threshold(const Material& material);

// whether there is a surface at a place of a face, by the weights of its corners
bool has_surface(const Mesh& mesh, size_t face, const std::array<double, 3>& weights);

// Leaves out faces that have no surface anywhere, with a line in Mesh::warnings that says how much of which material;
// materials that are opaque after all lose their cutoff. bad_input, with `where` in front, if no face is left
Status drop_transparent(Mesh& mesh, std::string_view where);

// The mesh in pieces that have a surface or do not, and only the former: for what knows triangles only. Pieces are 2 cm
// wide, or so wide that there are about 2^21 of them. Vertices that no face has any more are left out.
struct OpaqueParts {
    Mesh mesh;
    std::vector<uint32_t> sources; // [F] the face that each is of
};
OpaqueParts opaque_parts(const Mesh& mesh);

} // namespace semrover
