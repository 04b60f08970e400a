// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/labelled_points.h"

#include "engine/format/file_colors.h"
#include "engine/format/label_map.h"
#include "engine/format/ply.h"
#include "engine/scene/scene_points.h"
#include "runtime/base/dtype.h"
#include "runtime/base/keyed_random.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace semrover {

namespace {

constexpr size_t kMaxPoints = 1u << 30;
constexpr uint64_t kPointBytes = 48; // of a point, sorted
constexpr double kFaceMargin = 1e-4; // of a voxel; less than half of what 16 bits resolve at its face

struct Points {
    std::vector<std::array<double, 3>> positions; // metres, in the world
    std::vector<std::array<uint8_t, 3>> colors;   // empty when there are none
    std::vector<uint8_t> labels;
    std::vector<Cell> cells;
};

const PlyProperty* first_of(const PlyElement& element, std::initializer_list<const char*> names)
{
    for (const char* name : names)
        if (const PlyProperty* property = element.find(name); property && !property->is_list)
            return property;
    return nullptr;
}

using Columns = std::array<const PlyProperty*, 3>;

Result<Columns> position_columns(const PlyElement& element, const std::string& where)
{
    const Columns columns = {first_of(element, {"x"}), first_of(element, {"y"}), first_of(element, {"z"})};
    for (size_t a = 0; a < 3; ++a)
        if (!columns[a])
            return fail(ErrorCode::bad_input, "{}: its vertices have no property {}", where, "xyz"[a]);
    return columns;
}

// the first of those that there are
const LabelColumn* label_column(const PlyElement& element, const std::string& where, std::vector<std::string>& warnings)
{
    const LabelColumn* found = nullptr;
    for (const LabelColumn& column : label_columns()) {
        if (const PlyProperty* property = element.find(column.name); !property || property->is_list)
            continue;
        if (found)
            warnings.push_back(
                fmt::format("{}: '{}' has the labels, '{}' is not read", where, found->name, column.name));
        else
            found = &column;
    }
    return found;
}

// CloudCompare writes labels as floats
Result<uint32_t> label_number(const PlyProperty& column, size_t row, const std::string& where)
{
    const double value = column.values[row];
    if (!(value >= 0 && value < 4294967296.0) || value != std::floor(value))
        return fail(ErrorCode::bad_input, "{}: vertex {}: {}: expected a whole number, found {}", where, row,
                    quote(column.name, 60), value);
    return static_cast<uint32_t>(value);
}

struct CloudColumns {
    Columns position;
    std::optional<PlyColors> color;
    const PlyProperty* label = nullptr; // none: all points have the default one
    LabelMap map;
};

Result<CloudColumns> columns_of(const PlyElement& vertices, bool ours, const SceneGridOptions& o,
                                const std::string& where, std::vector<std::string>& warnings)
{
    CloudColumns c;
    SR_TRY(c.position, position_columns(vertices, where));
    if (const LabelColumn* column = label_column(vertices, where, warnings)) {
        c.label = vertices.find(column->name);
        SR_TRY(c.map, LabelMap::of_column(*column, ours, o.map));
    } else if (!o.default_label) {
        return fail(ErrorCode::bad_input, "{}: its vertices have no label; `default_label` gives them one", where);
    }
    SR_TRY(c.color, PlyColors::find(vertices, where, warnings));
    return c;
}

// the voxel of a point, none if it is not finite
Result<std::optional<Cell>> cell_of(const std::array<double, 3>& p, size_t row, double voxel_size,
                                    const std::string& where)
{
    std::array<double, 3> c;
    for (size_t a = 0; a < 3; ++a)
        c[a] = std::floor(p[a] / voxel_size);
    if (!std::isfinite(p[0]) || !std::isfinite(p[1]) || !std::isfinite(p[2]))
        return std::optional<Cell>();
    if (!std::ranges::all_of(c, [](double v) { return std::abs(v) <= kMaxCoordinate; }))
        return fail(ErrorCode::bad_input, "{}: vertex {}: ({}, {}, {}) m is absurd: expected within 2^20 voxels", where,
                    row, p[0], p[1], p[2]);
    return std::optional<Cell>({int32_t(c[0]), int32_t(c[1]), int32_t(c[2])});
}

std::vector<UnusedOption> unused_options(const CloudColumns& columns, const SceneGridOptions& o)
{
    std::vector<UnusedOption> unused;
    if (columns.label)
        unused.push_back({"default_label", "all points have one"});
    else
        unused.push_back({"map", "no point has a label"});
    if (!columns.color)
        unused.push_back({"labels_only", "no point has a colour"});
    if (!columns.color || o.labels_only)
        unused.push_back({"points_per_voxel", "the grid gets no points"});
    return unused;
}

enum class Handedness : uint8_t { right, left };

Status take_points(const PlyElement& vertices, bool ours, const SceneGridOptions& o, Handedness handedness,
                   const std::string& where, Points& points, SceneGrid& out)
{
    SR_TRY(CloudColumns columns, columns_of(vertices, ours, o, where, out.warnings));
    out.unused = unused_options(columns, o);
    LabelMap& map = columns.map;
    uint64_t not_finite = 0;
    for (size_t row = 0; row < vertices.rows; ++row) {
        std::array<double, 3> p;
        for (size_t a = 0; a < 3; ++a)
            p[a] = columns.position[a]->values[row] * (a == 1 && handedness == Handedness::left ? -1 : 1) + o.origin[a];
        SR_TRY(const std::optional<Cell> cell, cell_of(p, row, double(o.cell_size()), where));
        uint8_t target = o.default_label.value_or(0);
        if (cell && columns.label) {
            SR_TRY(const uint32_t number, label_number(*columns.label, row, where));
            target = map(number);
        }
        not_finite += !cell;
        if (!cell || target >= kClassCount)
            continue;
        points.positions.push_back(p);
        points.cells.push_back(*cell);
        points.labels.push_back(target);
        if (columns.color && !o.labels_only)
            points.colors.push_back(columns.color->bytes(row));
    }
    SR_CHECK(map.check(where, "points"));
    for (const std::string& line : map.assumed(where, "points"))
        out.warnings.push_back(line);
    for (const std::string& line : map.left_out("points"))
        out.warnings.push_back(line);
    out.dropped = map.dropped() + not_finite;
    if (not_finite)
        out.warnings.push_back(fmt::format("{} points that are not finite are left out", not_finite));
    if (points.positions.empty())
        return fail(ErrorCode::bad_input, "{}: there are no points", where);
    return {};
}

uint64_t random_key(uint64_t seed, const Cell& cell, uint64_t place)
{
    uint64_t key = mix64(seed + kMixStep);
    for (const int32_t c : cell)
        key = mix64(key ^ static_cast<uint32_t>(c)) + kMixStep;
    return mix64(key ^ place);
}

uint8_t majority(const Points& points, std::span<const size_t> members)
{
    std::array<size_t, kClassCount> votes{};
    for (const size_t i : members)
        ++votes[points.labels[i]];
    return static_cast<uint8_t>(std::ranges::max_element(votes) - votes.begin()); // the first of the largest
}

// n of a voxel's points, in the file's order
std::vector<size_t> chosen(const Points& points, std::span<const size_t> members, uint8_t label, size_t n,
                           uint64_t seed)
{
    std::vector<size_t> all(members.begin(), members.end());
    if (all.size() > n) {
        const auto rank = [&](size_t i) {
            return std::tuple(points.labels[i] != label, random_key(seed, points.cells[i], i), i);
        };
        std::ranges::nth_element(all, all.begin() + static_cast<ptrdiff_t>(n), {}, rank);
        all.resize(n);
        std::ranges::sort(all);
    }
    for (size_t i = 0; all.size() < n; ++i)
        all.push_back(all[i]);
    return all;
}

void append_points(VoxelGrid& grid, const Points& points, std::span<const size_t> chosen)
{
    const std::array<float, 3> center = cell_center(grid.cells.back(), grid.voxel_size);
    const double half = double(grid.voxel_size) / 2;
    for (const size_t i : chosen)
        for (size_t a = 0; a < 3; ++a) {
            const double offset = std::clamp(points.positions[i][a] - double(center[a]), -half, half);
            grid.points.push_back(float_to_half(static_cast<float>(offset)));
            grid.colors.push_back(points.colors[i][a]);
        }
    grid.generated.push_back(1);
}

// points may lie on their voxel's faces, and by rounding 1 mm beyond: a reader would find them in the next voxel
void move_inside(std::array<float, 3>& position, const Cell& cell, double voxel_size)
{
    for (size_t a = 0; a < 3; ++a) {
        const double low = (cell[a] + kFaceMargin) * voxel_size, high = (cell[a] + 1 - kFaceMargin) * voxel_size;
        position[a] = static_cast<float>(std::clamp(double(position[a]), low, high));
    }
}

Result<SceneGrid> read_points(const Path& path, const SceneGridOptions& o, Handedness handedness)
{
    const std::string where = quote_path(path);
    SceneGrid out;
    Points points;
    {
        SR_TRY(const PlyFile file, read_ply(path));
        const PlyElement* vertices = file.find("vertex");
        if (!vertices)
            return fail(ErrorCode::bad_input, "{}: has no element vertex", where);
        if (vertices->rows > kMaxPoints)
            return fail(ErrorCode::bad_input, "{}: {} vertices, at most {} are supported", where, vertices->rows,
                        kMaxPoints);
        const uint64_t most = ((256u << 20) + 6 * file.file_bytes) / kPointBytes;
        if (vertices->rows > most) // in 16 bytes, as most programs write them, or more: never
            return fail(ErrorCode::bad_input, "{}: {} vertices in {} bytes, at most {} are supported", where,
                        vertices->rows, file.file_bytes, most);
        SR_CHECK(take_points(*vertices, says_own_labels(file.comments), o, handedness, where, points, out));
    }
    std::vector<size_t> order(points.cells.size());
    std::iota(order.begin(), order.end(), size_t(0));
    std::ranges::stable_sort(order, {}, [&](size_t i) { return points.cells[i]; });
    VoxelGrid& grid = out.grid;
    grid.voxel_size = o.cell_size();
    grid.points_per_voxel = points.colors.empty() ? 0 : o.points_per_voxel;
    for (size_t begin = 0, end = 0; begin < order.size(); begin = end) {
        while (end < order.size() && points.cells[order[end]] == points.cells[order[begin]])
            ++end;
        const std::span<const size_t> members = std::span(order).subspan(begin, end - begin);
        grid.cells.push_back(points.cells[order[begin]]);
        grid.labels.push_back(majority(points, members));
        if (grid.points_per_voxel)
            append_points(grid, points,
                          chosen(points, members, grid.labels.back(), size_t(grid.points_per_voxel), o.seed));
    }
    grid.metadata["source"] = "labelled points";
    SR_CHECK(check_grid(grid, where));
    return out;
}

} // namespace

