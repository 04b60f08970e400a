// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/dataset/scene_readers.h"

#include "runtime/base/quote.h"
#include "tools/dataset/dense_labels.h"
#include "tools/dataset/voxel_sizes.h"

#include <algorithm>
#include <unordered_map>

namespace semrover {

namespace {

constexpr uint64_t kMaxDense = 1u << 28, kMaxListed = 1u << 25; // voxels

using Shape = std::vector<uint64_t>;

Shape without_ones(Shape shape, size_t sizes)
{
    while (shape.size() > sizes && shape.front() == 1)
        shape.erase(shape.begin());
    return shape;
}

bool is_dense(const Shape& shape)
{
    return without_ones(shape, 3).size() == 3;
}

bool is_list(const Shape& shape)
{
    return shape.size() == 2 && shape[1] == 4;
}

struct LabelArray {
    NpyArray array;
    std::optional<double> voxel_size;
};

Result<NpyArray> read_npy(const Path& path, const std::string& where)
{
    SR_TRY(const MappedFile file, MappedFile::open(path));
    const auto bytes = file.bytes();
    SR_TRY(const NpyHeader header,
           parse_npy_header({reinterpret_cast<const char*>(bytes.data()), std::min(bytes.size(), kNpyHeaderBytes)},
                            where));
    if (bytes.size() - header.bytes != header.data_bytes)
        return fail(ErrorCode::bad_input, "{}: expected {} bytes of data, found {}", where, header.data_bytes,
                    bytes.size() - header.bytes);
    const auto data = bytes.subspan(header.bytes);
    return decode_npy(header, {data.begin(), data.end()});
}

Result<LabelArray> read_array(const Path& path, const std::string& where)
{
    LabelArray out;
    if (path.extension() != ".npz") {
        SR_TRY(out.array, read_npy(path, where));
        return out;
    }
    SR_TRY(const NpzFile file, NpzFile::open(path));
    const std::string name = only_label_array(file);
    if (name.empty())
        return fail(ErrorCode::bad_input, "{}: expected one array [X, Y, Z] or [N, 4] of labels, found {}", where,
                    printable(fmt::format("{}", fmt::join(file.names(), ", ")), 200));
    SR_TRY(out.array, file.read(name));
    if (file.has("voxel_size")) {
        SR_TRY(out.voxel_size, file.number("voxel_size"));
    }
    return out;
}

// how often each number is there, and what it is here
Result<std::unordered_map<uint32_t, uint8_t>>
targets_of(const std::vector<uint32_t>& numbers, const SceneGridOptions& o, const std::string& where, SceneGrid& out)
{
    std::unordered_map<uint32_t, uint64_t> counts;
    for (const uint32_t number : numbers)
        ++counts[number];
    SR_TRY(LabelMap map, LabelMap::of_array(o.map));
    std::unordered_map<uint32_t, uint8_t> targets;
    for (const auto& [number, count] : counts)
        targets[number] = map(number, count);
    SR_CHECK(map.check(where, "voxels"));
    for (const std::string& line : map.left_out("voxels"))
        out.warnings.push_back(line);
    out.dropped = map.dropped();
    return targets;
}

Result<DenseLabels> dense_of(const NpyArray& array, const SceneGridOptions& o, const std::string& where, SceneGrid& out)
{
    const Shape shape = without_ones(array.shape, 3);
    if (array.elements() == 0 || array.elements() > kMaxDense)
        return fail(ErrorCode::bad_input, "{}: {} voxels, expected 1 to {}", where, array.elements(), kMaxDense);
    SR_TRY(const std::vector<uint32_t> numbers, whole_numbers<uint32_t>(array, where));
    SR_TRY(const auto targets, targets_of(numbers, o, where, out));
    DenseLabels dense;
    for (size_t a = 0; a < 3; ++a)
        dense.shape[a] = uint32_t(shape[a]);
    dense.labels.reserve(numbers.size());
    for (const uint32_t number : numbers)
        dense.labels.push_back(targets.at(number));
    if (std::ranges::all_of(dense.labels, [](uint8_t label) { return label < kClassCount; }))
        out.warnings.push_back(fmt::format("{}: all voxels are occupied: no number is \"free\" in the map", where));
    return dense;
}

// the box that the list's largest coordinates make
Result<DenseLabels> box_of(const std::vector<uint32_t>& rows, const std::string& where)
{
    std::array<uint64_t, 3> shape = {1, 1, 1};
    for (size_t i = 0; i < rows.size(); i += 4)
        for (size_t a = 0; a < 3; ++a)
            shape[a] = std::max(shape[a], uint64_t(rows[i + a]) + 1);
    DenseLabels dense;
    uint64_t voxels = 1;
    for (size_t a = 0; a < 3; ++a) {
        if (voxels *= shape[a]; voxels > kMaxListed) // both factors are below 2^33
            return fail(ErrorCode::bad_input,
                        "{}: rows reach to voxel ({}, {}, {}), expected a box of at most {} voxels", where,
                        shape[0] - 1, shape[1] - 1, shape[2] - 1, kMaxListed);
        dense.shape[a] = uint32_t(shape[a]);
    }
    dense.labels.assign(voxels, kEmpty);
    return dense;
}

Result<DenseLabels> listed_of(const NpyArray& array, const SceneGridOptions& o, const std::string& where,
                              SceneGrid& out)
{
    if (array.elements() == 0)
        return fail(ErrorCode::bad_input, "{}: has no rows", where);
    SR_TRY(const std::vector<uint32_t> rows, whole_numbers<uint32_t>(array, where));
    SR_TRY(DenseLabels dense, box_of(rows, where));
    std::vector<uint32_t> numbers;
    for (size_t i = 3; i < rows.size(); i += 4)
        numbers.push_back(rows[i]);
    SR_TRY(const auto targets, targets_of(numbers, o, where, out));
    uint64_t again = 0;
    for (size_t i = 0; i < rows.size(); i += 4) {
        uint8_t& label = dense.labels[(size_t(rows[i]) * dense.shape[1] + rows[i + 1]) * dense.shape[2] + rows[i + 2]];
        again += label != kEmpty && label != targets.at(rows[i + 3]);
        label = targets.at(rows[i + 3]);
    }
    if (again)
        out.warnings.push_back(
            fmt::format("{}: {} rows name a voxel that has another label already: the last counts", where, again));
    if (dense.shape[2] > 2 * dense.shape[0]) // a street is longer than high
        out.warnings.push_back(fmt::format("{}: the first column reaches to {}, the third to {}: expected x y z label; "
                                           "of z y x label (OpenOccupancy) write array[:, [2, 1, 0, 3]]",
                                           where, dense.shape[0] - 1, dense.shape[2] - 1));
    return dense;
}

} // namespace

Result<SceneGrid> read_label_array(const Path& path, const SceneGridOptions& o)
{
    const std::string where = quote_path(path);
    SR_TRY(const LabelArray in, read_array(path, where));
    if (!is_dense(in.array.shape) && !is_list(in.array.shape))
        return fail(ErrorCode::bad_input, "{}: expected labels [X, Y, Z] or rows [N, 4], found [{}]", where,
                    fmt::join(in.array.shape, ", "));
    SR_TRY(const VoxelSizes sizes, voxel_sizes(in.voxel_size, o, false, where));
    SceneGrid out;
    SR_TRY(DenseLabels dense,
           is_list(in.array.shape) ? listed_of(in.array, o, where, out) : dense_of(in.array, o, where, out));
    for (size_t a = 0; a < 3; ++a) {
        SR_TRY(dense.edge[a], tenths_of(sizes.voxel, fmt::format("{}: size of a voxel", where)));
        SR_TRY(dense.origin[a], tenths_of(o.origin[a], "origin"));
    }
    if (dense.edge[0] < 1 || dense.edge[0] > kMaxEdge)
        return fail(ErrorCode::bad_input, "{}: voxels of {} m, expected 0.0001 to 100 m", where, sizes.voxel);
    if (o.origin == std::array<double, 3>{})
        out.warnings.push_back(fmt::format("{}: its corner lies at (0, 0, 0) m; `origin` says where else", where));
    SR_TRY(out.grid, resample(dense, sizes.cell, o.min_fill, where, &out.warnings));
    out.unused = unused_options(dense, sizes.cell);
    out.grid.metadata["source"] = "array of labels";
    return out;
}

std::string only_label_array(const NpzFile& file)
{
    std::string found;
    for (const std::string& name : file.names()) {
        const auto header = file.header(name);
        if (!header || (!is_dense(header->shape) && !is_list(header->shape)))
            continue;
        if (!found.empty())
            return "";
        found = name;
    }
    return found;
}

} // namespace semrover
