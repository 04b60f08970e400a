// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/dataset/scene_readers.h"

#include "engine/format/label_map.h"
#include "runtime/base/json.h"
#include "runtime/base/quote.h"
#include "tools/dataset/vox_file.h"
#include "tools/dataset/voxel_sizes.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

constexpr uint64_t kMaxFileBytes = uint64_t(1) << 30;
constexpr size_t kMaxVoxels = 1u << 25, kMaxVisits = 1u << 20, kMaxDepth = 64;
constexpr size_t kMaxRepeated = 1u << 22; // voxels of models that are placed again

struct Placed {
    Cell cell;
    uint32_t order; // of two in a cell, the later counts
    uint8_t color;
};

// walks the scene from its root
class VoxPlacement {
  public:
    VoxPlacement(const VoxFile& file, std::string_view where) : file_(file), where_(where), placed_(file.models.size())
    {
    }

    Status walk(uint32_t id, const VoxTransform& transform, size_t depth);
    Status place(uint32_t model, const VoxTransform& transform);

    std::vector<Placed> voxels;
    size_t hidden = 0, frames = 0; // nodes left out; models of animations that are not the first

  private:
    bool is_hidden(const VoxNode& node) const
    {
        const auto layer = file_.hidden_layers.find(node.layer);
        return node.hidden || (layer != file_.hidden_layers.end() && layer->second);
    }

    const VoxFile& file_;
    std::string_view where_;
    std::vector<bool> placed_; // models
    size_t visits_ = 0, repeated_ = 0;
};

Status VoxPlacement::place(uint32_t index, const VoxTransform& transform)
{
    if (index >= file_.models.size())
        return fail(ErrorCode::bad_input, "{}: the scene names model {}, there are {}", where_, index,
                    file_.models.size());
    const VoxModel& model = file_.models[index];
    repeated_ += placed_[index] ? model.voxels.size() : 0;
    placed_[index] = true;
    if (repeated_ > kMaxRepeated)
        return fail(ErrorCode::bad_input, "{}: model {} of {} voxels is placed again: more than {} voxels are repeated",
                    where_, index, model.voxels.size(), kMaxRepeated);
    if (voxels.size() + model.voxels.size() > kMaxVoxels)
        return fail(ErrorCode::bad_input, "{}: the scene has more than {} voxels", where_, kMaxVoxels);
    for (const VoxVoxel& v : model.voxels)
        voxels.push_back({vox_cell(transform, model, v), static_cast<uint32_t>(voxels.size()), v.color});
    return {};
}

Status VoxPlacement::walk(uint32_t id, const VoxTransform& transform, size_t depth)
{
    const auto found = file_.nodes.find(id);
    if (found == file_.nodes.end())
        return fail(ErrorCode::bad_input, "{}: the scene has no node {}", where_, id);
    if (++visits_ > kMaxVisits || depth > kMaxDepth)
        return fail(ErrorCode::bad_input, "{}: node {}: the scene is deeper than {} or has a cycle", where_, id,
                    kMaxDepth);
    const VoxNode& node = found->second;
    if (is_hidden(node)) {
        ++hidden;
        return {};
    }
    if (node.kind == VoxNode::Kind::shape) {
        if (node.children.empty())
            return {};
        frames += node.children.size() - 1;
        return place(node.children[0], transform);
    }
    const VoxTransform here = compose(transform, node.transform);
    for (const int64_t t : here.translation)
        if (std::abs(t) > (1 << 20))
            return fail(ErrorCode::bad_input, "{}: node {}: a translation beyond 2^20", where_, id);
    for (const uint32_t child : node.children)
        SR_CHECK(walk(child, here, depth + 1));
    return {};
}

uint8_t nearest_class(const std::array<uint8_t, 3>& color)
{
    const auto distance = [&](const SemanticClass& c) {
        int sum = 0;
        for (size_t a = 0; a < 3; ++a)
            sum += (c.color[a] - color[a]) * (c.color[a] - color[a]);
        return sum;
    };
    return static_cast<uint8_t>(std::ranges::min_element(kPalette, {}, distance) - kPalette.begin());
}

LabelMap palette_map(const VoxFile& file, bool nearest)
{
    LabelMap map;
    for (uint32_t i = 1; i < 256; ++i) {
        const auto& c = file.palette[i];
        const uint8_t label = nearest_class(c);
        const bool known = nearest || kPalette[label].color == c;
        map.set(i, fmt::format("#{:02x}{:02x}{:02x}", c[0], c[1], c[2]),
                known ? std::optional<uint8_t>(label) : std::nullopt);
    }
    return map;
}

