// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/mesh/gltf_file.h"

#include <map>

namespace semrover {

// how a material sees texture coordinates
struct GltfTextureView {
    int64_t set = 0; // TEXCOORD_n
    double offset[2] = {0, 0}, scale[2] = {1, 1}, rotation = 0;
    uint8_t label = kNoLabel;

    std::array<float, 2> apply(double u, double v) const
    {
        const double su = scale[0] * u, sv = scale[1] * v, c = std::cos(rotation), s = std::sin(rotation);
        return {float(c * su + s * sv + offset[0]), float(c * sv - s * su + offset[1])};
    }
};

// The materials of a glTF file, read into those of a mesh, and the last one, of primitives without any. Colours,
// alpha and labels: docs/formats.md §5
class GltfMaterials {
  public:
    GltfMaterials(GltfFile& file, Mesh& mesh) : file_(file), where_(file.where()), mesh_(mesh) {}

    Status read();
    size_t count() const { return views_.size(); }
    const GltfTextureView& view(size_t material) const { return views_[material]; }
    // the same material without its textures, behind those of the file
    uint32_t untextured(uint32_t material);

  private:
    Status read_material(const Json& json, const std::string& where);
    Status read_alpha(const Json& json, const std::string& where, Material& material);
    Status read_base_color(const Json& pbr, const char* factor, const char* texture, const std::string& where,
                           Material& material, GltfTextureView& view);
    Status read_texture(const Json& info, const std::string& where, Material& material, GltfTextureView& view);
    Status read_transform(const Json& info, const std::string& where, GltfTextureView& view);
    Result<int32_t> texture_of(int64_t texture, const std::string& where);
    Result<int32_t> decoded(int64_t image, TextureWrap u, TextureWrap v);
    Result<TextureWrap> wrap_of(const Json& texture, const char* key) const;

    GltfFile& file_;
    std::string where_;
    Mesh& mesh_;
    std::vector<GltfTextureView> views_;
    std::map<uint32_t, uint32_t> untextured_;
    std::map<std::tuple<const std::byte*, TextureWrap, TextureWrap>, int32_t> textures_; // by the image's file
    TextureBudget budget_;
};

} // namespace semrover
