// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/dataset/scene_readers.h"

#include "engine/format/label_map.h"
#include "runtime/base/json.h"
#include "runtime/base/quote.h"
#include "tools/dataset/voxel_sizes.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

constexpr uint64_t kMetadataBytes = 1u << 20;

template <typename T>
NpyArray array_of(DType dtype, std::vector<uint64_t> shape, std::span<T> values)
{
    const auto bytes = std::as_bytes(values);
    return {dtype, std::move(shape), {bytes.begin(), bytes.end()}};
}

std::string shape_of(const std::vector<uint64_t>& shape)
{
    return fmt::format("[{}]", fmt::join(shape, ", "));
}

template <typename T>
Result<std::vector<T>> integers(const NpzFile& file, const char* name, const std::string& where)
{
    SR_TRY(const NpyArray array, file.read(name));
    return whole_numbers<T>(array, fmt::format("{}: {}", where, name));
}

Result<std::vector<uint16_t>> halves(const NpzFile& file, const char* name, const std::string& where)
{
    SR_TRY(const NpyArray array, file.read(name));
    std::vector<uint16_t> out;
    if (array.dtype == DType::f16)
        return array.values<uint16_t>();
    if (array.dtype == DType::f32)
        for (const float v : array.values<float>())
            out.push_back(float_to_half(v));
    else if (array.dtype == DType::f64)
        for (const double v : array.values<double>())
            out.push_back(float_to_half(static_cast<float>(v)));
    else
        return fail(ErrorCode::bad_input, "{}: {}: expected floats, found {}", where, name, dtype_name(array.dtype));
    return out;
}

Status expect_shape(const NpzFile& file, const char* name, const std::vector<uint64_t>& shape, const std::string& where)
{
    SR_TRY(const NpyHeader header, file.header(name));
    if (header.shape != shape)
        return fail(ErrorCode::bad_input, "{}: {}: expected shape {}, found {}", where, name, shape_of(shape),
                    shape_of(header.shape));
    return {};
}

// of a grid that has no points yet
Status read_points_per_voxel(const NpzFile& file, VoxelGrid& grid, const std::string& where)
{
    SR_TRY(const std::vector<int32_t> n, integers<int32_t>(file, "points_per_voxel", where));
    if (n.size() != 1 || n[0] < 0 || n[0] > kMaxPointsPerVoxel)
        return fail(ErrorCode::bad_input, "{}: points_per_voxel: expected one number from 0 to {}", where,
                    kMaxPointsPerVoxel);
    grid.points_per_voxel = n[0];
    return {};
}

Status read_metadata(const NpzFile& file, VoxelGrid& grid, const std::string& where)
{
    if (!file.has("metadata"))
        return {};
    SR_TRY(const NpyArray array, file.read("metadata", kMetadataBytes));
    const std::string_view text(reinterpret_cast<const char*>(array.data.data()), array.data.size());
    SR_TRY(const Json json, parse_json(text, where + ": metadata"));
    if (!json.is_object())
        return fail(ErrorCode::bad_input, "{}: metadata: expected an object, found {}", where, json.type_name());
    for (const auto& [key, value] : json.items()) {
        if (!value.is_string())
            return fail(ErrorCode::bad_input, "{}: metadata: {}: expected a text, found {}", where, quote(key, 60),
                        value.type_name());
        grid.metadata[key] = value.get<std::string>();
    }
    return {};
}

Status read_points(const NpzFile& file, VoxelGrid& grid, const std::string& where)
{
    SR_TRY(const NpyHeader header, file.header("points"));
    const uint64_t v = grid.cells.size(), n = header.shape.size() == 3 ? header.shape[1] : 0;
    if (n < 1 || n > kMaxPointsPerVoxel)
        return fail(ErrorCode::bad_input, "{}: points: expected shape [V, 1 to {}, 3], found {}", where,
                    kMaxPointsPerVoxel, shape_of(header.shape));
    SR_CHECK(expect_shape(file, "points", {v, n, 3}, where));
    SR_CHECK(expect_shape(file, "colors", {v, n, 3}, where));
    grid.points_per_voxel = static_cast<int>(n);
    SR_TRY(grid.points, halves(file, "points", where));
    SR_TRY(grid.colors, integers<uint8_t>(file, "colors", where));
    grid.generated.assign(v, 1);
    if (file.has("generated")) {
        SR_CHECK(expect_shape(file, "generated", {v}, where));
        SR_TRY(grid.generated, integers<uint8_t>(file, "generated", where));
    }
    return {};
}

Result<VoxelSizes> sizes_of(const NpzFile& file, const SceneGridOptions& o, const std::string& where)
{
    std::optional<double> said;
    if (file.has("voxel_size")) {
        SR_TRY(said, file.number("voxel_size"));
        if (!(*said > 0 && std::isfinite(*said)))
            return fail(ErrorCode::bad_input, "{}: voxel_size: expected metres above 0, found {}", where, *said);
    }
    return voxel_sizes(said, o, true, where);
}

