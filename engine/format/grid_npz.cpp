// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/grid_npz.h"

#include "engine/format/npz.h"
#include "runtime/base/json.h"
#include "runtime/base/quote.h"

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

template <typename From>
bool convert(const NpyArray& array, auto& out)
{
    using To = typename std::remove_reference_t<decltype(out)>::value_type;
    const std::vector<From> values = array.values<From>();
    out.resize(values.size());
    for (size_t i = 0; i < values.size(); ++i) {
        out[i] = static_cast<To>(values[i]);
        if (static_cast<From>(out[i]) != values[i] || (out[i] < To(0)) != (values[i] < From(0)))
            return false;
    }
    return true;
}

// integers of any type as T; each must fit
template <typename T>
Result<std::vector<T>> integers(const NpzFile& file, const char* name, const std::string& where)
{
    SR_TRY(const NpyArray array, file.read(name));
    std::vector<T> out;
    bool fits = false;
    switch (array.dtype) {
    case DType::boolean:
    case DType::u8:
        fits = convert<uint8_t>(array, out);
        break;
    case DType::i8:
        fits = convert<int8_t>(array, out);
        break;
    case DType::u16:
        fits = convert<uint16_t>(array, out);
        break;
    case DType::i16:
        fits = convert<int16_t>(array, out);
        break;
    case DType::u32:
        fits = convert<uint32_t>(array, out);
        break;
    case DType::i32:
        fits = convert<int32_t>(array, out);
        break;
    case DType::u64:
        fits = convert<uint64_t>(array, out);
        break;
    case DType::i64:
        fits = convert<int64_t>(array, out);
        break;
    default:
        return fail(ErrorCode::bad_input, "{}: {}: expected integers, found {}", where, name, dtype_name(array.dtype));
    }
    if (!fits)
        return fail(ErrorCode::bad_input, "{}: {}: a number that does not fit {} bytes", where, name, sizeof(T));
    return out;
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

Status read_voxel_size(const NpzFile& file, VoxelGrid& grid, const std::string& where)
{
    if (!file.has("voxel_size"))
        return {};
    SR_TRY(const NpyArray array, file.read("voxel_size", 8));
    if (array.dtype == DType::f32 && array.elements() == 1)
        grid.voxel_size = array.values<float>()[0];
    else if (array.dtype == DType::f64 && array.elements() == 1)
        grid.voxel_size = static_cast<float>(array.values<double>()[0]);
    else
        return fail(ErrorCode::bad_input, "{}: voxel_size: expected one float, found {} of {}", where,
                    shape_of(array.shape), dtype_name(array.dtype));
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

} // namespace

Result<VoxelGrid> read_grid_npz(const Path& path, float voxel_size)
{
    const std::string where = quote_path(path);
    SR_TRY(const NpzFile file, NpzFile::open(path));
    VoxelGrid grid;
    grid.voxel_size = voxel_size;
    SR_TRY(const NpyHeader cells, file.header("cells"));
    if (cells.shape.size() != 2)
        return fail(ErrorCode::bad_input, "{}: cells: expected shape [V, 3], found {}", where, shape_of(cells.shape));
    SR_CHECK(expect_shape(file, "cells", {cells.shape[0], 3}, where));
    SR_CHECK(expect_shape(file, "labels", {cells.shape[0]}, where));
    SR_TRY(const std::vector<int32_t> coordinates, integers<int32_t>(file, "cells", where));
    grid.cells.resize(coordinates.size() / 3);
    for (size_t i = 0; i < coordinates.size(); ++i)
        grid.cells[i / 3][i % 3] = coordinates[i];
    SR_TRY(grid.labels, integers<uint8_t>(file, "labels", where));
    SR_CHECK(read_voxel_size(file, grid, where));
    SR_CHECK(read_metadata(file, grid, where));
    if (file.has("points") && !grid.cells.empty())
        SR_CHECK(read_points(file, grid, where));
    else if (file.has("points_per_voxel"))
        SR_CHECK(read_points_per_voxel(file, grid, where));
    sort_cells(grid);
    SR_CHECK(check_grid(grid, where));
    return grid;
}

Status write_grid_npz(const Path& path, const VoxelGrid& grid)
{
    SR_CHECK(check_grid(grid, quote_path(path)));
    const uint64_t v = grid.cells.size(), n = static_cast<uint64_t>(grid.points_per_voxel);
    const std::string metadata = Json(grid.metadata).dump(-1, ' ', false, Json::error_handler_t::replace);
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
