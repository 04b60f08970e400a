// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/mesh/surface_blocks.h"

#include "engine/scene/cell_reach.h"
#include "engine/scene/srgb.h"
#include "kernels/mesh.h"
#include "kernels/network.h"
#include "runtime/base/keyed_random.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace semrover {

namespace {

constexpr double kStep = 1 << 20;         // steps of a voxel that positions are rounded to
constexpr double kMaxCell = 1 << 20;      // as in grids
constexpr double kMaxCells = 1 << 28;     // of the whole surface
constexpr int kEdge = int(kSurfaceBlock); // voxels
constexpr size_t kMaxPieces = 1 << 20;    // of all faces, 152 bytes each

using Vector = std::array<double, 3>;

double area_of(const Vector& a, const Vector& b, const Vector& c)
{
    Vector u, v;
    for (size_t i = 0; i < 3; ++i) {
        u[i] = b[i] - a[i];
        v[i] = c[i] - a[i];
    }
    return std::hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]) / 2;
}

double extent_of(const std::array<Vector, 3>& p)
{
    double extent = 0;
    for (size_t axis = 0; axis < 3; ++axis) {
        const auto [low, high] = std::minmax({p[0][axis], p[1][axis], p[2][axis]});
        extent = std::max(extent, high - low);
    }
    return extent;
}

// over a running value
uint64_t mixed(uint64_t h, uint64_t v)
{
    return mix64((h ^ v) + kMixStep);
}

// blocks lie within +-2^17, so that an index fits 20 bits
uint64_t block_key(const std::array<int64_t, 3>& b)
{
    uint64_t key = 0;
    for (const int64_t i : b)
        key = key << 20 | uint64_t(i + (1 << 19));
    return key;
}

Cell corner_of(uint64_t key)
{
    Cell corner;
    for (size_t axis = 0; axis < 3; ++axis)
        corner[axis] = (int32_t(key >> (20 * (2 - axis)) & 0xfffff) - (1 << 19)) * kEdge;
    return corner;
}

} // namespace

double cell_edge(const Mesh& mesh, float voxel_size)
{
    return mesh.origin == std::array<double, 3>{} ? double(voxel_size) : decimal_voxel_size(voxel_size);
}

SurfaceBlocks::SurfaceBlocks(const Mesh& mesh, std::span<const uint8_t> labels, float voxel_size)
    : mesh_(&mesh), labels_(labels), voxel_size_(cell_edge(mesh, voxel_size))
{
    for (size_t a = 0; a < 3; ++a) { // a base beyond the grid is found with the faces
        const double block = std::floor(mesh.origin[a] / voxel_size_ / kEdge);
        base_[a] = int32_t(std::clamp(block, -kMaxCell, kMaxCell)) * kEdge;
        rest_[a] = mesh.origin[a] - base_[a] * voxel_size_;
    }
}

Cell SurfaceBlocks::in_grid(const Cell& cell) const
{
    return {cell[0] + base_[0], cell[1] + base_[1], cell[2] + base_[2]};
}

uint64_t SurfaceBlocks::Walk::cells() const
{
    uint64_t n = 1;
    for (size_t a = 0; a < 3; ++a)
        n *= uint64_t(std::max(high[a] - low[a] + 1, 0));
    return n;
}

// the corner that comes first: the face looks the same whichever corner the file starts with
uint32_t SurfaceBlocks::rotation_of(uint32_t face) const
{
    const auto& f = mesh_->faces[face];
    uint32_t first = 0;
    for (uint32_t i = 1; i < 3; ++i)
        if (mesh_->positions[f[i]] < mesh_->positions[f[first]])
            first = i;
    return first;
}

SurfaceBlocks::Corners SurfaceBlocks::corners_of(uint32_t face) const
{
    const uint32_t rotation = rotation_of(face);
    Corners corners;
    for (uint32_t i = 0; i < 3; ++i)
        for (size_t a = 0; a < 3; ++a)
            corners[i][a] =
                std::round((double(mesh_->positions[mesh_->faces[face][(i + rotation) % 3]][a]) + rest_[a]) /
                           voxel_size_ * kStep) /
                kStep;
    return corners;
}

