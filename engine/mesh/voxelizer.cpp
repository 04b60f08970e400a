// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/mesh/voxelizer.h"

#include "engine/mesh/surface_blocks.h"
#include "engine/mesh/texture_atlas.h"
#include "engine/scene/palette.h"
#include "engine/scene/srgb.h"
#include "engine/voxfield/token_codec.h"
#include "kernels/sort.h"
#include "runtime/device/executable.h"
#include "runtime/device/tensor_pool.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>

namespace semrover {

namespace {

static_assert(kNoSurfaceLabel == kClassCount && sizeof(SurfaceRecord) == 48 && sizeof(SurfaceAttributes) == 64);

constexpr uint64_t kMaxSamples = 1ull << 31; // of a grid: 18 GiB as it is stored
constexpr uint64_t kMaxPairs = 1 << 21;      // at once: about 140 MB of device memory

Status check_options(const VoxelizeOptions& o)
{
    if (!(o.voxel_size >= 1e-3f && o.voxel_size <= 1e3f))
        return fail(ErrorCode::bad_input, "expected a voxel size of 0.001 to 1000 m, found {}", o.voxel_size);
    if (o.points_per_voxel < 1 || o.points_per_voxel > 4096)
        return fail(ErrorCode::bad_input, "expected 1 to 4096 points in a voxel, found {}", o.points_per_voxel);
    if (!(o.min_area >= 0 && o.min_area <= 1))
        return fail(ErrorCode::bad_input, "expected a least area of 0 to 1 squares of the voxel size, found {}",
                    o.min_area);
    if (o.default_label >= kClassCount && o.default_label != kNoLabel)
        return fail(ErrorCode::bad_input, "expected a default label of 0 to {}, found {}", kClassCount - 1,
                    o.default_label);
    return {};
}

tl::unexpected<Error> no_label(double area, std::string_view what)
{
    return fail(ErrorCode::bad_input, "{} have no label ({:.4g} m^2 of surface); give them one, or a default label",
                what, area);
}

// kNoSurfaceLabel where a texture says the label
Result<std::vector<uint8_t>> labels_of_faces(const Mesh& mesh, uint8_t default_label)
{
    std::vector<uint8_t> labels(mesh.faces.size());
    size_t without = 0;
    double area = 0;
    for (size_t f = 0; f < labels.size(); ++f) {
        labels[f] = mesh.face_labels.empty() ? kNoLabel : mesh.face_labels[f];
        if (labels[f] != kNoLabel)
            continue;
        const bool textured = !mesh.face_materials.empty() && !mesh.uvs.empty() &&
                              mesh.materials[mesh.face_materials[f]].label_texture >= 0;
        labels[f] = textured ? uint8_t(kNoSurfaceLabel) : default_label;
        if (!textured && default_label == kNoLabel) {
            ++without;
            area += face_area(mesh, f);
        }
    }
    if (without)
        return no_label(area, fmt::format("{} of {} faces", without, labels.size()));
    return labels;
}

// half precision, on the voxel's side of its border
uint16_t half_within(float value, float limit)
{
    uint16_t half = float_to_half(value);
    while (std::abs(half_to_float(half)) > limit)
        --half; // the sign is the highest bit
    return half;
}

class Voxelizer {
  public:
    Voxelizer(Device& device, const Mesh& mesh, const VoxelizeOptions& options, TextureAtlas atlas)
        : device_(device), mesh_(mesh), options_(options), atlas_(std::move(atlas))
    {
    }

    Result<VoxelizedMesh> run(std::span<const uint8_t> labels);

  private:
    struct ChunkMemory {
        TensorPool state;
        uint32_t pairs, cells;
        DeviceTensor records, attributes;
        DeviceTensor triangles, sums;                         // of pairs
        DeviceTensor starts, areas, labels, unlabelled_areas; // of voxels

        ChunkMemory(uint32_t triangles, uint32_t pairs, uint32_t cells);
        SurfaceTriangles in(Graph& g, const TextureAtlas& atlas) const;
    };
    using CellRow = std::array<int32_t, 4>; // i, j, k, key

    SurfaceLimits limits() const;
    Result<ChunkMemory> upload(const SurfaceChunk& chunk);
    Status measure(const ChunkMemory& memory);
    Result<std::vector<CellRow>> keep_cells(const SurfaceChunk& chunk, const ChunkMemory& memory);
    Status sample(const ChunkMemory& memory, std::span<const CellRow> cells);
    void store(std::span<const std::array<uint32_t, 4>> samples, size_t cells);
    VoxelizedMesh finish();

