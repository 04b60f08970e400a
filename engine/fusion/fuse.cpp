// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/fusion/fuse.h"

#include "engine/mesh/mesh.h"
#include "engine/scene/palette.h"
#include "runtime/device/executable.h"

#include <algorithm>
#include <bit>

namespace semrover {

namespace {

constexpr uint64_t kRangeBytes = 128u << 20; // of vertices and of faces that are read at a time
constexpr uint32_t kNoVote = 31;             // in attributes

class Extraction {
  public:
    Extraction(Device& device, const TsdfVolume& volume) : device_(device), volume_(volume) {}

    Status count();
    Status write(FusedSurface& surface);

  private:
    uint32_t blocks() const { return uint32_t(volume_.blocks().size()); }
    MarchingCubesCounts counts_in(Graph& g) const;
    Result<std::vector<uint32_t>> starts(const DeviceTensor& first,
                                         const DeviceTensor& total) const; // of blocks, and the total
    uint32_t range_end(uint32_t first, uint64_t bytes) const;
    Status write_range(uint32_t first, uint32_t last, FusedSurface& surface);
    void append(uint32_t first, uint32_t last, std::span<const std::array<float, 4>> rows, FusedSurface& surface) const;

    Device& device_;
    const TsdfVolume& volume_;
    TensorPool state_;
    DeviceTensor table_, cases_, edges_, first_vertex_, first_face_, vertices_, faces_;
    std::vector<uint32_t> vertex_starts_, face_starts_; // [blocks + 1]
};

MarchingCubesCounts Extraction::counts_in(Graph& g) const
{
    return {cases_.in(g), edges_.in(g), first_vertex_.in(g), first_face_.in(g), vertices_.in(g), faces_.in(g)};
}

Result<std::vector<uint32_t>> Extraction::starts(const DeviceTensor& first, const DeviceTensor& total) const
{
    SR_TRY(std::vector<uint32_t> values, first.read<uint32_t>(device_));
    SR_TRY(const std::vector<uint32_t> all, total.read<uint32_t>(device_));
    values.push_back(all.front());
    if (values.back() == ~0u)
        return fail(ErrorCode::out_of_memory, "the surface has more than 2^32 vertices or faces");
    return values;
}

Status Extraction::count()
{
    const std::vector<uint32_t> table = marching_cubes_table();
    const auto array = [&](uint32_t rows, const char* name) { return state_.tensor(rows, 1, DType::u32, name, 1); };
    const uint32_t voxels = blocks() * kTsdfBlockVoxels;
    table_ = array(uint32_t(table.size()), "table");
    cases_ = array(voxels, "cases");
    edges_ = array(voxels, "edges");
    first_vertex_ = array(blocks(), "first vertices");
    first_face_ = array(blocks(), "first faces");
    vertices_ = array(1, "vertices");
    faces_ = array(1, "faces");
    SR_CHECK(state_.allocate(device_, "marching cubes"));
    SR_CHECK(table_.write(device_, table));
    Graph g(device_.limits());
    marching_cubes_count(g, volume_.in(g), table_.in(g), counts_in(g));
    SR_TRY(const auto executable, Executable::create(device_, g));
    SR_CHECK(executable->run());
    SR_TRY(vertex_starts_, starts(first_vertex_, vertices_));
    SR_TRY(face_starts_, starts(first_face_, faces_));
    return {};
}

// as many blocks from `first` on as make at most `bytes` of vertices or faces, one at least
uint32_t Extraction::range_end(uint32_t first, uint64_t bytes) const
{
    uint32_t last = first + 1;
    while (last < blocks() && (vertex_starts_[last + 1] - vertex_starts_[first]) * 16ull <= bytes &&
           (face_starts_[last + 1] - face_starts_[first]) * 12ull <= bytes)
        ++last;
    return last;
}

Status Extraction::write(FusedSurface& surface)
{
    const uint64_t bytes = std::min({kRangeBytes, device_.limits().max_storage_range, device_.limits().max_allocation});
    for (uint32_t first = 0; first < blocks();) {
        const uint32_t last = range_end(first, bytes);
        if (face_starts_[last] > face_starts_[first] || vertex_starts_[last] > vertex_starts_[first])
            SR_CHECK(write_range(first, last, surface));
        first = last;
    }
    return {};
}

Status Extraction::write_range(uint32_t first, uint32_t last, FusedSurface& surface)
{
    const MarchingCubesRange range{first, last - first, vertex_starts_[first], face_starts_[first]};
    // a block may have faces whose vertices are its neighbours' only
    const uint32_t vertices = vertex_starts_[last] - range.first_vertex, faces = face_starts_[last] - range.first_face;
    TensorPool out;
    const DeviceTensor positions = out.tensor(std::max(vertices, 1u), 4, DType::f32, "vertices", 4);
    const DeviceTensor corners = out.tensor(std::max(faces, 1u), 3, DType::u32, "faces", 3);
    SR_CHECK(out.allocate(device_, "surface"));
    Graph g(device_.limits());
    const MarchingCubesField field = volume_.in(g);
    const MarchingCubesCounts counts = counts_in(g);
    marching_cubes_vertices(g, field, counts, range, positions.in(g));
    marching_cubes_faces(g, field, counts, table_.in(g), range, corners.in(g));
    SR_TRY(const auto executable, Executable::create(device_, g));
    SR_CHECK(executable->run());
    using Row = std::array<float, 4>;
    SR_TRY(const std::vector<Row> rows, positions.row_range(0, vertices).read<Row>(device_));
    append(first, last, rows, surface);
    const size_t before = surface.faces.size();
    surface.faces.resize(before + faces);
    return device_.read(corners.row_range(0, faces).slice(),
                        std::as_writable_bytes(std::span(surface.faces).subspan(before)));
}

void Extraction::append(uint32_t first, uint32_t last, std::span<const std::array<float, 4>> rows,
                        FusedSurface& surface) const
{
    const FusionBox& box = volume_.box();
    for (uint32_t b = first; b < last; ++b) {
        const uint32_t id = volume_.blocks()[b], x = box.blocks[0], y = box.blocks[1];
        const std::array<uint32_t, 3> block = {id % x, id / x % y, id / (x * y)};
        for (uint32_t v = vertex_starts_[b]; v < vertex_starts_[b + 1]; ++v) {
            const auto& row = rows[v - vertex_starts_[first]];
            std::array<float, 3>& p = surface.positions.emplace_back();
            for (size_t axis = 0; axis < 3; ++axis)
                p[axis] = float((double(box.low[axis]) + 8.0 * block[axis] + double(row[axis]) + 0.5) * box.voxel);
            const uint32_t a = std::bit_cast<uint32_t>(row[3]), label = a >> 24 & 31;
            surface.colors.push_back({uint8_t(a), uint8_t(a >> 8), uint8_t(a >> 16)});
            surface.labels.push_back(label == kNoVote ? kNoLabel : uint8_t(label));
            surface.views.push_back(uint8_t(a >> 29));
        }
    }
}

uint8_t face_label(const std::array<uint8_t, 3>& corners)
{
    std::array<uint8_t, 3> sorted = corners;
    std::ranges::sort(sorted);
    if (sorted[1] == sorted[2] && sorted[1] != kNoLabel)
        return sorted[1];
    return sorted[0]; // two or three the same, or all different; kNoLabel is above all classes
}

// one for each class that occurs, and one for faces without
void add_materials(Mesh& mesh)
{
    std::array<int32_t, 256> index;
    index.fill(-1);
    for (const uint8_t label : mesh.face_labels)
        index[label] = 0;
    for (size_t label = 0; label < index.size(); ++label)
        if (index[label] == 0) {
            index[label] = int32_t(mesh.materials.size());
            Material& material = mesh.materials.emplace_back();
            material.name = label < kClassCount ? std::string(kPalette[label].name) : "unlabelled";
        }
    for (const uint8_t label : mesh.face_labels)
        mesh.face_materials.push_back(uint32_t(index[label]));
}

} // namespace

Result<FusedSurface> extract_surface(Device& device, const TsdfVolume& volume)
{
    Extraction extraction(device, volume);
    SR_CHECK(extraction.count());
    FusedSurface surface;
    SR_CHECK(extraction.write(surface));
    return surface;
}

double suitable_max_depth(const std::vector<CameraFrame>& cameras, double voxel)
{
    double depth = 30;
    for (const CameraFrame& camera : cameras)
        depth = std::min(depth, 0.55 * voxel * std::min(camera.intrinsics.fx, camera.intrinsics.fy));
    return depth;
}

Result<FusedMesh> fuse(Device& device, const DepthFrames& frames, const FusionOptions& options,
                       const FusionProgress& progress)
{
    SR_TRY(const TsdfVolume volume, TsdfVolume::create(device, frames, options, progress));
    SR_TRY(FusedSurface surface, extract_surface(device, volume));
    if (surface.faces.empty())
        return fail(ErrorCode::bad_input,
                    "nothing was observed: {} frames touch {} blocks, but no surface was seen by {} of them "
                    "(`min_views`) with weight {} (`min_weight`); do the poses fit the pictures?",
                    frames.cameras.size(), volume.blocks().size(), options.min_views, options.min_weight);
    FusedMesh out;
    out.figures = {volume.blocks().size(), volume.chunks(), 0};
    for (const auto& face : surface.faces) {
        const uint8_t label = face_label({surface.labels[face[0]], surface.labels[face[1]], surface.labels[face[2]]});
        out.mesh.face_labels.push_back(label);
        out.figures.unlabelled_faces += label == kNoLabel;
    }
    out.mesh.positions = std::move(surface.positions);
    out.mesh.colors = std::move(surface.colors);
    out.mesh.faces = std::move(surface.faces);
    out.views = std::move(surface.views);
    add_materials(out.mesh);
    return out;
}

} // namespace semrover