// a number that stands for where the face is, but not for its place in the file
uint64_t SurfaceBlocks::order_of(uint32_t face) const
{
    const uint32_t rotation = rotation_of(face);
    uint64_t h = 0;
    for (uint32_t i = 0; i < 3; ++i)
        for (const float x : mesh_->positions[mesh_->faces[face][(i + rotation) % 3]])
            h = mixed(h, std::bit_cast<uint32_t>(x));
    return h;
}

// and one for what else it is, which only faces in the same place need
uint64_t SurfaceBlocks::looks_of(uint32_t item) const
{
    const uint32_t face = item < mesh_->faces.size() ? item : pieces_[item - mesh_->faces.size()].face;
    const uint32_t rotation = rotation_of(face);
    uint64_t h = mixed(labels_[face], mesh_->face_materials.empty() ? 0 : mesh_->face_materials[face]);
    for (uint32_t i = 0; i < 3; ++i) {
        const uint32_t corner = (i + rotation) % 3;
        if (!mesh_->uvs.empty())
            for (const float x : mesh_->uvs[face][corner])
                h = mixed(h, std::bit_cast<uint32_t>(x));
        if (!mesh_->colors.empty())
            for (const uint8_t x : mesh_->colors[mesh_->faces[face][corner]])
                h = mixed(h, x);
        if (!mesh_->alphas.empty())
            h = mixed(h, mesh_->alphas[mesh_->faces[face][corner]]);
    }
    return h;
}

Status SurfaceBlocks::check_extent(std::string_view where)
{
    double cells = 0;
    for (uint32_t f = 0; f < mesh_->faces.size(); ++f) {
        const Corners c = corners_of(f);
        for (const Vector& p : c)
            for (size_t a = 0; a < 3; ++a)
                if (const double x = p[a] + base_[a]; std::abs(x) >= kMaxCell)
                    return fail(ErrorCode::bad_input,
                                "{}: face {} reaches {:.6g} m, beyond 2^20 voxels of {} m; move it to the origin "
                                "(`origin`), or take a larger voxel size",
                                where, f, x * voxel_size_, float(voxel_size_));
        const double area = area_of(c[0], c[1], c[2]);
        area_ += area * voxel_size_ * voxel_size_;
        cells += area > 0 ? area + extent_of(c) : 0;
    }
    if (cells > kMaxCells)
        return fail(ErrorCode::bad_input,
                    "{}: the surface crosses about {:.3g} voxels of {} m, at most {:.3g} are supported; take a larger "
                    "voxel size",
                    where, cells, float(voxel_size_), kMaxCells);
    return {};
}

void SurfaceBlocks::add_instances(uint32_t item, const Corners& c, uint64_t order)
{
    std::array<int64_t, 3> low, high, b;
    for (size_t a = 0; a < 3; ++a) {
        const auto [least, most] = std::minmax({c[0][a], c[1][a], c[2][a]});
        low[a] = int64_t(std::floor(least / kEdge));
        high[a] = int64_t(std::floor(most / kEdge));
    }
    for (b[0] = low[0]; b[0] <= high[0]; ++b[0])
        for (b[1] = low[1]; b[1] <= high[1]; ++b[1])
            for (b[2] = low[2]; b[2] <= high[2]; ++b[2])
                instances_.push_back({block_key(b), order, item});
}

