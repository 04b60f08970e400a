// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/editing/grid_editor.h"

#include "engine/scene/cell_reach.h"
#include "engine/scene/palette.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

namespace semrover {

namespace {

using Kind = EditOperation::Kind;

constexpr int32_t kGroundReach = 6;    // voxels across
constexpr int32_t kGroundStep = 2;     // voxels up or down to the nearest ground
constexpr int32_t kOwnGround = 3;      // voxels within which a column's own ground is looked for
constexpr size_t kMostAdded = 1 << 22; // voxels beside four times those that there were: copies of copies grow fast
constexpr size_t kMostKept = 1 << 20;  // of them with points, which take 300 bytes each

Cell shifted(const Cell& cell, const Cell& by)
{
    return {cell[0] + by[0], cell[1] + by[1], cell[2] + by[2]};
}

// first voxel of the column (i, j) at or above k
size_t column_at(const VoxelGrid& grid, int32_t i, int32_t j, int32_t k)
{
    return size_t(std::ranges::lower_bound(grid.cells, Cell{i, j, k}) - grid.cells.begin());
}

// calls visit(index) for the ground voxels of a column with a level of k - reach to k + reach
template <typename Visit>
void visit_ground(const VoxelGrid& grid, int32_t i, int32_t j, int32_t k, int32_t reach, const Visit& visit)
{
    for (size_t c = column_at(grid, i, j, k - reach); c < grid.cells.size(); ++c) {
        const Cell& cell = grid.cells[c];
        if (cell[0] != i || cell[1] != j || cell[2] > k + reach)
            break;
        if (is_ground(grid.labels[c]))
            visit(c);
    }
}

Cell whole_cells(const std::array<double, 3>& metres, float voxel_size)
{
    Cell cells;
    for (size_t a = 0; a < 3; ++a)
        cells[a] = int32_t(std::clamp(std::round(metres[a] / decimal_voxel_size(voxel_size)), -2e9, 2e9));
    return cells;
}

} // namespace

std::string_view operation_name(Kind kind)
{
    constexpr std::array<std::string_view, 7> kNames = {"remove", "delete", "paint", "insert", "copy", "move", "tint"};
    return kNames[size_t(kind)];
}

Status check_operation(const EditOperation& o, std::string_view where)
{
    const bool places = o.kind == Kind::insert, copies = o.kind == Kind::copy || o.kind == Kind::move;
    const auto wrong = [&](std::string_view what) { return fail(ErrorCode::usage, "{}: {}", where, what); };
    if (places && o.where.any())
        return wrong("a box, sphere, class or object has no meaning for what is inserted: cut the stamp with them");
    if (!places && !o.where.any())
        return wrong("say which voxels: a class, a box, a sphere or an object");
    if (places && o.stamp.empty())
        return wrong("the stamp is missing");
    if (places != o.at.has_value())
        return wrong(places ? "`at` is missing" : "`at` has a meaning for an inserted stamp only");
    if (copies != o.by.has_value())
        return wrong(copies ? "`by` is missing" : "`by` has a meaning for copies and moves only");
    if (!places && !copies && (o.quarter_turns || o.keep_points))
        return wrong("only a stamp, a copy or a move can be rotated or bring its points");
    if (o.fill && o.kind != Kind::paint)
        return wrong("only paint can fill");
    if (o.fill && (!o.where.bounded() || o.where.label || o.where.object))
        return wrong("what is filled is a box or a sphere, without a class or object");
    return {};
}

GridEditor::GridEditor(const VoxelGrid& grid) : base_(grid), points_per_voxel_(grid.points_per_voxel)
{
    view_.voxel_size = grid.voxel_size;
    view_.cells = grid.cells;
    view_.labels = grid.labels;
}

Status GridEditor::apply(const EditOperation& o)
{
    if (o.kind == Kind::insert) {
        SR_TRY(const VoxelGrid stamp, read_grid(o.stamp));
        if (stamp.voxel_size != base_.voxel_size)
            return fail(ErrorCode::bad_input, "{} has voxels of {} m, the grid has voxels of {} m", quote_path(o.stamp),
                        stamp.voxel_size, base_.voxel_size);
        return insert(turned(stamp, o.quarter_turns), o, cell_at(*o.at, view_.voxel_size));
    }
    if (o.kind == Kind::paint)
        return paint(o);
    if (o.kind == Kind::copy || o.kind == Kind::move)
        return copy(o);
    SR_TRY(const std::vector<uint32_t> cells, selected(o));
    std::vector<Cell> chosen;
    for (const uint32_t c : cells)
        chosen.push_back(view_.cells[c]);
    if (o.kind == Kind::tint) {
        tints_.push_back({std::move(chosen), o.color});
        return {};
    }
    drop(cells);
    if (o.kind == Kind::remove)
        close_ground(chosen);
    return {};
}

// an edit that finds nothing is a slip of the one who wrote it
Result<std::vector<uint32_t>> GridEditor::selected(const EditOperation& o) const
{
    SR_TRY(std::vector<uint32_t> cells, select_cells(view_, o.where));
    if (cells.empty())
        return fail(ErrorCode::bad_input, "{}: no voxel of the grid is selected{}", operation_name(o.kind),
                    o.where.label ? fmt::format(" (class {})", kPalette[*o.where.label].name) : "");
    return cells;
}

// for so many voxels more, and with points
Status GridEditor::check_room(const EditOperation& o, size_t more, size_t kept) const
{
    const size_t before = 4 * base_.cells.size(), most = before + (kept ? kMostKept : kMostAdded);
    if (view_.cells.size() + more <= before + kMostAdded && (!kept || kept_.size() + kept <= most))
        return {};
    return fail(ErrorCode::bad_input, "{}: an edit of a grid of {} voxels may make it one of at most {}{}",
                operation_name(o.kind), base_.cells.size(), most, kept ? " with points of stamps" : "");
}

Status GridEditor::paint(const EditOperation& o)
{
    std::map<Cell, uint8_t> labels;
    if (o.fill) {
        SR_TRY(const std::vector<Cell> places, places_in(o.where, view_.voxel_size));
        if (places.empty())
            return fail(ErrorCode::bad_input, "paint: no voxel's centre lies in the selection");
        SR_CHECK(check_room(o, places.size(), 0));
        for (const Cell& cell : places)
            labels[cell] = o.label;
    } else {
        SR_TRY(const std::vector<uint32_t> cells, selected(o));
        for (const uint32_t c : cells)
            if (view_.labels[c] != o.label)
                labels[view_.cells[c]] = o.label;
    }
    put(labels);
    return {};
}

Status GridEditor::insert(const VoxelGrid& stamp, const EditOperation& o, const Cell& at)
{
    const bool keep = o.keep_points;
    if (keep && (!stamp.has_points() || std::ranges::count(stamp.generated, 0)))
        return fail(ErrorCode::bad_input, "{}: not every voxel has points to keep", operation_name(o.kind));
    if (keep && points_per_voxel_ == 0)
        points_per_voxel_ = stamp.points_per_voxel;
    if (keep && stamp.points_per_voxel != points_per_voxel_)
        return fail(ErrorCode::bad_input, "{}: the stamp has {} points a voxel, the grid {}", operation_name(o.kind),
                    stamp.points_per_voxel, points_per_voxel_);
    SR_CHECK(check_room(o, stamp.cells.size(), keep ? stamp.cells.size() : 0));
    std::map<Cell, uint8_t> labels;
    const Cell low = lowest_corner(stamp.cells), by = {at[0] - low[0], at[1] - low[1], at[2] - low[2]};
    for (size_t c = 0; c < stamp.cells.size(); ++c)
        labels[shifted(stamp.cells[c], by)] = stamp.labels[c];
    put(labels);
    const size_t per_cell = size_t(stamp.points_per_voxel) * 3;
    for (size_t c = 0; keep && c < stamp.cells.size(); ++c) {
        const auto first = ptrdiff_t(c * per_cell), last = ptrdiff_t((c + 1) * per_cell);
        kept_[shifted(stamp.cells[c], by)] = {{stamp.points.begin() + first, stamp.points.begin() + last},
                                              {stamp.colors.begin() + first, stamp.colors.begin() + last}};
    }
    return {};
}

Status GridEditor::copy(const EditOperation& o)
{
    SR_TRY(const std::vector<uint32_t> cells, selected(o));
    std::vector<uint32_t> all(cells.size());
    std::iota(all.begin(), all.end(), 0);
    const VoxelGrid stamp = cut_stamp(with_points(cells), all);
    std::vector<Cell> from;
    for (const uint32_t c : cells)
        from.push_back(view_.cells[c]);
    if (o.kind == Kind::move) {
        drop(cells);
        close_ground(from);
    }
    const Cell to = shifted(lowest_corner(from), whole_cells(*o.by, view_.voxel_size));
    return insert(turned(stamp, o.quarter_turns), o, to);
}

const GridEditor::Content* GridEditor::kept_content(const Cell& cell) const
{
    const auto kept = kept_.find(cell);
    return kept == kept_.end() ? nullptr : &kept->second;
}

// voxels of the view with the points that they would have now
VoxelGrid GridEditor::with_points(std::span<const uint32_t> cells) const
{
    VoxelGrid out;
    out.voxel_size = view_.voxel_size;
    const bool points = base_.has_points() || !kept_.empty();
    out.points_per_voxel = points_per_voxel_;
    const size_t per_cell = size_t(points_per_voxel_) * 3;
    for (const uint32_t c : cells) {
        const Cell& cell = view_.cells[c];
        out.cells.push_back(cell);
        out.labels.push_back(view_.labels[c]);
        if (!points)
            continue;
        const size_t before = base_.has_points() ? find_cell(base_, cell).value_or(SIZE_MAX) : SIZE_MAX;
        const size_t at = out.points.size();
        out.points.resize(at + per_cell);
        out.colors.resize(at + per_cell);
        out.generated.push_back(0);
        if (const Content* content = kept_content(cell)) {
            std::ranges::copy(content->points, out.points.begin() + ptrdiff_t(at));
            std::ranges::copy(content->colors, out.colors.begin() + ptrdiff_t(at));
            out.generated.back() = 1;
        } else if (before != SIZE_MAX && base_.labels[before] == view_.labels[c]) {
            std::copy_n(&base_.points[before * per_cell], per_cell, &out.points[at]);
            std::copy_n(&base_.colors[before * per_cell], per_cell, &out.colors[at]);
            out.generated.back() = base_.generated[before];
        }
    }
    return out;
}

void GridEditor::drop(std::span<const uint32_t> cells)
{
    VoxelGrid rest;
    rest.voxel_size = view_.voxel_size;
    for (uint32_t c = 0; c < view_.cells.size(); ++c) {
        if (!cells.empty() && cells.front() == c) {
            kept_.erase(view_.cells[c]);
            cells = cells.subspan(1);
            continue;
        }
        rest.cells.push_back(view_.cells[c]);
        rest.labels.push_back(view_.labels[c]);
    }
    view_ = std::move(rest);
}

// labels of voxels that are there or not; what was kept at these places is not any more
void GridEditor::put(const std::map<Cell, uint8_t>& labels)
{
    VoxelGrid merged;
    merged.voxel_size = view_.voxel_size;
    auto next = labels.begin();
    const auto add = [&](const Cell& cell, uint8_t label) {
        merged.cells.push_back(cell);
        merged.labels.push_back(label);
    };
    for (size_t c = 0; c < view_.cells.size(); ++c) {
        for (; next != labels.end() && next->first < view_.cells[c]; ++next)
            add(next->first, next->second);
        const bool here = next != labels.end() && next->first == view_.cells[c];
        add(view_.cells[c], here ? next->second : view_.labels[c]);
        next = here ? std::next(next) : next;
    }
    for (; next != labels.end(); ++next)
        add(next->first, next->second);
    for (const auto& [cell, label] : labels)
        kept_.erase(cell);
    view_ = std::move(merged);
}

// removed: sorted, so the first of a column is its lowest
void GridEditor::close_ground(std::span<const Cell> removed)
{
    std::map<Cell, uint8_t> ground;
    for (size_t c = 0; c < removed.size(); ++c) {
        if (c > 0 && removed[c - 1][0] == removed[c][0] && removed[c - 1][1] == removed[c][1])
            continue;
        if (const auto found = ground_for(removed[c]))
            ground.insert(*found);
    }
    put(ground);
}

std::optional<std::pair<Cell, uint8_t>> GridEditor::ground_for(const Cell& lowest) const
{
    const auto [i, j, k] = lowest;
    bool own = false;
    visit_ground(view_, i, j, k, kOwnGround, [&](size_t) { own = true; });
    if (own)
        return std::nullopt;
    std::vector<size_t> nearest;
    int32_t best = kGroundReach * kGroundReach + 1;
    for (int32_t di = -kGroundReach; di <= kGroundReach; ++di)
        for (int32_t dj = -kGroundReach; dj <= kGroundReach; ++dj) {
            const int32_t distance = di * di + dj * dj;
            if (distance <= best)
                visit_ground(view_, i + di, j + dj, k, kGroundStep, [&](size_t c) {
                    if (distance < best)
                        nearest.clear();
                    best = distance;
                    nearest.push_back(c);
                });
        }
    if (best > kGroundReach * kGroundReach)
        return std::nullopt;
    std::array<int, kClassCount> votes{};
    for (const size_t c : nearest)
        ++votes[view_.labels[c]];
    const uint8_t label = uint8_t(std::ranges::max_element(votes) - votes.begin());
    int32_t level = INT32_MAX;
    for (const size_t c : nearest) {
        const int32_t k2 = view_.cells[c][2];
        if (view_.labels[c] == label &&
            std::pair(std::abs(int64_t(k2) - k), int64_t(k2)) < std::pair(std::abs(int64_t(level) - k), int64_t(level)))
            level = k2;
    }
    const Cell place = {i, j, level};
    if (k - level > 1 || find_cell(view_, place))
        return std::nullopt;
    return std::pair(place, label);
}

EditedGrid GridEditor::finish() const
{
    std::vector<uint32_t> all(view_.cells.size());
    std::iota(all.begin(), all.end(), 0);
    EditedGrid out;
    out.grid = with_points(all);
    out.grid.metadata = base_.metadata;
    out.tints = tints_;
    for (const auto& [cell, content] : kept_)
        out.kept.push_back(cell);
    size_t a = 0, b = 0; // of the grid before and after
    while (a < base_.cells.size() || b < view_.cells.size()) {
        const bool before = b == view_.cells.size() || (a < base_.cells.size() && base_.cells[a] <= view_.cells[b]);
        const bool after = a == base_.cells.size() || (b < view_.cells.size() && view_.cells[b] <= base_.cells[a]);
        const Cell& cell = before ? base_.cells[a] : view_.cells[b];
        if (before != after || base_.labels[a] != view_.labels[b] || kept_content(cell))
            out.touched.push_back(cell);
        a += before;
        b += after;
    }
    return out;
}

} // namespace semrover