// the scene's voxels, or the first model's
Status place_all(const VoxFile& file, VoxPlacement& placement, std::string_view where,
                 std::vector<std::string>& warnings)
{
    if (!file.nodes.empty()) {
        SR_CHECK(placement.walk(0, {}, 0));
    } else {
        VoxTransform corner; // voxel (0, 0, 0) becomes cell (0, 0, 0)
        for (size_t a = 0; a < 3; ++a)
            corner.translation[a] = file.models[0].size[a] / 2;
        SR_CHECK(placement.place(0, corner));
        if (file.models.size() > 1)
            warnings.push_back(
                fmt::format("{} models without a place in a scene are left out", file.models.size() - 1));
    }
    if (placement.hidden)
        warnings.push_back(fmt::format("{} hidden nodes are left out", placement.hidden));
    if (placement.frames)
        warnings.push_back(fmt::format("{} later models of animations are left out", placement.frames));
    if (placement.voxels.empty())
        return fail(ErrorCode::bad_input, "{}: the scene has no voxels", where);
    return {};
}

// how many voxels a later one covers
size_t take_cells(std::vector<Placed>& voxels, const Cell& shift, LabelMap& map, VoxelGrid& grid)
{
    size_t covered = 0;
    std::ranges::sort(voxels, {}, [](const Placed& v) { return std::pair(v.cell, v.order); });
    for (size_t i = 0; i < voxels.size(); ++i) {
        if (i + 1 < voxels.size() && voxels[i + 1].cell == voxels[i].cell) {
            ++covered;
            continue;
        }
        const uint8_t label = map(voxels[i].color);
        if (label >= kClassCount)
            continue;
        Cell cell = voxels[i].cell;
        for (size_t a = 0; a < 3; ++a)
            cell[a] += shift[a];
        grid.cells.push_back(cell);
        grid.labels.push_back(label);
    }
    return covered;
}

} // namespace

Result<SceneGrid> read_vox(const Path& path, const SceneGridOptions& o)
{
    const std::string where = quote_path(path);
    const VoxelSizes sizes{o.file_voxel_size > 0 ? o.file_voxel_size : double(o.cell_size()), o.cell_size()};
    SR_TRY(const Cell shift, whole_voxels(o.origin, sizes.voxel));
    SR_TRY(const std::vector<std::byte> bytes, read_file(path, kMaxFileBytes));
    SR_TRY(const VoxFile file, parse_vox(bytes, where));
    SceneGrid out;
    VoxPlacement placement(file, where);
    SR_CHECK(place_all(file, placement, where, out.warnings));
    LabelMap map = palette_map(file, o.nearest_color);
    if (!o.map.empty())
        SR_CHECK(map.apply(o.map));
    const size_t covered = take_cells(placement.voxels, shift, map, out.grid);
    SR_CHECK(map.check(where, "voxels", "`map` says what they are, `nearest_color` takes the nearest class's"));
    for (const std::string& line : map.left_out("voxels"))
        out.warnings.push_back(line);
    if (covered)
        out.warnings.push_back(fmt::format("{} voxels under those of a later model are left out", covered));
    out.dropped = map.dropped() + covered;
    SR_CHECK(coarsen(out.grid, sizes, o.min_fill, where, out.warnings));
    if (sizes.same())
        out.unused.push_back({"min_fill", "a cell is a voxel"});
    out.grid.metadata["source"] = "MagicaVoxel";
    SR_CHECK(check_grid(out.grid, where));
    return out;
}

Status write_vox(const Path& path, const VoxelGrid& grid)
{
    SR_CHECK(check_grid(grid, quote_path(path)));
    Cell low = grid.cells[0];
    for (const Cell& cell : grid.cells)
        for (size_t a = 0; a < 3; ++a)
            low[a] = std::min(low[a], cell[a]);
    std::map<Cell, VoxModel> blocks;
    for (size_t v = 0; v < grid.cells.size(); ++v) {
        Cell block, inside;
        for (size_t a = 0; a < 3; ++a) {
            block[a] = (grid.cells[v][a] - low[a]) / 256;
            inside[a] = (grid.cells[v][a] - low[a]) % 256;
        }
        VoxModel& model = blocks[block];
        for (size_t a = 0; a < 3; ++a)
            model.size[a] = std::max(model.size[a], uint32_t(inside[a]) + 1);
        model.voxels.push_back(
            {uint8_t(inside[0]), uint8_t(inside[1]), uint8_t(inside[2]), uint8_t(grid.labels[v] + 1)});
    }
    std::vector<VoxModel> models;
    std::vector<std::array<int64_t, 3>> translations;
    for (auto& [block, model] : blocks) {
        std::array<int64_t, 3>& t = translations.emplace_back();
        for (size_t a = 0; a < 3; ++a)
            t[a] = int64_t(low[a]) + 256 * int64_t(block[a]) + model.size[a] / 2;
        models.push_back(std::move(model));
    }
    std::vector<std::array<uint8_t, 3>> colors;
    for (const SemanticClass& c : kPalette)
        colors.push_back(c.color);
    return write_file_atomically(path, encode_vox(models, translations, colors));
}

} // namespace semrover
