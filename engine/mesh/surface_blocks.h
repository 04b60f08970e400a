// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/mesh/mesh.h"
#include "engine/scene/grid.h"
#include "runtime/base/result.h"

#include <optional>
#include <span>

namespace semrover {

// A mesh's triangles by the blocks of 8^3 voxels that they touch, in portions that fit a device. What a voxel gets, and
// in which order, depends on neither the order of the mesh's faces nor the size of the portions.

// the words of kernels/mesh.h, SurfaceTriangles
struct SurfaceRecord {
    std::array<std::array<float, 3>, 3> corners; // voxels from the block's corner
    uint32_t slot, range, material_label;
};
struct SurfaceAttributes {
    std::array<std::array<float, 2>, 3> uv;
    std::array<std::array<float, 3>, 3> color; // linear
    uint32_t alphas = 0xffffff;                // of the corners, a byte each
};

struct SurfaceChunk {
    std::vector<SurfaceRecord> records;
    std::vector<SurfaceAttributes> attributes;
    std::vector<Cell> blocks; // [slots] the voxel at the block's corner
    uint64_t pairs = 0;       // of a triangle and a voxel that their boxes share: no fewer than are found exactly
};

struct SurfaceLimits { // of a portion
    uint64_t triangles = 1 << 20, pairs = 1 << 21, slots = 4096;
};

// the edge of the voxels that a mesh is cut into, in metres. Far from the origin that is the size in decimals, 0.6 and
// not 0.60000002384: the difference would add up to centimetres.
double cell_edge(const Mesh& mesh, float voxel_size);

class SurfaceBlocks {
  public:
    // labels [F]: a class or kNoSurfaceLabel. bad_input, with `where` in front, for vertices beyond 2^20 voxels, a
    // surface of more than 2^28 voxels, and large faces that make more than 2^20 pieces of a block. The mesh outlives
    // this.
    static Result<SurfaceBlocks> create(const Mesh& mesh, std::span<const uint8_t> labels, float voxel_size,
                                        std::string_view where);

    // the next portion, none after the last; bad_input if the triangles of one voxel exceed the limits
    Result<std::optional<SurfaceChunk>> next(const SurfaceLimits& limits);

    double area() const { return area_; } // of the whole mesh, m^2

  private:
    using Corners = std::array<std::array<double, 3>, 3>; // voxels; multiples of 2^-20, so that floats hold them
                                                          // exactly wherever they are seen from
    struct Piece { // of a face, at most a block wide
        uint32_t face;
        Corners corners;
        std::array<std::array<double, 3>, 3> weights; // of the face's corners
    };
    struct Instance {
        uint64_t block, order;
        uint32_t item; // a face, or faces + index of a piece
    };
    struct Part {           // cells [low, high) of a block
        size_t first, last; // instances
        std::array<uint32_t, 3> low = {0, 0, 0}, high = {8, 8, 8};
    };
    struct Walk { // voxels of a block, high included
        std::array<int, 3> low, high;
        uint64_t cells() const;
    };

    SurfaceBlocks(const Mesh& mesh, std::span<const uint8_t> labels, float voxel_size);
    Corners corners_of(uint32_t face) const;
    Cell in_grid(const Cell& cell) const;
    uint32_t rotation_of(uint32_t face) const;
    uint64_t order_of(uint32_t face) const;
    uint64_t looks_of(uint32_t item) const;
    Status check_extent(std::string_view where);
    void add_face(uint32_t face);
    void split(const Corners& whole, const Piece& piece, uint64_t order);
    void add_instances(uint32_t item, const Corners& corners, uint64_t order);
    Piece piece_of(uint32_t item) const;
    Walk walk_of(const Piece& piece, const Cell& block, const Part& part) const;
    uint32_t alphas_of(const Piece& piece) const;
    void append(const Part& part, SurfaceChunk& chunk) const;
    Part next_part();

    const Mesh* mesh_;
    std::span<const uint8_t> labels_;
    double voxel_size_, area_ = 0;
    std::array<int32_t, 3> base_{}; // voxels, whole blocks: where positions are counted from
    std::array<double, 3> rest_{};  // metres from there to the mesh's origin
    std::vector<Piece> pieces_;
    std::vector<Instance> instances_; // by block, then by their content
    std::vector<Part> pending_;       // last first
    size_t next_ = 0;                 // instance
    uint32_t ordinal_ = 0;            // of the piece of the face that is being split
};

} // namespace semrover
