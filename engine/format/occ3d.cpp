// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/occ3d.h"

#include "engine/format/dense_labels.h"
#include "engine/format/npz.h"
#include "runtime/base/quote.h"

namespace semrover {

namespace {

constexpr SourceLabel kNuscenes[] = {
    {0, "others", kLeftOut}, {1, "barrier", 4},     {2, "bicycle", 18},
    {3, "bus", 15},          {4, "car", 13},        {5, "construction_vehicle", 14},
    {6, "motorcycle", 17},   {7, "pedestrian", 11}, {8, "traffic_cone", 5},
    {9, "trailer", 14},      {10, "truck", 14},     {11, "driveable_surface", 0},
    {12, "other_flat", 9},   {13, "sidewalk", 1},   {14, "terrain", 9},
    {15, "manmade", 2},      {16, "vegetation", 8}, {17, "free", kEmpty},
};

constexpr SourceLabel kWaymo[] = {
    {0, "TYPE_GENERALOBJECT", kLeftOut},
    {1, "TYPE_VEHICLE", 13},
    {2, "TYPE_PEDESTRIAN", 11},
    {3, "TYPE_SIGN", 7},
    {4, "TYPE_CYCLIST", 12},
    {5, "TYPE_TRAFFIC_LIGHT", 6},
    {6, "TYPE_POLE", 5},
    {7, "TYPE_CONSTRUCTION_CONE", 5},
    {8, "TYPE_BICYCLE", 18},
    {9, "TYPE_MOTORCYCLE", 17},
    {10, "TYPE_BUILDING", 2},
    {11, "TYPE_VEGETATION", 8},
    {12, "TYPE_TREE_TRUNK", 8},
    {13, "TYPE_ROAD", 0},
    {14, "TYPE_WALKABLE", 1},
    {15, "free", kEmpty},
    {23, "free", kEmpty},
};

struct Box {
    std::vector<uint64_t> shape;
    DenseLabels dense; // without labels
};

const Box& coarse_box()
{
    static const Box box{{200, 200, 16}, {{200, 200, 16}, {4000, 4000, 4000}, {-400000, -400000, -10000}, {}}};
    return box;
}

const Box& fine_box()
{
    static const Box box{{1600, 1600, 64}, {{1600, 1600, 64}, {1000, 1000, 2000}, {-800000, -800000, -50000}, {}}};
    return box;
}

Status check_array(const NpyArray& array, const std::vector<uint64_t>& shape, std::string_view where)
{
    if (array.shape != shape)
        return fail(ErrorCode::bad_input, "{}: expected shape [{}], found [{}]", where, fmt::join(shape, ", "),
                    fmt::join(array.shape, ", "));
    if (array.dtype != DType::u8 && array.dtype != DType::boolean)
        return fail(ErrorCode::bad_input, "{}: expected u8, found {}", where, dtype_name(array.dtype));
    return {};
}

// everything where no mask was asked for
Status apply_mask(const NpzFile& file, const std::string& mask, const Box& box, std::vector<std::byte>& labels,
                  uint8_t free, const std::string& where)
{
    if (mask.empty())
        return {};
    SR_TRY(const NpyArray array, file.read(mask, labels.size()));
    SR_CHECK(check_array(array, box.shape, fmt::format("{}: {}", where, quote(mask, 60))));
    for (size_t i = 0; i < labels.size(); ++i)
        if (array.data[i] == std::byte(0))
            labels[i] = std::byte(free);
    return {};
}

} // namespace

Result<SceneGrid> read_occ3d(const Path& path, Occ3dKind kind, const SceneGridOptions& options)
{
    const std::string where = quote_path(path);
    const bool waymo = kind == Occ3dKind::waymo;
    SR_TRY(const NpzFile file, NpzFile::open(path));
    const char* name = waymo && file.has("voxel_label") ? "voxel_label" : "semantics";
    SR_TRY(const NpyHeader header, file.header(name));
    const Box& box = waymo && header.shape == fine_box().shape ? fine_box() : coarse_box();
    DenseLabels dense = box.dense;
    const uint64_t voxels = box.shape[0] * box.shape[1] * box.shape[2];
    SR_TRY(NpyArray array, file.read(name, voxels));
    SR_CHECK(check_array(array, box.shape, fmt::format("{}: {}", where, name)));
    SR_CHECK(apply_mask(file, options.mask, box, array.data, waymo ? 15 : 17, where));

    LabelMap map(waymo ? std::span<const SourceLabel>(kWaymo) : std::span<const SourceLabel>(kNuscenes));
    if (!options.map.empty())
        SR_CHECK(map.apply(options.map));
    std::array<uint64_t, 256> counts{};
    for (const std::byte label : array.data)
        ++counts[std::to_integer<uint8_t>(label)];
    std::array<uint8_t, 256> targets{};
    for (uint32_t label = 0; label < 256; ++label)
        targets[label] = counts[label] ? map(label, counts[label]) : kEmpty;
    SR_CHECK(map.check(where, "voxels"));
    dense.labels.resize(voxels);
    for (size_t i = 0; i < voxels; ++i)
        dense.labels[i] = targets[std::to_integer<uint8_t>(array.data[i])];
    for (size_t a = 0; a < 3; ++a) {
        SR_TRY(const int64_t shift, tenths_of(options.origin[a], "origin"));
        dense.origin[a] += shift;
    }
    SceneGrid out;
    SR_TRY(out.grid, resample(dense, options.voxel_size, options.min_fill, where));
    out.grid.metadata["source"] = waymo ? "Occ3D-Waymo" : "Occ3D-nuScenes";
    out.warnings = map.left_out("voxels");
    out.dropped = map.dropped();
    return out;
}

} // namespace semrover
