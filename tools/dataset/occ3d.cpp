// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/dataset/scene_readers.h"

#include "runtime/base/quote.h"
#include "tools/dataset/dense_labels.h"

namespace semrover {

namespace {

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

// of any type
Result<std::vector<uint8_t>> read_numbers(const NpzFile& file, std::string_view name, const Box& box,
                                          const std::string& where)
{
    const uint64_t voxels = box.shape[0] * box.shape[1] * box.shape[2];
    SR_TRY(const NpyArray array, file.read(name, 8 * voxels));
    const std::string what = fmt::format("{}: {}", where, quote(name, 60));
    if (array.shape != box.shape)
        return fail(ErrorCode::bad_input, "{}: expected shape [{}], found [{}]", what, fmt::join(box.shape, ", "),
                    fmt::join(array.shape, ", "));
    return whole_numbers<uint8_t>(array, what);
}

// everything where no mask was asked for
Status apply_mask(const NpzFile& file, const std::string& mask, const Box& box, std::vector<uint8_t>& labels,
                  uint8_t free, const std::string& where)
{
    if (mask.empty())
        return {};
    SR_TRY(const std::vector<uint8_t> counts, read_numbers(file, mask, box, where));
    for (size_t i = 0; i < labels.size(); ++i)
        if (counts[i] == 0)
            labels[i] = free;
    return {};
}

} // namespace

bool is_occ3d_shape(const std::vector<uint64_t>& shape)
{
    return shape == coarse_box().shape || shape == fine_box().shape;
}

Result<SceneGrid> read_occ3d(const Path& path, Occ3dKind kind, const SceneGridOptions& options)
{
    const std::string where = quote_path(path);
    const bool waymo = kind == Occ3dKind::waymo;
    SR_TRY(const NpzFile file, NpzFile::open(path));
    const char* name = waymo && file.has("voxel_label") ? "voxel_label" : "semantics";
    SR_TRY(const NpyHeader header, file.header(name));
    const Box& box = waymo && header.shape == fine_box().shape ? fine_box() : coarse_box();
    DenseLabels dense = box.dense;
    SR_TRY(std::vector<uint8_t> numbers, read_numbers(file, name, box, where));
    SR_CHECK(apply_mask(file, options.mask, box, numbers, waymo ? 15 : 17, where));

    SR_TRY(LabelMap map, LabelMap::of(waymo ? "occ3d-waymo" : "occ3d"));
    if (!options.map.empty())
        SR_CHECK(map.apply(options.map));
    std::array<uint64_t, 256> counts{};
    for (const uint8_t number : numbers)
        ++counts[number];
    std::array<uint8_t, 256> targets{};
    for (uint32_t label = 0; label < 256; ++label)
        targets[label] = counts[label] ? map(label, counts[label]) : kEmpty;
    SR_CHECK(map.check(where, "voxels"));
    for (const uint8_t number : numbers)
        dense.labels.push_back(targets[number]);
    for (size_t a = 0; a < 3; ++a) {
        SR_TRY(const int64_t shift, tenths_of(options.origin[a], "origin"));
        dense.origin[a] += shift;
    }
    SceneGrid out;
    out.warnings = map.left_out("voxels");
    SR_TRY(out.grid, resample(dense, options.cell_size(), options.min_fill, where, &out.warnings));
    out.grid.metadata["source"] = waymo ? "Occ3D-Waymo" : "Occ3D-nuScenes";
    out.dropped = map.dropped();
    out.unused = unused_options(dense, options.cell_size());
    return out;
}

} // namespace semrover
