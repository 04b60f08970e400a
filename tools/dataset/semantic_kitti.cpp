// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/dataset/scene_readers.h"

#include "runtime/base/quote.h"
#include "tools/dataset/dense_labels.h"

#include <algorithm>

namespace semrover {

namespace {

constexpr size_t kVoxels = 256 * 256 * 32;

// by class; 0 has no entry
constexpr std::array<uint16_t, kClassCount> kRaw = {40, 48, 50, 52, 51, 80, 81, 81, 70, 72,
                                                    0,  30, 31, 10, 18, 13, 16, 15, 11, 60};
constexpr uint16_t kOutlier = 1, kLargestTrainId = 19;
constexpr uint8_t kTrafficLight = 6, kSky = 10;

DenseLabels empty_box()
{
    return {{256, 256, 32}, {2000, 2000, 2000}, {0, -256000, -20000}, {}};
}

Result<std::vector<std::byte>> read_exactly(const Path& path, size_t bytes)
{
    SR_TRY(std::vector<std::byte> data, read_file(path, bytes));
    if (data.size() != bytes)
        return fail(ErrorCode::bad_input, "{}: expected {} bytes for 256 x 256 x 32 voxels, found {}", quote_path(path),
                    bytes, data.size());
    return data;
}

bool bit(const std::vector<std::byte>& bits, size_t i)
{
    return (std::to_integer<unsigned>(bits[i / 8]) >> (7 - i % 8)) & 1;
}

// kEmpty for voxels without the bit (or with it)
Status keep_bits(std::vector<uint16_t>& raw, const Path& path, bool keep)
{
    SR_TRY(const std::vector<std::byte> bits, read_exactly(path, kVoxels / 8));
    for (size_t i = 0; i < kVoxels; ++i)
        if (bit(bits, i) != keep)
            raw[i] = 0;
    return {};
}

// Raw ids and training ids share numbers below 20. Grounds, buildings and vegetation have raw ids above, and no scene
// is without them.
Status check_raw(const std::vector<uint16_t>& raw, std::string_view where)
{
    const uint16_t largest = std::ranges::max(raw);
    if (largest > kLargestTrainId || largest <= kOutlier)
        return {};
    return fail(ErrorCode::bad_input,
                "{}: the largest number is {}: these may be SemanticKITTI's raw ids, or its training ids; `map` "
                "semantickitti or `map` semantickitti-train says which",
                where, largest);
}

Path sibling(Path path, const char* extension)
{
    return path.replace_extension(extension);
}

} // namespace

Result<SceneGrid> read_semantic_kitti(const Path& path, const SceneGridOptions& options)
{
    const std::string where = quote_path(path);
    const Path labels = sibling(path, ".label"), invalid = sibling(path, ".invalid");
    if (!is_there(labels) && is_there(path))
        return fail(ErrorCode::bad_input, "{}: occupancy without labels: there is no {}", where, quote_path(labels));
    SR_TRY(const std::vector<std::byte> bytes, read_exactly(labels, kVoxels * 2));
    std::vector<uint16_t> raw(kVoxels);
    for (size_t i = 0; i < kVoxels; ++i)
        raw[i] = uint16_t(std::to_integer<unsigned>(bytes[2 * i]) | std::to_integer<unsigned>(bytes[2 * i + 1]) << 8);
    if (options.map.empty())
        SR_CHECK(check_raw(raw, where));
    if (path.extension() == ".bin")
        SR_CHECK(keep_bits(raw, path, true));
    if (is_there(invalid))
        SR_CHECK(keep_bits(raw, invalid, false));
    SR_TRY(LabelMap map, LabelMap::of("semantickitti"));
    if (!options.map.empty())
        SR_CHECK(map.apply(options.map));
    DenseLabels dense = empty_box();
    dense.labels.resize(kVoxels);
    for (size_t i = 0; i < kVoxels; ++i)
        dense.labels[i] = map(raw[i]);
    SR_CHECK(map.check(where, "voxels"));
    for (size_t a = 0; a < 3; ++a) {
        SR_TRY(const int64_t shift, tenths_of(options.origin[a], "origin"));
        dense.origin[a] += shift;
    }
    SceneGrid out;
    out.warnings = map.left_out("voxels");
    SR_TRY(out.grid, resample(dense, options.cell_size(), options.min_fill, where, &out.warnings));
    out.grid.metadata["source"] = "SemanticKITTI";
    out.dropped = map.dropped();
    out.unused = unused_options(dense, options.cell_size());
    return out;
}

Status write_semantic_kitti(const Path& path, const VoxelGrid& grid, std::vector<std::string>& warnings)
{
    DenseLabels dense = empty_box();
    SR_CHECK(split_into(dense, grid, quote_path(path)));
    std::vector<std::byte> labels(kVoxels * 2), bits(kVoxels / 8);
    for (size_t i = 0; i < kVoxels; ++i) {
        const uint16_t raw = dense.labels[i] < kClassCount ? kRaw[dense.labels[i]] : uint16_t(0);
        labels[2 * i] = std::byte(raw & 255);
        labels[2 * i + 1] = std::byte(raw >> 8);
        if (raw)
            bits[i / 8] |= std::byte(128u >> (i % 8));
    }
    const auto cells = [&](uint8_t label) { return std::ranges::count(grid.labels, label); };
    if (cells(kTrafficLight))
        warnings.push_back(fmt::format("{} cells of traffic light become traffic-sign", cells(kTrafficLight)));
    if (cells(kSky))
        warnings.push_back(fmt::format("{} cells of sky are left out", cells(kSky)));
    SR_TRY(AtomicFile label_file, AtomicFile::create(sibling(path, ".label")));
    SR_TRY(AtomicFile bit_file, AtomicFile::create(sibling(path, ".bin")));
    SR_CHECK(label_file.write(labels));
    SR_CHECK(bit_file.write(bits));
    SR_CHECK(label_file.commit());
    return bit_file.commit();
}

} // namespace semrover
