// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/rigid.h"
#include "engine/mesh/gltf_file.h"

#include <set>

namespace semrover {

using GltfMatrix = std::array<double, 16>; // row-major
constexpr GltfMatrix kGltfIdentity = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

std::array<double, 3> transformed(const GltfMatrix& m, const std::array<double, 3>& p);
double determinant(const GltfMatrix& m);

// a mesh where a node of the scene has it
struct GltfPlacement {
    int64_t mesh;
    const Json* node;
    GltfMatrix matrix; // of the node, from the mesh to the scene
};

// EXT_mesh_gpu_instancing of a node: places of its mesh, relative to the node
struct GltfInstances {
    std::optional<GltfAccessor> translation, rotation, scale;
    size_t count = 1; // one at the node itself where the node has no such extension

    GltfMatrix matrix(size_t i) const;
};

// Where nodes are: the scene's graph, instances, and joints of skins. What small files can make much of (instances,
// joints, vertices of morph targets) is counted.
class GltfPose {
  public:
    explicit GltfPose(const GltfFile& file, uint64_t most) : file_(file), where_(file.where()), most_(most) {}

    // the scene's nodes with meshes that are not hidden, depth first
    Result<std::vector<GltfPlacement>> placements();
    Result<GltfInstances> instances(const Json& node);
    // matrices of a skin's joints, each with its inverse bind matrix: from the mesh to the scene. After placements()
    Result<std::vector<GltfMatrix>> joints(int64_t skin);
    // of morph targets: the node's, else the mesh's
    Result<std::vector<double>> weights(const Json& node, const Json& mesh) const;
    Status count_work(uint64_t elements, std::string_view what);
    // those that change what a mesh is and are not known
    void note_extensions(const Json& object);

    std::vector<std::string> warnings;

  private:
    struct Pending {
        int64_t node;
        GltfMatrix parent;
        bool visible;
    };
    Result<std::vector<int64_t>> indices_in(const Json& object, const char* key) const;
    Result<std::vector<int64_t>> orphans() const;
    Result<std::vector<int64_t>> roots() const;
    Result<GltfMatrix> matrix_of(const Json& node, const std::string& where) const;
    Status push(int64_t node, const GltfMatrix& parent, bool visible);
    Status walk(const std::vector<int64_t>& from, bool visible, std::vector<GltfPlacement>& out);

    const GltfFile& file_;
    std::string where_;
    uint64_t most_, work_ = 0;
    std::vector<bool> visited_;
    std::vector<Pending> pending_;
    std::vector<GltfMatrix> matrices_; // of nodes, where the file has skins
    std::set<std::string> noted_;
};

} // namespace semrover
