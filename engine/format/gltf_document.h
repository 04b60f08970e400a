// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/rigid.h"
#include "runtime/base/json.h"

#include <span>

namespace semrover {

// a mesh of a glTF scene, and where it is: column vectors, row-major [A t; 0 1], from the mesh to the scene's y up axes
struct GltfInstance {
    uint64_t mesh = 0;
    std::array<double, 16> transform = kIdentity;
    bool repeated = false; // the node has EXT_mesh_gpu_instancing, whose places are not read here
};

// an extension of a node or primitive; null when it has none of that name
const Json* extension_of(const Json& object, const char* name);

// A binary glTF 2.0 file: its JSON, and accessors as floats. Untrusted input: every offset is checked against the
// buffer. Only what lies in the file itself is read. Source: the glTF 2.0 specification
class GltfDocument {
  public:
    static Result<GltfDocument> open(const Path& path);

    const Json& json() const { return json_; }
    // an entry of one of the document's lists; null when it is not there
    const Json* entry(const char* list, const Json& index) const;

    // meshes of the default scene (or the first, or of all nodes) that are not hidden; at most 65536
    Result<std::vector<GltfInstance>> instances() const;

    // [count, components]; normalized integers as fractions. bad_input unless the type is one of `types` ("VEC3")
    struct Values {
        size_t components = 0;
        std::vector<float> data;
        size_t count() const { return data.size() / components; }
    };
    Result<Values> read(const Json& accessor, std::initializer_list<std::string_view> types,
                        std::string_view name) const;

  private:
    Status walk(const Json& node, const std::array<double, 16>& parent, size_t depth, size_t& visits,
                std::vector<GltfInstance>& out) const;
    Result<std::span<const std::byte>> view(const Json& accessor, uint64_t& stride, std::string_view name) const;

    std::string where_;
    MappedFile file_;
    Json json_;
    std::span<const std::byte> binary_;
};

} // namespace semrover