// halves along the longest edge until a piece is at most a block wide; stops where there are too many
void SurfaceBlocks::split(const Corners& whole, const Piece& piece, uint64_t order)
{
    if (pieces_.size() > kMaxPieces)
        return;
    if (extent_of(piece.corners) <= kEdge) {
        if (area_of(piece.corners[0], piece.corners[1], piece.corners[2]) > 0) {
            pieces_.push_back(piece);
            add_instances(uint32_t(mesh_->faces.size() + pieces_.size() - 1), piece.corners, mixed(order, ++ordinal_));
        }
        return;
    }
    const auto length = [&](size_t i) {
        const Vector &a = piece.corners[i], &b = piece.corners[(i + 1) % 3];
        return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
    };
    size_t longest = 0;
    for (size_t i = 1; i < 3; ++i)
        if (length(i) > length(longest))
            longest = i;
    Vector weights, middle{};
    for (size_t k = 0; k < 3; ++k)
        weights[k] = (piece.weights[longest][k] + piece.weights[(longest + 1) % 3][k]) / 2;
    for (size_t a = 0; a < 3; ++a) {
        for (size_t k = 0; k < 3; ++k)
            middle[a] += weights[k] * whole[k][a];
        middle[a] = std::round(middle[a] * kStep) / kStep;
    }
    for (const size_t replaced : {(longest + 1) % 3, longest}) {
        Piece half = piece;
        half.corners[replaced] = middle;
        half.weights[replaced] = weights;
        split(whole, half, order);
    }
}

void SurfaceBlocks::add_face(uint32_t face)
{
    const Corners c = corners_of(face);
    if (!(area_of(c[0], c[1], c[2]) > 0))
        return;
    if (extent_of(c) <= kEdge)
        return add_instances(face, c, order_of(face));
    ordinal_ = 0;
    split(c, {face, c, {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}}, order_of(face));
}

Result<SurfaceBlocks> SurfaceBlocks::create(const Mesh& mesh, std::span<const uint8_t> labels, float voxel_size,
                                            std::string_view where)
{
    SR_ASSERT(labels.size() == mesh.faces.size() && mesh.faces.size() < 1u << 31, "{} labels for {} faces",
              labels.size(), mesh.faces.size());
    SurfaceBlocks blocks(mesh, labels, voxel_size);
    SR_CHECK(blocks.check_extent(where));
    for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
        blocks.add_face(f);
        if (blocks.pieces_.size() > kMaxPieces)
            return fail(ErrorCode::bad_input,
                        "{}: face {} of {:.4g} m^2 and those before it are cut into more than {} pieces of {} voxels; "
                        "take a larger voxel size",
                        where, f, face_area(mesh, f), kMaxPieces, kEdge);
    }
    std::ranges::sort(blocks.instances_, [&](const Instance& a, const Instance& b) {
        if (a.block != b.block || a.order != b.order)
            return std::tie(a.block, a.order) < std::tie(b.block, b.order);
        const uint64_t looks_a = blocks.looks_of(a.item), looks_b = blocks.looks_of(b.item);
        return looks_a != looks_b ? looks_a < looks_b : a.item < b.item;
    });
    return blocks;
}

SurfaceBlocks::Piece SurfaceBlocks::piece_of(uint32_t item) const
{
    const size_t faces = mesh_->faces.size();
    if (item >= faces)
        return pieces_[item - faces];
    return {item, corners_of(item), {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}};
}

SurfaceBlocks::Walk SurfaceBlocks::walk_of(const Piece& piece, const Cell& block, const Part& part) const
{
    Walk walk;
    for (size_t a = 0; a < 3; ++a) {
        const auto [low, high] = std::minmax({piece.corners[0][a], piece.corners[1][a], piece.corners[2][a]});
        walk.low[a] = std::max(int(std::floor(low - block[a])), int(part.low[a]));
        walk.high[a] = std::min(int(std::floor(high - block[a])), int(part.high[a]) - 1);
    }
    return walk;
}

// of a piece's corners
uint32_t SurfaceBlocks::alphas_of(const Piece& piece) const
{
    const uint32_t rotation = rotation_of(piece.face);
    uint32_t packed = 0;
    for (uint32_t c = 0; c < 3; ++c) {
        double alpha = 0;
        for (uint32_t k = 0; k < 3; ++k)
            alpha += piece.weights[c][k] * mesh_->alphas[mesh_->faces[piece.face][(k + rotation) % 3]];
        packed |= uint32_t(std::lround(alpha)) << (8 * c);
    }
    return packed;
}