// classes of the file's numbers; kLeftOut and kEmpty are no cells
Result<std::vector<uint8_t>> read_classes(const NpzFile& file, const SceneGridOptions& o, SceneGrid& out,
                                          const std::string& where)
{
    SR_TRY(const std::vector<uint32_t> numbers, integers<uint32_t>(file, "labels", where));
    SR_TRY(LabelMap map, LabelMap::of_column({"labels", ""}, file.has("metadata"), o.map));
    std::vector<uint8_t> labels;
    for (const uint32_t number : numbers)
        labels.push_back(map(number));
    SR_CHECK(map.check(where, "cells"));
    for (const auto& lines : {map.assumed(where, "cells"), map.left_out("cells")})
        out.warnings.insert(out.warnings.end(), lines.begin(), lines.end());
    out.dropped = map.dropped();
    return labels;
}

// rows of `width` numbers whose cells stay
template <typename T>
void keep_rows(std::vector<T>& values, size_t width, std::span<const uint8_t> labels)
{
    if (values.empty())
        return;
    size_t kept = 0;
    for (size_t v = 0; v < labels.size(); ++v)
        if (labels[v] < kClassCount)
            for (size_t i = 0; i < width; ++i)
                values[kept++] = values[v * width + i];
    values.resize(kept);
}

Status read_cells(const NpzFile& file, const SceneGridOptions& o, SceneGrid& out, const std::string& where)
{
    VoxelGrid& grid = out.grid;
    SR_TRY(const NpyHeader cells, file.header("cells"));
    if (cells.shape.size() != 2)
        return fail(ErrorCode::bad_input, "{}: cells: expected shape [V, 3], found {}", where, shape_of(cells.shape));
    SR_CHECK(expect_shape(file, "cells", {cells.shape[0], 3}, where));
    SR_CHECK(expect_shape(file, "labels", {cells.shape[0]}, where));
    SR_TRY(const std::vector<int32_t> coordinates, integers<int32_t>(file, "cells", where));
    grid.cells.resize(coordinates.size() / 3);
    for (size_t i = 0; i < coordinates.size(); ++i)
        grid.cells[i / 3][i % 3] = coordinates[i];
    SR_TRY(grid.labels, read_classes(file, o, out, where));
    if (file.has("points") && !grid.cells.empty())
        SR_CHECK(read_points(file, grid, where));
    else if (file.has("points_per_voxel"))
        SR_CHECK(read_points_per_voxel(file, grid, where));
    const std::vector<uint8_t> labels = grid.labels;
    const size_t width = 3 * size_t(grid.points_per_voxel);
    keep_rows(grid.cells, 1, labels);
    keep_rows(grid.points, width, labels);
    keep_rows(grid.colors, width, labels);
    keep_rows(grid.generated, 1, labels);
    keep_rows(grid.labels, 1, labels);
    return {};
}

} // namespace

Result<SceneGrid> read_grid_npz(const Path& path, const SceneGridOptions& o)
{
    const std::string where = quote_path(path);
    SR_TRY(const NpzFile file, NpzFile::open(path));
    SceneGrid out;
    SR_CHECK(read_cells(file, o, out, where));
    SR_TRY(const VoxelSizes sizes, sizes_of(file, o, where));
    out.grid.voxel_size = float(sizes.voxel);
    SR_CHECK(read_metadata(file, out.grid, where));
    sort_cells(out.grid);
    SR_CHECK(check_grid(out.grid, where)); // also for cells that are given twice
    SR_TRY(const Cell shift, whole_voxels(o.origin, sizes.voxel));
    for (Cell& cell : out.grid.cells)
        for (size_t a = 0; a < 3; ++a)
            cell[a] += shift[a];
    if (!sizes.same() && out.grid.has_points())
        return fail(ErrorCode::bad_input,
                    "{}: its cells of {:.6g} m have points, which cells of {:.6g} m cannot take over: write a .ply and "
                    "convert that",
                    where, sizes.voxel, sizes.cell);
    SR_CHECK(coarsen(out.grid, sizes, o.min_fill, where, out.warnings));
    if (sizes.same())
        out.unused.push_back({"min_fill", "cells stay as large as they are"});
    SR_CHECK(check_grid(out.grid, where));
    return out;
}

Status write_grid_npz(const Path& path, const VoxelGrid& grid)
{
    SR_CHECK(check_grid(grid, quote_path(path)));
    const uint64_t v = grid.cells.size(), n = static_cast<uint64_t>(grid.points_per_voxel);
    const std::string metadata = json_text(Json(grid.metadata));
    std::map<std::string, NpyArray> arrays;
    arrays["cells"] = array_of(DType::i32, {v, 3}, std::span(grid.cells));
    arrays["labels"] = array_of(DType::u8, {v}, std::span(grid.labels));
    arrays["voxel_size"] = array_of(DType::f32, {}, std::span(&grid.voxel_size, 1));
    arrays["metadata"] = array_of(DType::u8, {metadata.size()}, std::span(metadata));
    const int32_t per_voxel = grid.points_per_voxel;
    if (per_voxel)
        arrays["points_per_voxel"] = array_of(DType::i32, {}, std::span(&per_voxel, 1));
    if (grid.has_points()) {
        arrays["points"] = array_of(DType::f16, {v, n, 3}, std::span(grid.points));
        arrays["colors"] = array_of(DType::u8, {v, n, 3}, std::span(grid.colors));
        arrays["generated"] = array_of(DType::u8, {v}, std::span(grid.generated));
    }
    return write_npz(path, arrays);
}

} // namespace semrover
