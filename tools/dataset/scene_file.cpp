// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/dataset/scene_file.h"

#include "engine/format/labelled_points.h"
#include "engine/format/ply_reader.h"
#include "engine/format/splat_file.h"
#include "runtime/base/quote.h"
#include "tools/dataset/scene_readers.h"

#include <algorithm>
#include <cctype>

namespace semrover {

namespace {

// in the order of SceneFormat
constexpr SceneFormatFacts kFormats[] = {
    {SceneFormat::sgrid, "sgrid", ".sgrid", false, true},
    {SceneFormat::npz, "npz", ".npz", false, true},
    {SceneFormat::semantickitti, "semantickitti", ".label .bin", false, true},
    {SceneFormat::occ3d_nuscenes, "occ3d-nuscenes", ".npz", false, false},
    {SceneFormat::occ3d_waymo, "occ3d-waymo", ".npz", false, false},
    {SceneFormat::array, "array", ".npy", false, false},
    {SceneFormat::vox, "vox", ".vox", false, true},
    {SceneFormat::points_ply, "points-ply", ".ply", false, true},
    {SceneFormat::carla_points, "carla-points", ".ply", false, false},
    {SceneFormat::gaussian_3d, "3dgs", ".ply", true, true},
    {SceneFormat::gaussian_2d, "2dgs", ".ply", true, true},
    {SceneFormat::inria62, "inria62", ".ply", true, true},
    {SceneFormat::gltf_splats, "gltf-splats", ".glb", true, true},
    {SceneFormat::splat, "splat", ".splat", true, true},
};

bool has_extension(const SceneFormatFacts& facts, std::string extension)
{
    std::ranges::transform(extension, extension.begin(), [](unsigned char c) { return std::tolower(c); });
    return !extension.empty() &&
           (" " + std::string(facts.extensions) + " ").find(" " + extension + " ") != std::string::npos;
}

// splats as others compress them: no packaged library reads them, and their maker's program does
constexpr std::string_view kForeignSplats[] = {".spz", ".sog", ".ksplat", ".lcc"};

bool is_foreign(const Path& path)
{
    return std::ranges::find(kForeignSplats, path.extension().string()) != std::end(kForeignSplats);
}

Error unknown_extension(const Path& path)
{
    if (is_foreign(path))
        return {ErrorCode::bad_input,
                fmt::format("{}: {} is a compressed format of splats, which is neither read nor written; "
                            "`npx @playcanvas/splat-transform` makes it of a .ply, and a .ply of it",
                            quote_path(path), printable(path.extension().string()))};
    std::string list;
    for (const SceneFormatFacts& f : kFormats)
        list += fmt::format("{}{} ({})", list.empty() ? "" : ", ", f.name, f.extensions);
    return {ErrorCode::bad_input, fmt::format("{}: no extension of a scene; formats are {}", quote_path(path), list)};
}

Result<SceneFormat> ply_format(const Path& path)
{
    SR_TRY(const MappedFile file, MappedFile::open(path));
    const std::string_view bytes(reinterpret_cast<const char*>(file.bytes().data()), file.bytes().size());
    SR_TRY(const PlyHeader header, parse_ply_header(bytes, quote_path(path)));
    const auto vertex = std::ranges::find(header.elements, "vertex", &PlyLayout::name);
    const auto has = [&](std::string_view name) {
        return vertex != header.elements.end() && std::ranges::find(vertex->names, name) != vertex->names.end();
    };
    if (has("packed_position"))
        return fail(ErrorCode::bad_input,
                    "{}: a compressed .ply of PlayCanvas, which is not read; `npx @playcanvas/splat-transform` makes a "
                    "plain .ply of it",
                    quote_path(path));
    if (!has("scale_0") || !has("rot_0"))
        return has("ObjTag") ? SceneFormat::carla_points : SceneFormat::points_ply;
    return has("f_rest_44") ? SceneFormat::inria62
           : has("scale_2") ? SceneFormat::gaussian_3d
                            : SceneFormat::gaussian_2d;
}

Result<SceneFormat> npz_format(const Path& path)
{
    SR_TRY(const NpzFile file, NpzFile::open(path));
    if (file.has("cells"))
        return SceneFormat::npz;
    if (file.has("voxel_label"))
        return SceneFormat::occ3d_waymo;
    if (!file.has("semantics") && !only_label_array(file).empty())
        return SceneFormat::array;
    if (!file.has("semantics"))
        return fail(
            ErrorCode::bad_input,
            "{}: expected an array cells, semantics or voxel_label, or one array [X, Y, Z] or [N, 4] alone, found {}",
            quote_path(path), printable(fmt::format("{}", fmt::join(file.names(), ", ")), 200));
    // both of Occ3D's are distributed so; Waymo's have other masks, or the fine shape
    SR_TRY(const NpyHeader header, file.header("semantics"));
    if (!is_occ3d_shape(header.shape) && !only_label_array(file).empty())
        return SceneFormat::array;
    const bool waymo =
        file.has("infov") || file.has("origin_voxel_state") || (header.shape.size() == 3 && header.shape[0] == 1600);
    return waymo ? SceneFormat::occ3d_waymo : SceneFormat::occ3d_nuscenes;
}

Result<SceneGrid> plain(Result<VoxelGrid> grid)
{
    if (!grid)
        return tl::make_unexpected(std::move(grid).error());
    return SceneGrid{std::move(*grid), {}, 0, {}};
}

} // namespace

std::span<const SceneFormatFacts> scene_formats()
{
    return kFormats;
}

const SceneFormatFacts& facts_of(SceneFormat format)
{
    return kFormats[static_cast<size_t>(format)];
}

std::optional<SceneFormat> scene_format_of_name(std::string_view name)
{
    const auto found = std::ranges::find(kFormats, name, &SceneFormatFacts::name);
    return found == std::end(kFormats) ? std::nullopt : std::optional(found->format);
}

bool has_scene_extension(const Path& path)
{
    return is_foreign(path) || std::ranges::any_of(kFormats, [&](const SceneFormatFacts& f) {
               return has_extension(f, path.extension().string());
           });
}

Result<SceneFormat> detect_scene_format(const Path& path)
{
    const std::string extension = path.extension().string();
    for (const SceneFormatFacts& f : kFormats)
        if (has_extension(f, extension)) // the first of those that share one
            return f.format == SceneFormat::points_ply ? ply_format(path)
                   : f.format == SceneFormat::npz      ? npz_format(path)
                                                       : Result<SceneFormat>(f.format);
    return tl::make_unexpected(unknown_extension(path));
}

Result<SceneFormat> scene_format_to_write(const Path& path)
{
    const std::string extension = path.extension().string();
    for (const SceneFormatFacts& f : kFormats)
        if (f.writable && has_extension(f, extension))
            return f.format;
    return tl::make_unexpected(unknown_extension(path));
}

Result<SceneGrid> read_scene_grid(const Path& path, const SceneGridOptions& o, std::optional<SceneFormat> format)
{
    if (!format) {
        SR_TRY(format, detect_scene_format(path));
    }
    switch (*format) {
    case SceneFormat::sgrid:
        return plain(read_grid(path));
    case SceneFormat::npz:
        return read_grid_npz(path, o);
    case SceneFormat::semantickitti:
        return read_semantic_kitti(path, o);
    case SceneFormat::occ3d_nuscenes:
        return read_occ3d(path, Occ3dKind::nuscenes, o);
    case SceneFormat::occ3d_waymo:
        return read_occ3d(path, Occ3dKind::waymo, o);
    case SceneFormat::array:
        return read_label_array(path, o);
    case SceneFormat::vox:
        return read_vox(path, o);
    case SceneFormat::points_ply:
        return read_labelled_points(path, o);
    case SceneFormat::carla_points:
        return read_carla_points(path, o);
    default:
        return fail(ErrorCode::bad_input, "{}: holds splats ({}), expected a grid", quote_path(path),
                    facts_of(*format).name);
    }
}

Status write_scene_grid(const Path& path, const VoxelGrid& grid, SceneFormat format, std::vector<std::string>& warnings)
{
    const auto without_points = [&] {
        if (grid.has_points())
            warnings.push_back(
                fmt::format("{} points are left out: {} holds labels", grid.points.size() / 3, facts_of(format).name));
    };
    switch (format) {
    case SceneFormat::sgrid:
        return write_grid(path, grid);
    case SceneFormat::npz:
        return write_grid_npz(path, grid);
    case SceneFormat::semantickitti:
        without_points();
        return write_semantic_kitti(path, grid, warnings);
    case SceneFormat::vox:
        without_points();
        return write_vox(path, grid);
    case SceneFormat::points_ply:
        return write_labelled_points(path, grid);
    default:
        return fail(ErrorCode::bad_input, "cannot write a grid as {}", facts_of(format).name);
    }
}

Result<SplatFile> read_splats(const Path& path, SceneFormat format)
{
    switch (format) {
    case SceneFormat::gaussian_3d:
    case SceneFormat::gaussian_2d:
    case SceneFormat::inria62:
        return read_splats_ply(path);
    case SceneFormat::gltf_splats:
        return read_splats_glb(path);
    case SceneFormat::splat:
        return read_dot_splat(path);
    default:
        return fail(ErrorCode::bad_input, "{}: {} holds no splats", quote_path(path), facts_of(format).name);
    }
}

Status write_splats(const Path& path, const Splats& splats, SceneFormat format, bool labels)
{
    switch (format) {
    case SceneFormat::points_ply:
        return write_points_ply(path, splats);
    case SceneFormat::gaussian_3d:
        return write_splats_ply(path, splats, SplatPly::gaussian_3d, labels);
    case SceneFormat::gaussian_2d:
        return write_splats_ply(path, splats, SplatPly::gaussian_2d, labels);
    case SceneFormat::inria62:
        return write_splats_ply(path, splats, SplatPly::inria_62, false);
    case SceneFormat::gltf_splats:
        return write_splats_glb(path, splats);
    case SceneFormat::splat:
        return write_dot_splat(path, splats);
    default:
        return fail(ErrorCode::bad_input, "cannot write splats as {}", facts_of(format).name);
    }
}

} // namespace semrover
