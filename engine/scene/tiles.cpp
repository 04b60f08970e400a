// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/scene/tiles.h"

#include "engine/scene/cell_reach.h"
#include "runtime/base/json.h"
#include "runtime/base/json_numbers.h"
#include "runtime/base/quote.h"

#include <algorithm>

namespace semrover {

namespace {

namespace fs = std::filesystem;

constexpr int32_t kMostTileCells = 1 << 16;
constexpr double kFarthestCell = 1 << 20;

int32_t floor_divided(int32_t value, int32_t by)
{
    return value / by - (value % by < 0);
}

Result<int64_t> whole_number(const Json& json, double low, double high, std::string_view where)
{
    SR_TRY(const double value, finite_number(json, where));
    if (value != std::floor(value) || value < low || value > high)
        return fail(ErrorCode::bad_input, "{}: expected a whole number from {} to {}, found {}", where, low, high,
                    value);
    return int64_t(value);
}

Result<const Json*> member(const Json& object, const char* key, std::string_view where)
{
    const auto entry = object.find(key);
    if (entry == object.end())
        return fail(ErrorCode::bad_input, "{}: {} is missing", where, key);
    return &*entry;
}

Result<TileEntry> parse_entry(const Json& item, std::string_view where)
{
    TileEntry entry;
    SR_TRY(const int64_t cells, whole_number(item[2], 1, 4294967295.0, where));
    entry.cells = uint64_t(cells);
    if (item.size() == 3)
        return entry;
    if (item[3].is_string())
        entry.key = item[3].get<std::string>();
    // note: it becomes part of a path
    if (entry.key.size() != 16 || entry.key.find_first_not_of("0123456789abcdef") != std::string::npos)
        return fail(ErrorCode::bad_input, "{}: expected a key of 16 hexadecimal digits", where);
    return entry;
}

Result<std::map<TileIndex, TileEntry>> parse_tiles(const Json& list, int32_t edge, std::string_view where)
{
    if (!list.is_array() || list.empty())
        return fail(ErrorCode::bad_input, "{}: tiles: expected an array of [X, Y, voxels], found {}", where,
                    list.is_array() ? "an empty one" : list.type_name());
    std::map<TileIndex, TileEntry> tiles;
    const double reach = std::ceil(kFarthestCell / edge) + 1;
    for (const Json& item : list) {
        const std::string here = fmt::format("{}: tiles: entry {}", where, tiles.size());
        if (!item.is_array() || (item.size() != 3 && item.size() != 4))
            return fail(ErrorCode::bad_input, "{}: expected [X, Y, voxels] or [X, Y, voxels, key]", here);
        SR_TRY(const int64_t x, whole_number(item[0], -reach, reach, here));
        SR_TRY(const int64_t y, whole_number(item[1], -reach, reach, here));
        SR_TRY(const TileEntry entry, parse_entry(item, here));
        if (!tiles.emplace(TileIndex{int32_t(x), int32_t(y)}, entry).second)
            return fail(ErrorCode::bad_input, "{}: tile ({}, {}) is given twice", here, x, y);
    }
    return tiles;
}

Status parse_metadata(const Json& index, std::map<std::string, std::string>& metadata, std::string_view where)
{
    const Json own = index.value("metadata", Json::object());
    if (!own.is_object())
        return fail(ErrorCode::bad_input, "{}: metadata: expected an object, found {}", where, own.type_name());
    for (const auto& [key, value] : own.items()) {
        if (!value.is_string())
            return fail(ErrorCode::bad_input, "{}: metadata: {}: expected a string", where, quote(key));
        metadata[key] = value.get<std::string>();
    }
    return {};
}

} // namespace

TileIndex tile_of(const Cell& cell, int32_t edge)
{
    return {floor_divided(cell[0], edge), floor_divided(cell[1], edge)};
}

Result<int32_t> tile_cells_of(double metres, float voxel_size)
{
    const double cells = std::round(metres / decimal_voxel_size(voxel_size));
    if (!(cells >= 1 && cells <= kMostTileCells))
        return fail(ErrorCode::bad_input, "a tile of {} m is {} voxels wide, expected 1 to {}", metres, cells,
                    kMostTileCells);
    return int32_t(cells);
}

std::string tile_name(const TileIndex& tile, std::string_view key)
{
    return fmt::format("tile_{}_{}{}{}.sgrid", tile[0], tile[1], key.empty() ? "" : ".", key);
}

bool TileFolder::is_one(const Path& path)
{
    return is_folder(path) && is_there(path / "index.json");
}

Result<TileFolder> TileFolder::open(const Path& folder)
{
    TileFolder f;
    f.path_ = folder;
    const Path path = folder / "index.json";
    const std::string where = quote_path(path);
    SR_TRY(const Json index, read_json(path));
    if (!index.is_object() || index.value("format", Json()) != "semrover.tiles" || index.value("version", Json()) != 1)
        return fail(ErrorCode::bad_input, "{}: not an index of tiles, version 1", where);
    SR_TRY(const Json* edge, member(index, "tile_cells", where));
    SR_TRY(f.tile_cells_, whole_number(*edge, 1, kMostTileCells, fmt::format("{}: tile_cells", where)));
    SR_TRY(const Json* voxel, member(index, "voxel_size", where));
    SR_TRY(const double voxel_size, finite_number(*voxel, fmt::format("{}: voxel_size", where)));
    if (!(voxel_size >= 1e-3 && voxel_size <= 1e3))
        return fail(ErrorCode::bad_input, "{}: expected a voxel size of 0.001 to 1000 m, found {}", where, voxel_size);
    f.voxel_size_ = float(voxel_size);
    SR_TRY(const Json* points, member(index, "points_per_voxel", where));
    SR_TRY(f.points_per_voxel_, whole_number(*points, 0, 4096, fmt::format("{}: points_per_voxel", where)));
    SR_TRY(const Json* has_points, member(index, "has_points", where));
    if (!has_points->is_boolean())
        return fail(ErrorCode::bad_input, "{}: has_points: expected true or false", where);
    f.has_points_ = *has_points;
    SR_CHECK(parse_metadata(index, f.metadata_, where));
    SR_TRY(const Json* tiles, member(index, "tiles", where));
    SR_TRY(f.tiles_, parse_tiles(*tiles, f.tile_cells_, where));
    for (const auto& [tile, entry] : f.tiles_) {
        const std::string name = tile_name(tile, entry.key);
        if (!is_file(folder / name))
            return fail(ErrorCode::bad_input, "{} names {}, which is not there", where, quote(name));
    }
    return f;
}

uint64_t TileFolder::cell_count() const
{
    uint64_t count = 0;
    for (const auto& [tile, entry] : tiles_)
        count += entry.cells;
    return count;
}

std::vector<TileIndex> TileFolder::tiles_in(const CellWindow& window) const
{
    return semrover::tiles_in(tiles_, window, tile_cells_);
}

Result<VoxelGrid> TileFolder::read(const TileIndex& tile) const
{
    const auto entry = tiles_.find(tile);
    SR_ASSERT(entry != tiles_.end(), "tile ({}, {}) is not in the index", tile[0], tile[1]);
    const Path path = path_ / tile_name(tile, entry->second.key);
    const std::string where = quote_path(path);
    SR_TRY(VoxelGrid grid, read_grid(path));
    if (grid.voxel_size != voxel_size_)
        return fail(ErrorCode::bad_input, "{} has voxels of {} m, the index says {} m", where, grid.voxel_size,
                    voxel_size_);
    if (grid.has_points() != has_points_ || (has_points_ && grid.points_per_voxel != points_per_voxel_))
        return fail(ErrorCode::bad_input, "{} has {} points a voxel, the index says {}", where,
                    grid.has_points() ? grid.points_per_voxel : 0, has_points_ ? points_per_voxel_ : 0);
    if (grid.cells.size() != entry->second.cells)
        return fail(ErrorCode::bad_input, "{} has {} voxels, the index says {}", where, grid.cells.size(),
                    entry->second.cells);
    for (const Cell& cell : grid.cells)
        if (tile_of(cell, tile_cells_) != tile)
            return fail(ErrorCode::bad_input, "{} holds voxel ({}, {}, {}), which belongs to tile ({}, {})", where,
                        cell[0], cell[1], cell[2], tile_of(cell, tile_cells_)[0], tile_of(cell, tile_cells_)[1]);
    return grid;
}

Result<VoxelGrid> TileFolder::read_all() const
{
    VoxelGrid out;
    out.voxel_size = voxel_size_;
    out.points_per_voxel = points_per_voxel_;
    out.metadata = metadata_;
    for (const auto& [tile, entry] : tiles_) {
        SR_TRY(const VoxelGrid part, read(tile));
        append_cells(out, part);
    }
    sort_cells(out);
    SR_CHECK(check_grid(out, quote_path(path_)));
    return out;
}

CellWindow tile_window(const TileIndex& tile, int32_t edge, int32_t halo)
{
    return {{tile[0] * edge - halo, tile[1] * edge - halo},
            {(tile[0] + 1) * edge - 1 + halo, (tile[1] + 1) * edge - 1 + halo}};
}

void append_labels(VoxelGrid& to, const VoxelGrid& from, const CellWindow& window)
{
    const auto begin = std::ranges::lower_bound(from.cells, Cell{window.low[0], INT32_MIN, INT32_MIN});
    for (size_t c = size_t(begin - from.cells.begin()); c < from.cells.size() && from.cells[c][0] <= window.high[0];
         ++c)
        if (window.holds(from.cells[c])) {
            to.cells.push_back(from.cells[c]);
            to.labels.push_back(from.labels[c]);
        }
}

void append_cells(VoxelGrid& grid, const VoxelGrid& part)
{
    SR_ASSERT(grid.cells.empty() || grid.has_points() == part.has_points(), "one has points, the other has none");
    const auto append = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
    append(grid.cells, part.cells);
    append(grid.labels, part.labels);
    append(grid.points, part.points);
    append(grid.colors, part.colors);
    append(grid.generated, part.generated);
}

Status write_tile_index(const Path& folder, const TileFolderInfo& info, const std::map<TileIndex, TileEntry>& tiles)
{
    Json list = Json::array();
    for (const auto& [tile, entry] : tiles) {
        list.push_back({tile[0], tile[1], entry.cells});
        if (!entry.key.empty())
            list.back().push_back(entry.key);
    }
    const Json index{{"format", "semrover.tiles"},
                     {"version", 1},
                     {"voxel_size", short_number(info.voxel_size)},
                     {"tile_cells", info.tile_cells},
                     {"points_per_voxel", info.points_per_voxel},
                     {"has_points", info.has_points},
                     {"metadata", info.metadata},
                     {"tiles", list}};
    return write_file_atomically(folder / "index.json", json_text(index) + "\n");
}

std::map<TileIndex, VoxelGrid> cut_tiles(const VoxelGrid& grid, int32_t edge)
{
    std::map<TileIndex, VoxelGrid> tiles;
    for (size_t c = 0; c < grid.cells.size(); ++c)
        append_cell(tiles[tile_of(grid.cells[c], edge)], grid, c);
    for (auto& [index, tile] : tiles) {
        tile.voxel_size = grid.voxel_size;
        tile.points_per_voxel = grid.points_per_voxel;
    }
    return tiles;
}

Status write_tiles(const Path& folder, const VoxelGrid& grid, int32_t edge)
{
    SR_ASSERT(edge >= 1 && edge <= kMostTileCells, "tiles of {} voxels", edge);
    SR_CHECK(make_folder(folder));
    std::map<TileIndex, TileEntry> entries;
    for (const auto& [index, tile] : cut_tiles(grid, edge)) {
        SR_CHECK(write_grid(folder / tile_name(index), tile));
        entries[index] = {.cells = tile.cells.size()};
    }
    return write_tile_index(folder, {grid.voxel_size, edge, grid.points_per_voxel, grid.has_points(), grid.metadata},
                            entries);
}

Result<VoxelGrid> read_grid_or_tiles(const Path& path)
{
    if (!TileFolder::is_one(path))
        return read_grid(path);
    SR_TRY(const TileFolder folder, TileFolder::open(path));
    return folder.read_all();
}

std::array<TileIndex, 8> tiles_around(const TileIndex& t)
{
    return {{{t[0] - 1, t[1] - 1},
             {t[0] - 1, t[1]},
             {t[0] - 1, t[1] + 1},
             {t[0], t[1] - 1},
             {t[0], t[1] + 1},
             {t[0] + 1, t[1] - 1},
             {t[0] + 1, t[1]},
             {t[0] + 1, t[1] + 1}}};
}

} // namespace semrover