    Device& device_;
    const Mesh& mesh_;
    const VoxelizeOptions& options_;
    TextureAtlas atlas_;
    TensorPool constants_;
    DeviceTensor light_;
    VoxelizedMesh out_;
    double unlabelled_ = 0; // m^2
};

Voxelizer::ChunkMemory::ChunkMemory(uint32_t triangle_count, uint32_t pair_count, uint32_t cell_count)
    : pairs(pair_count), cells(cell_count)
{
    records = state.tensor(triangle_count, 12, DType::u32, "triangles", 12);
    attributes = state.tensor(triangle_count, 16, DType::u32, "attributes", 16);
    triangles = state.tensor(pairs, 1, DType::u32, "triangles of pairs", 1);
    sums = state.tensor(pairs, 1, DType::f32, "sums of areas", 1);
    starts = state.tensor(cells + 1, 1, DType::u32, "first pairs", 1);
    areas = state.tensor(cells, 1, DType::f32, "areas", 1);
    labels = state.tensor(cells, 1, DType::u32, "labels", 1);
    unlabelled_areas = state.tensor(cells, 1, DType::f32, "unlabelled areas", 1);
}

SurfaceTriangles Voxelizer::ChunkMemory::in(Graph& g, const TextureAtlas& atlas) const
{
    return {records.in(g), attributes.in(g), atlas.materials(g), atlas.textures(g), atlas.alphas(g), atlas.masked()};
}

SurfaceLimits Voxelizer::limits() const
{
    const DeviceLimits& device = device_.limits();
    uint64_t pairs = options_.max_pairs ? options_.max_pairs : kMaxPairs;
    if (device_.budget() && !options_.max_pairs) // half of it, at about 128 bytes a pair
        pairs = std::clamp<uint64_t>(device_.budget() / 256, 1 << 14, pairs);
    pairs = std::min(pairs, device.max_storage_range / 4);
    const uint64_t triangles = std::min(pairs, device.max_storage_range / sizeof(SurfaceAttributes));
    return {triangles, pairs, std::min<uint64_t>(4096, std::max<uint64_t>(1, pairs / 256))};
}

Result<Voxelizer::ChunkMemory> Voxelizer::upload(const SurfaceChunk& chunk)
{
    ChunkMemory m(uint32_t(chunk.records.size()), uint32_t(chunk.pairs),
                  uint32_t(chunk.blocks.size() * kSurfaceBlockCells));
    SR_CHECK(m.state.allocate(device_, "surface"));
    SR_CHECK(m.records.write(device_, chunk.records));
    SR_CHECK(m.attributes.write(device_, chunk.attributes));
    return m;
}

// pairs by voxel, their areas, areas and labels of voxels
Status Voxelizer::measure(const ChunkMemory& m)
{
    Graph g(device_.limits());
    const SurfaceTriangles surface = m.in(g, atlas_);
    const SurfacePairs found = triangle_cells(g, surface.records, m.pairs);
    // within a voxel along a curve, so that samples that follow each other in area lie beside each other
    const uint32_t bits = uint32_t(std::bit_width(m.cells - 1)) + kSurfacePlaceBits;
    const SortedPairs sorted = radix_sort(g, found.keys, found.triangles, {.bits = bits, .count = found.count});
    const Tensor keys = pair_cells(g, sorted.keys);
    const SurfaceAreas pairs = clip_area(g, surface, {keys, sorted.values, found.count});
    if (atlas_.has_labels())
        atlas_.gather(g, pairs.label_addresses, pairs.labels, found.count);
    const Tensor starts = bucket_starts(g, keys, m.cells, found.count);
    const CellAreas cells = cell_area(g, pairs.areas, pairs.labels, starts, m.cells);
    g.keep(sorted.values, m.triangles);
    g.keep(cells.sums, m.sums);
    g.keep(starts, m.starts);
    g.keep(cells.areas, m.areas);
    g.keep(cells.labels, m.labels);
    g.keep(cells.unlabelled, m.unlabelled_areas);
    SR_TRY(const auto executable, Executable::create(device_, g));
    return executable->run();
}

// those with enough area go into the grid
Result<std::vector<Voxelizer::CellRow>> Voxelizer::keep_cells(const SurfaceChunk& chunk, const ChunkMemory& m)
{
    SR_TRY(const std::vector<float> areas, m.areas.read<float>(device_));
    SR_TRY(const std::vector<float> unlabelled, m.unlabelled_areas.read<float>(device_));
    SR_TRY(const std::vector<uint32_t> labels, m.labels.read<uint32_t>(device_));
    const double square = double(options_.voxel_size) * options_.voxel_size;
    std::vector<CellRow> kept;
    for (uint32_t key = 0; key < m.cells; ++key) {
        unlabelled_ += unlabelled[key] * square;
        if (!(areas[key] > options_.min_area))
            continue;
        const Cell& block = chunk.blocks[key / kSurfaceBlockCells];
        const int32_t c = int32_t(key % kSurfaceBlockCells), edge = int32_t(kSurfaceBlock);
        const Cell cell = {block[0] + c / (edge * edge), block[1] + c / edge % edge, block[2] + c % edge};
        kept.push_back({cell[0], cell[1], cell[2], int32_t(key)});
        out_.grid.cells.push_back(cell);
        out_.grid.labels.push_back(uint8_t(labels[key]));
        out_.area.push_back(float(areas[key] * square));
    }
    return kept;
}

Status Voxelizer::sample(const ChunkMemory& m, std::span<const CellRow> cells)
{
    const auto n = uint32_t(options_.points_per_voxel);
    TensorPool state;
    const DeviceTensor rows = state.tensor(uint32_t(cells.size()), 4, DType::i32, "cells", 4);
    const DeviceTensor results = state.tensor(uint32_t(cells.size()) * n, 4, DType::u32, "samples", 4);
    SR_CHECK(state.allocate(device_, "samples"));
    SR_CHECK(rows.write(device_, cells));
    Graph g(device_.limits());
    const SurfaceSamples points =
        sample_surface(g, m.in(g, atlas_), m.triangles.in(g), m.sums.in(g), m.starts.in(g), rows.in(g), n,
                       options_.seed, options_.placement == PointPlacement::canonical);
    const Tensor texels = fill(g, results.rows() * 4, 0xffffffff);
    atlas_.gather(g, points.addresses, texels);
    g.keep(surface_color(g, points, texels, light_.in(g)), results);
    SR_TRY(const auto executable, Executable::create(device_, g));
    SR_CHECK(executable->run());
    using Sample = std::array<uint32_t, 4>;
    SR_TRY(const std::vector<Sample> samples, results.read<Sample>(device_));
    store(samples, cells.size());
    return {};
}

void Voxelizer::store(std::span<const std::array<uint32_t, 4>> samples, size_t cells)
{
    const auto n = size_t(options_.points_per_voxel);
    VoxelGrid& grid = out_.grid;
    for (size_t cell = 0; cell < cells; ++cell) {
        for (const auto& s : samples.subspan(cell * n, n))
            for (size_t a = 0; a < 3; ++a) {
                grid.points.push_back(
                    half_within(std::bit_cast<float>(s[a]) * options_.voxel_size, options_.voxel_size / 2));
                grid.colors.push_back(uint8_t(s[3] >> (8 * a)));
            }
        sort_by_distance(std::span(grid.points).last(3 * n), std::span(grid.colors).last(3 * n));
    }
}

// voxels in order
VoxelizedMesh Voxelizer::finish()
{
    VoxelGrid& grid = out_.grid;
    grid.voxel_size = options_.voxel_size;
    grid.points_per_voxel = options_.points_per_voxel;
    grid.generated.assign(grid.cells.size(), 1);
    if (options_.placement == PointPlacement::canonical)
        grid.metadata["placement"] = "canonical";
    const std::vector<Cell> cells = grid.cells;
    sort_cells(grid);
    std::vector<float> area(cells.size());
    for (size_t i = 0; i < cells.size(); ++i)
        area[*find_cell(grid, cells[i])] = out_.area[i];
    out_.area = std::move(area);
    return std::move(out_);
}

Result<VoxelizedMesh> Voxelizer::run(std::span<const uint8_t> labels)
{
    std::array<float, 512> linear;
    for (size_t i = 0; i < 256; ++i) {
        linear[i] = float(kLinear[i]);
        linear[256 + i] = float(linear_of_srgb((double(i) + 0.5) / 255));
    }
    light_ = constants_.tensor(512, 1, DType::f32, "linear light", 1);
    SR_CHECK(constants_.allocate(device_, "linear light"));
    SR_CHECK(light_.write(device_, linear));
    const SurfaceLimits limits = this->limits();
    SR_TRY(SurfaceBlocks blocks, SurfaceBlocks::create(mesh_, labels, options_.voxel_size, options_.name));
    const auto n = uint64_t(options_.points_per_voxel);
    const uint64_t batch = std::max<uint64_t>(1, limits.pairs / 2 / n); // voxels
    while (true) {
        SR_TRY(const auto chunk, blocks.next(limits));
        if (!chunk)
            break;
        SR_TRY(const ChunkMemory memory, upload(*chunk));
        SR_CHECK(measure(memory));
        SR_TRY(const std::vector<CellRow> cells, keep_cells(*chunk, memory));
        if (out_.grid.cells.size() * n > kMaxSamples)
            return fail(ErrorCode::bad_input, "{}: fills more than {} cells of {} points; take a larger voxel size",
                        options_.name, kMaxSamples / n, n);
        for (size_t first = 0; first < cells.size(); first += batch)
            SR_CHECK(sample(memory, std::span(cells).subspan(first, std::min(batch, cells.size() - first))));
    }
    if (unlabelled_ > 0)
        return no_label(unlabelled_, "pixels of label textures");
    if (out_.grid.cells.empty())
        return fail(ErrorCode::bad_input, "{}: has no surface: {:.4g} m^2 in {} faces, at least {:.4g} in a voxel",
                    options_.name, blocks.area(), mesh_.faces.size(),
                    double(options_.min_area) * options_.voxel_size * options_.voxel_size);
    return finish();
}

} // namespace

Result<VoxelizedMesh> voxelize(Device& device, const Mesh& mesh, const VoxelizeOptions& options)
{
    SR_CHECK(check_options(options));
    SR_CHECK(check_mesh(mesh, options.name));
    SR_TRY(const std::vector<uint8_t> labels, labels_of_faces(mesh, options.default_label));
    SR_TRY(TextureAtlas atlas, TextureAtlas::create(device, mesh, options.default_label));
    return Voxelizer(device, mesh, options, std::move(atlas)).run(labels);
}

} // namespace semrover
