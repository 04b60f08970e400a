// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/image.h"
#include "engine/scene/palette.h"

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace semrover {

enum class TextureWrap : uint8_t { repeat, mirror, clamp };

struct Texture {
    ImageRgb8 image; // sRGB
    TextureWrap wrap_u = TextureWrap::repeat, wrap_v = TextureWrap::repeat;
    std::vector<uint8_t> alpha = {};    // [height, width], or empty: opaque
    std::vector<uint16_t> numbers = {}; // [height, width] of a label texture; empty: its colours or grays say them
};

struct Material {
    std::string name;
    std::array<float, 3> color = {1, 1, 1}; // linear, 0..1; multiplies texture and vertex colours (glTF)
    int32_t texture = -1;                   // index into Mesh::textures; -1: none
    int32_t label_texture = -1;             // likewise: colours of classes, or numbers; nearest
    // There is a surface where alpha (the material's times the texture's nearest texel times the vertices') reaches
    // the cutoff; 0: everywhere
    float alpha_cutoff = 0, alpha = 1;
    int32_t alpha_texture = -1; // index likewise, of a texture with alpha
};

// A triangle mesh in the world's frame: metres, x forward, y left, z up. Optional arrays are empty when absent.
struct Mesh {
    std::array<double, 3> origin{};              // of the positions, in the world: not 0 where floats are too coarse
    std::vector<std::array<float, 3>> positions; // [V] from the origin
    std::vector<std::array<uint8_t, 3>> colors;  // [V] sRGB, or empty
    std::vector<uint8_t> alphas;                 // [V], or empty: opaque
    std::vector<std::array<uint32_t, 3>> faces;  // [F] < V, counter-clockwise seen from outside
    std::vector<std::array<std::array<float, 2>, 3>>
        uvs;                              // [F] per corner, or empty; v = 0 is the image's top row (glTF)
    std::vector<uint32_t> face_materials; // [F] < materials.size(), or empty
    std::vector<uint8_t> face_labels;     // [F] class or kNoLabel, or empty
    std::vector<Material> materials;
    std::vector<Texture> textures;
    std::vector<std::string> warnings; // a line each: what its file lacks, or has no place here
};

double face_area(const Mesh& mesh, size_t face); // m^2

// adds a line to warnings: each once, and no more than a screen of them
void add_warning(std::vector<std::string>& warnings, std::string line);

// bad_input, with `where` in front, for: no faces, indices out of range, positions or texture coordinates that are not
// finite or beyond 1e6 m, arrays that disagree in size, labels that are neither a class nor kNoLabel (listed with
// counts). Degenerate faces are allowed: they have no area.
Status check_mesh(const Mesh& mesh, std::string_view where);

} // namespace semrover
