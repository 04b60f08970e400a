// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/editing/editing.h"

#include "runtime/base/final_name.h"
#include "runtime/base/hash.h"
#include "runtime/base/json.h"
#include "runtime/base/quote.h"
#include "runtime/base/safetensors.h"

#include <algorithm>
#include <charconv>
#include <cstring>

namespace semrover {

namespace {

constexpr uint64_t kLargestOriginal = 1ull << 36;

// a file beside another that goes when this does
class PassingFile {
  public:
    explicit PassingFile(const Path& beside) : path_(beside.string() + ".passing") {}
    PassingFile(const PassingFile&) = delete;
    PassingFile& operator=(const PassingFile&) = delete;
    ~PassingFile()
    {
        std::error_code ignored;
        std::filesystem::remove(path_, ignored);
    }
    const Path& path() const { return path_; }

  private:
    Path path_;
};

size_t width_of(const VoxelGrid& grid)
{
    return grid.has_points() ? size_t(grid.points_per_voxel) * 3 : 0;
}

bool same_cell(const VoxelGrid& a, size_t i, const VoxelGrid& b, size_t j)
{
    const size_t width = width_of(a);
    if (a.labels[i] != b.labels[j] || width != width_of(b))
        return false;
    return width == 0 || (a.generated[i] == b.generated[j] &&
                          std::memcmp(&a.points[i * width], &b.points[j * width], width * sizeof(uint16_t)) == 0 &&
                          std::memcmp(&a.colors[i * width], &b.colors[j * width], width) == 0);
}

struct Difference {
    std::vector<size_t> before; // indices of voxels that are gone or differ
    std::vector<Cell> added;
};

// note: where one of the grids has points and the other none, points of voxels without any are zeros and do not count
Difference difference(const VoxelGrid& before, const VoxelGrid& after)
{
    Difference d;
    size_t a = 0, b = 0;
    while (a < before.cells.size() || b < after.cells.size()) {
        if (b == after.cells.size() || (a < before.cells.size() && before.cells[a] < after.cells[b])) {
            d.before.push_back(a++);
        } else if (a == before.cells.size() || after.cells[b] < before.cells[a]) {
            d.added.push_back(after.cells[b++]);
        } else {
            const bool same = before.has_points() == after.has_points() ? same_cell(before, a, after, b)
                                                                        : before.labels[a] == after.labels[b];
            if (!same)
                d.before.push_back(a);
            ++a, ++b;
        }
    }
    return d;
}

VoxelGrid part_of(const VoxelGrid& grid, const std::vector<size_t>& cells)
{
    VoxelGrid part;
    for (const size_t c : cells)
        append_cell(part, grid, c);
    return part;
}

Result<bool> is_as_we_write(const Path& file, const VoxelGrid& grid, const Path& beside)
{
    const PassingFile copy(beside);
    SR_CHECK(write_grid(copy.path(), grid));
    SR_TRY(const uint64_t ours, hash_file(copy.path()));
    SR_TRY(const uint64_t theirs, hash_file(file));
    return ours == theirs;
}

struct Record {
    std::string before, after; // hashes
    VoxelGrid part;            // its voxel size, points per voxel and metadata are those of the whole grid before
    std::vector<Cell> added;
    std::vector<uint8_t> original;
    bool had_points = false;
};

Status check_record(const SafetensorsSet& file, uint64_t n, bool points, std::string_view where)
{
    const auto rows = [&](const char* name) {
        const TensorInfo* t = file.find(name);
        return t && !t->shape.empty() ? t->shape[0] : 0;
    };
    const uint64_t c = rows("cells"), a = rows("added"), b = rows("original");
    if (!points && file.find("points"))
        return fail(ErrorCode::bad_input, "{}: points of a grid without points", where);
    const std::vector<TensorSpec> schema = {
        {"cells", {c, 3}, true, {DType::i32}},
        {"labels", {c}, c == 0, {DType::u8}},
        {"points", {c, n, 3}, c == 0 || !points, {DType::f16}},
        {"colors", {c, n, 3}, c == 0 || !points, {DType::u8}},
        {"generated", {c}, c == 0 || !points, {DType::u8}},
        {"added", {a, 3}, true, {DType::i32}},
        {"original", {b}, true, {DType::u8}},
    };
    return file.require(schema);
}

Status take_metadata(Record& r, const std::map<std::string, std::string>& metadata, std::string_view where)
{
    const auto text = [&](const char* key) {
        const auto entry = metadata.find(key);
        return entry == metadata.end() ? std::string() : entry->second;
    };
    if (text("format") != "semrover.undo" || text("version") != "1")
        return fail(ErrorCode::bad_input, "{}: not an undo record of this version", where);
    r.before = text("before");
    r.after = text("after");
    r.had_points = text("points") == "yes";
    const std::string n = text("points_per_voxel"), edge = text("voxel_size");
    const auto [n_end, n_error] = std::from_chars(n.data(), n.data() + n.size(), r.part.points_per_voxel);
    const auto [e_end, e_error] = std::from_chars(edge.data(), edge.data() + edge.size(), r.part.voxel_size);
    if (n_error != std::errc() || e_error != std::errc() || r.part.points_per_voxel < 0 ||
        r.part.points_per_voxel > 4096)
        return fail(ErrorCode::bad_input, "{}: voxel_size and points_per_voxel: expected numbers, found {} and {}",
                    where, quote(edge), quote(n));
    SR_TRY(const Json own, parse_json(text("metadata"), where));
    for (const auto& [key, value] : own.items()) {
        if (!own.is_object() || !value.is_string())
            return fail(ErrorCode::bad_input, "{}: metadata: expected an object of strings", where);
        r.part.metadata[key] = value.get<std::string>();
    }
    return {};
}

std::vector<Cell> cells_of(const std::vector<int32_t>& coordinates)
{
    std::vector<Cell> cells(coordinates.size() / 3);
    for (size_t i = 0; i < cells.size() * 3; ++i)
        cells[i / 3][i % 3] = coordinates[i];
    return cells;
}

Result<Record> read_record(const Path& path)
{
    const std::string where = quote_path(path);
    SR_TRY(const SafetensorsSet file, SafetensorsSet::open(path));
    Record r;
    SR_CHECK(take_metadata(r, file.shards()[0].metadata(), where));
    SR_CHECK(check_record(file, uint64_t(r.part.points_per_voxel), r.had_points, where));
    r.part.cells = cells_of(elements<int32_t>(file, "cells"));
    r.part.labels = elements<uint8_t>(file, "labels");
    r.part.points = elements<uint16_t>(file, "points");
    r.part.colors = elements<uint8_t>(file, "colors");
    r.part.generated = elements<uint8_t>(file, "generated");
    r.added = cells_of(elements<int32_t>(file, "added"));
    r.original = elements<uint8_t>(file, "original");
    if (!std::ranges::is_sorted(r.part.cells) || !std::ranges::is_sorted(r.added))
        return fail(ErrorCode::bad_input, "{}: voxels are not sorted", where);
    return r;
}

void append(VoxelGrid& to, const VoxelGrid& from, size_t cell, bool points)
{
    to.cells.push_back(from.cells[cell]);
    to.labels.push_back(from.labels[cell]);
    if (!points)
        return;
    const size_t width = width_of(from);
    const auto at = ptrdiff_t(cell * width), end = ptrdiff_t((cell + 1) * width);
    to.points.insert(to.points.end(), from.points.begin() + at, from.points.begin() + end);
    to.colors.insert(to.colors.end(), from.colors.begin() + at, from.colors.begin() + end);
    to.generated.push_back(from.generated[cell]);
}

// the edited grid with what was added taken out and what was changed put back
Result<VoxelGrid> rebuilt(const Record& r, const VoxelGrid& edited)
{
    if (r.had_points && (!edited.has_points() || edited.points_per_voxel != r.part.points_per_voxel))
        return fail(ErrorCode::bad_input, "the edited grid and its undo record disagree about points");
    VoxelGrid out;
    out.voxel_size = r.part.voxel_size;
    out.points_per_voxel = r.part.points_per_voxel;
    out.metadata = r.part.metadata;
    size_t part = 0;
    for (size_t c = 0; c < edited.cells.size(); ++c) {
        for (; part < r.part.cells.size() && r.part.cells[part] < edited.cells[c]; ++part)
            append(out, r.part, part, r.had_points);
        if (part < r.part.cells.size() && r.part.cells[part] == edited.cells[c])
            append(out, r.part, part++, r.had_points);
        else if (!std::ranges::binary_search(r.added, edited.cells[c]))
            append(out, edited, c, r.had_points);
    }
    for (; part < r.part.cells.size(); ++part)
        append(out, r.part, part, r.had_points);
    return out;
}

} // namespace

Status write_undo(const Path& path, const Path& before_path, const VoxelGrid& before, const Path& after_path,
                  const VoxelGrid& after)
{
    SR_TRY(const uint64_t before_hash, hash_file(before_path));
    SR_TRY(const uint64_t after_hash, hash_file(after_path));
    SR_TRY(const bool ours, is_as_we_write(before_path, before, path));
    std::vector<std::byte> original;
    if (!ours) {
        SR_TRY(original, read_file(before_path, kLargestOriginal));
    }
    const Difference d = difference(before, after);
    const VoxelGrid part = part_of(before, d.before);
    const uint64_t c = part.cells.size(), n = uint64_t(before.points_per_voxel);
    std::vector<TensorData> tensors;
    const auto add = [&](const char* name, DType dtype, std::vector<uint64_t> shape, const auto& values) {
        if (!values.empty())
            tensors.push_back({name, dtype, std::move(shape), std::as_bytes(std::span(values))});
    };
    add("cells", DType::i32, {c, 3}, part.cells);
    add("labels", DType::u8, {c}, part.labels);
    add("points", DType::f16, {c, n, 3}, part.points);
    add("colors", DType::u8, {c, n, 3}, part.colors);
    add("generated", DType::u8, {c}, part.generated);
    add("added", DType::i32, {d.added.size(), 3}, d.added);
    add("original", DType::u8, {original.size()}, original);
    return write_safetensors(path, tensors,
                             {{"format", "semrover.undo"},
                              {"version", "1"},
                              {"before", hash_text(before_hash)},
                              {"after", hash_text(after_hash)},
                              {"points", before.has_points() ? "yes" : "no"},
                              {"points_per_voxel", fmt::format("{}", n)},
                              {"voxel_size", fmt::format("{}", before.voxel_size)},
                              {"metadata", json_text(Json(before.metadata))}});
}

Status undo_edit(const Path& record, const Path& edited, const Path& output)
{
    SR_TRY(const Record r, read_record(record));
    SR_TRY(const uint64_t hash, hash_file(edited));
    if (hash_text(hash) != r.after)
        return fail(ErrorCode::bad_input, "{} is not the grid that {} was made for: its hash is {}, expected {}",
                    quote_path(edited), quote_path(record), hash_text(hash), quote(r.after));
    const PassingFile whole(output); // looked at before it takes the output's place
    if (r.original.empty()) {
        SR_TRY(const VoxelGrid grid, read_grid(edited));
        SR_TRY(const VoxelGrid before, rebuilt(r, grid));
        SR_CHECK(write_grid(whole.path(), before));
    } else {
        SR_CHECK(write_file_atomically(whole.path(), std::as_bytes(std::span(r.original))));
    }
    SR_TRY(const uint64_t found, hash_file(whole.path()));
    if (hash_text(found) != r.before)
        return fail(ErrorCode::bad_input, "{} does not give the grid back: the hash is {}, expected {}",
                    quote_path(record), hash_text(found), quote(r.before));
    return rename_whole(whole.path(), output);
}

} // namespace semrover
