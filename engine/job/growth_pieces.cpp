// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/growth_pieces.h"

#include "runtime/base/quote.h"
#include "runtime/base/safetensors.h"

#include <algorithm>
#include <cstring>

namespace semrover {

namespace {

template <typename T>
Status copy_tensor(const Safetensors& file, const char* name, DType dtype, std::vector<T>& values)
{
    SR_TRY(const TensorInfo* info, file.get(name));
    if (info->dtype != dtype || info->bytes() % sizeof(T))
        return fail(ErrorCode::bad_input, "{}: {} has another type", quote_path(file.path()), name);
    values.resize(info->bytes() / sizeof(T));
    if (!values.empty())
        std::memcpy(values.data(), file.bytes(*info).data(), info->bytes());
    return {};
}

} // namespace

Path piece_path(const RunFolder& run, size_t window)
{
    return run.path() / "windows" / fmt::format("{:06}.safetensors", window);
}

Status save_piece(const RunFolder& run, size_t window, const GrownCells& grown)
{
    std::error_code ignored;
    std::filesystem::create_directories(run.path() / "windows", ignored);
    const uint64_t v = grown.cells.size();
    const TensorData tensors[] = {
        {"cells", DType::i32, {v, 3}, std::as_bytes(std::span(grown.cells))},
        {"points", DType::f16, {grown.points.size()}, std::as_bytes(std::span(grown.points))},
        {"colors", DType::u8, {grown.colors.size()}, std::as_bytes(std::span(grown.colors))},
    };
    return write_safetensors(piece_path(run, window), tensors);
}

Result<GrownCells> load_piece(const Path& path, int points_per_voxel)
{
    SR_TRY(const Safetensors file, Safetensors::open(path));
    GrownCells grown;
    SR_CHECK(copy_tensor(file, "cells", DType::i32, grown.cells));
    SR_CHECK(copy_tensor(file, "points", DType::f16, grown.points));
    SR_CHECK(copy_tensor(file, "colors", DType::u8, grown.colors));
    if (grown.points.size() != grown.cells.size() * size_t(points_per_voxel) * 3 ||
        grown.colors.size() != grown.points.size())
        return fail(ErrorCode::bad_input, "{}: arrays disagree", quote_path(path));
    return grown;
}

GrownCells grown_cells(const SubGrid& part, std::span<const uint32_t> targets)
{
    GrownCells grown;
    const size_t width = size_t(part.grid.points_per_voxel) * 3;
    for (size_t i = 0; i < part.cells.size(); ++i) {
        if (!std::ranges::binary_search(targets, part.cells[i]))
            continue;
        const auto at = ptrdiff_t(i * width), end = ptrdiff_t((i + 1) * width);
        grown.cells.push_back(part.grid.cells[i]);
        grown.points.insert(grown.points.end(), part.grid.points.begin() + at, part.grid.points.begin() + end);
        grown.colors.insert(grown.colors.end(), part.grid.colors.begin() + at, part.grid.colors.begin() + end);
    }
    return grown;
}

} // namespace semrover