// the part's triangles as a new slot
void SurfaceBlocks::append(const Part& part, SurfaceChunk& chunk) const
{
    const Cell block = corner_of(instances_[part.first].block);
    const auto& l = part.low;
    const auto& h = part.high;
    const uint32_t range = l[0] | l[1] << 4 | l[2] << 8 | h[0] << 12 | h[1] << 16 | h[2] << 20;
    for (size_t i = part.first; i < part.last; ++i) {
        const Piece piece = piece_of(instances_[i].item);
        const uint64_t cells = walk_of(piece, block, part).cells();
        if (!cells)
            continue;
        chunk.pairs += cells;
        const uint32_t material = mesh_->face_materials.empty() ? 0 : mesh_->face_materials[piece.face];
        SurfaceRecord r{{}, uint32_t(chunk.blocks.size()), range, material | uint32_t(labels_[piece.face]) << 24};
        SurfaceAttributes at{};
        const uint32_t rotation = rotation_of(piece.face);
        for (size_t c = 0; c < 3; ++c) {
            for (size_t a = 0; a < 3; ++a)
                r.corners[c][a] = float(piece.corners[c][a] - block[a]);
            std::array<double, 2> uv{};
            Vector color{};
            for (size_t k = 0; k < 3; ++k) {
                const uint32_t corner = (k + rotation) % 3, v = mesh_->faces[piece.face][corner];
                for (size_t a = 0; a < 2 && !mesh_->uvs.empty(); ++a)
                    uv[a] += piece.weights[c][k] * mesh_->uvs[piece.face][corner][a];
                for (size_t a = 0; a < 3; ++a)
                    color[a] += piece.weights[c][k] * (mesh_->colors.empty() ? 1 : kLinear[mesh_->colors[v][a]]);
            }
            at.uv[c] = {float(uv[0]), float(uv[1])};
            at.color[c] = {float(color[0]), float(color[1]), float(color[2])};
        }
        if (!mesh_->alphas.empty())
            at.alphas = alphas_of(piece);
        chunk.records.push_back(r);
        chunk.attributes.push_back(at);
    }
    chunk.blocks.push_back(in_grid(block));
}

SurfaceBlocks::Part SurfaceBlocks::next_part()
{
    if (!pending_.empty()) {
        const Part part = pending_.back();
        pending_.pop_back();
        return part;
    }
    Part part{next_, next_};
    while (next_ < instances_.size() && instances_[next_].block == instances_[part.first].block)
        ++next_;
    part.last = next_;
    return part;
}

Result<std::optional<SurfaceChunk>> SurfaceBlocks::next(const SurfaceLimits& limits)
{
    SurfaceChunk chunk;
    while ((!pending_.empty() || next_ < instances_.size()) && chunk.blocks.size() < limits.slots) {
        const Part part = next_part();
        const Cell block = corner_of(instances_[part.first].block);
        uint64_t triangles = 0, pairs = 0;
        for (size_t i = part.first; i < part.last; ++i) {
            const uint64_t cells = walk_of(piece_of(instances_[i].item), block, part).cells();
            pairs += cells;
            triangles += cells > 0;
        }
        if (!triangles)
            continue;
        if (chunk.records.size() + triangles <= limits.triangles && chunk.pairs + pairs <= limits.pairs) {
            append(part, chunk);
            continue;
        }
        if (!chunk.records.empty()) {
            pending_.push_back(part);
            break;
        }
        const uint32_t edge = part.high[0] - part.low[0];
        if (edge == 1)
            return fail(ErrorCode::bad_input,
                        "{} triangles touch cell ({}, {}, {}), at most {} fit on the device; take a smaller voxel size",
                        triangles, in_grid(block)[0] + int(part.low[0]), in_grid(block)[1] + int(part.low[1]),
                        in_grid(block)[2] + int(part.low[2]), std::min(limits.triangles, limits.pairs));
        for (uint32_t octant = 8; octant-- > 0;) {
            Part smaller = part;
            for (uint32_t a = 0; a < 3; ++a) {
                smaller.low[a] += (octant >> (2 - a) & 1) * edge / 2;
                smaller.high[a] = smaller.low[a] + edge / 2;
            }
            pending_.push_back(smaller);
        }
    }
    if (chunk.records.empty())
        return std::optional<SurfaceChunk>();
    return std::optional(std::move(chunk));
}

} // namespace semrover