Result<SceneGrid> read_labelled_points(const Path& path, const SceneGridOptions& o)
{
    return read_points(path, o, Handedness::right);
}

Result<SceneGrid> read_carla_points(const Path& path, const SceneGridOptions& o)
{
    SR_TRY(SceneGrid out, read_points(path, o, Handedness::left));
    out.warnings.push_back(
        fmt::format("{}: CARLA's y points right: it is turned over; `format` points-ply keeps it", quote_path(path)));
    return out;
}

Splats labelled_points(const VoxelGrid& grid)
{
    const ScenePoints points = points_of(grid);
    Splats s{points.positions, {}, points.colors, {}, {}, {}, {}};
    for (size_t i = 0; i < points.size(); ++i) {
        move_inside(s.position[i], grid.cells[points.cells[i]], grid.voxel_size);
        s.label.push_back(static_cast<uint8_t>(points.labels[i]));
    }
    for (size_t v = 0; v < grid.cells.size(); ++v) {
        if (grid.has_points() && grid.generated[v])
            continue;
        s.position.push_back(cell_center(grid.cells[v], grid.voxel_size));
        s.color.push_back(label_color(grid.labels[v]));
        s.label.push_back(grid.labels[v]);
    }
    return s;
}

Status write_labelled_points(const Path& path, const VoxelGrid& grid)
{
    SR_CHECK(check_grid(grid, quote_path(path)));
    return write_points_ply(path, labelled_points(grid));
}

} // namespace semrover
