// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/editing/editing.h"

#include "engine/conditioning/cell_objects.h"
#include "engine/job/version.h"
#include "engine/scene/cell_reach.h"
#include "runtime/base/hash.h"
#include "runtime/base/quote.h"
#include "tools/editing/grid_editor.h"

#include <algorithm>

namespace semrover {

namespace {

constexpr double kWidestHalo = 30; // metres

// everything that decides the bytes, stamps by their content
Result<Json> request_json(const EditRequest& r)
{
    Json operations = Json::array();
    for (const EditOperation& operation : r.operations) {
        Json json = operation_json(operation);
        if (operation.kind == EditOperation::Kind::insert) {
            SR_TRY(const uint64_t hash, hash_file(operation.stamp));
            json["stamp"] = hash_text(hash);
        }
        operations.push_back(json);
    }
    return Json{{"operations", operations}, {"halo", r.halo}};
}

// what changed and what lies around it, but for points that came with a stamp
std::vector<uint32_t> targets_of(const EditedGrid& edited, double halo)
{
    std::vector<uint32_t> targets =
        cells_within(edited.grid.cells, edited.touched, reach_squared(halo, edited.grid.voxel_size));
    std::erase_if(targets, [&](uint32_t c) { return std::ranges::binary_search(edited.kept, edited.grid.cells[c]); });
    return targets;
}

// colours of the objects that the tints are for. The voxels of these are targets; what lies around them is not.
Status apply_tints(const EditedGrid& edited, std::vector<SceneObject>& objects, std::vector<uint32_t>& targets)
{
    SR_TRY(const std::vector<int32_t> owners, objects_of_cells(edited.grid, objects));
    for (const EditedGrid::Tint& tint : edited.tints) {
        std::vector<uint32_t> cells;
        for (const Cell& cell : tint.cells)
            if (const auto found = find_cell(edited.grid, cell)) // a later operation may have removed it
                cells.push_back(uint32_t(*found));
        const std::vector<size_t> meant = objects_meant(owners, objects.size(), cells);
        if (meant.empty())
            return fail(ErrorCode::bad_input, "tint {}: the voxels that are selected belong to no object",
                        tint_text(tint.color));
        for (const size_t o : meant)
            objects[o].tint = tint.color;
        for (uint32_t v = 0; v < owners.size(); ++v)
            if (owners[v] != kNoObject && std::ranges::binary_search(meant, size_t(owners[v])))
                targets.push_back(v);
    }
    std::ranges::sort(targets);
    targets.erase(std::ranges::unique(targets).begin(), targets.end());
    return {};
}

// the voxels that a second grid has, too
Status keep_masked(std::vector<uint32_t>& cells, const VoxelGrid& grid, const Path& path)
{
    SR_TRY(const VoxelGrid mask, read_grid(path));
    if (mask.voxel_size != grid.voxel_size)
        return fail(ErrorCode::bad_input, "{} has voxels of {} m, the grid has voxels of {} m", quote_path(path),
                    mask.voxel_size, grid.voxel_size);
    std::erase_if(cells, [&](uint32_t c) { return !find_cell(mask, grid.cells[c]); });
    return {};
}

} // namespace

Status check_edit(const EditRequest& r)
{
    if (!(r.halo >= 0 && r.halo <= kWidestHalo))
        return fail(ErrorCode::usage, "`halo`: expected 0 to {} m, found {}", kWidestHalo, r.halo);
    for (const EditOperation& operation : r.operations)
        SR_CHECK(check_operation(operation, fmt::format("--{}", operation_name(operation.kind))));
    return {};
}

Result<Regeneration> edit_grid(const EditRequest& r)
{
    SR_CHECK(check_edit(r));
    Regeneration what;
    what.command = "edit";
    what.input = r.grid;
    SR_TRY(what.before, read_grid(r.grid));
    GridEditor editor(what.before);
    for (size_t i = 0; i < r.operations.size(); ++i)
        if (const Status applied = editor.apply(r.operations[i]); !applied)
            return fail(applied.error().code, "operation {} of {}: {}", i + 1, r.operations.size(),
                        applied.error().message);
    EditedGrid edited = editor.finish();
    if (edited.grid.cells.empty())
        return fail(ErrorCode::bad_input, "the edit leaves no voxel in {}", quote(r.grid.string()));
    what.targets = targets_of(edited, r.generates ? r.halo : 0);
    what.objects = r.objects;
    if (!edited.tints.empty() && !what.objects)
        return fail(ErrorCode::bad_input, "tint: {} is missing; `objects` says which objects there are",
                    quote_path(objects_beside(r.grid)));
    what.needs_objects = !edited.tints.empty();
    if (what.needs_objects)
        SR_CHECK(apply_tints(edited, *what.objects, what.targets));
    SR_TRY(what.request, request_json(r));
    const auto left =
        std::ranges::count_if(edited.touched, [&](const Cell& c) { return find_cell(edited.grid, c).has_value(); });
    what.counts = {{"cells", edited.grid.cells.size()},
                   {"changed", edited.touched.size()},
                   {"removed", edited.touched.size() - size_t(left)},
                   {"regenerated", r.generates ? what.targets.size() : 0}};
    what.grid = std::move(edited.grid);
    return what;
}

Result<Regeneration> select_for_inpainting(const InpaintRequest& r)
{
    Regeneration what;
    what.command = "inpaint";
    what.input = r.grid;
    what.objects = r.objects;
    SR_TRY(what.before, read_grid(r.grid));
    SR_TRY(what.targets, select_cells(what.before, r.where));
    what.request = {{"where", selection_json(r.where)}};
    if (!r.mask.empty()) {
        SR_CHECK(keep_masked(what.targets, what.before, r.mask));
        SR_TRY(const uint64_t hash, hash_file(r.mask));
        what.request["mask"] = hash_text(hash);
    }
    if (what.targets.empty())
        return fail(ErrorCode::bad_input, "no voxel of {} is selected", quote(r.grid.string()));
    what.grid = what.before;
    what.counts = {{"cells", what.grid.cells.size()}, {"regenerated", what.targets.size()}};
    return what;
}

Result<Json> write_stamp(const Path& path, const CellSelection& where, const Path& output)
{
    SR_TRY(const VoxelGrid grid, read_grid(path));
    SR_TRY(const std::vector<uint32_t> cells, select_cells(grid, where));
    if (cells.empty())
        return fail(ErrorCode::bad_input, "cut: no voxel of the grid is selected");
    VoxelGrid stamp = cut_stamp(grid, cells);
    stamp.metadata["tool"] = kProgram;
    SR_CHECK(write_grid(output, stamp));
    return Json{{"cells", cells.size()}, {"origin", stamp.metadata["stamp_origin"]}};
}

} // namespace semrover
