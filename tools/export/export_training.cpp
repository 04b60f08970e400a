// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// Folders to train radiance fields from: nerfstudio's transforms.json beside its pictures, and COLMAP's sparse/0 and
// images/
#include "engine/format/ply_reader.h"
#include "engine/format/transforms.h"
#include "runtime/base/quote.h"
#include "tools/export/export_files.h"
#include "tools/trajectory/camera_path.h"

namespace semrover {

namespace {

Status copy_of(const Path& from, const Path& to)
{
    SR_TRY(const MappedFile file, MappedFile::open(from));
    return put_file(to, file.bytes());
}

// positions and colours of points that `render` wrote; none where there is no such file
Result<Splats> read_points(const Path& path)
{
    Splats points;
    if (!is_file(path))
        return points;
    SR_TRY(const PlyFile file, read_ply(path));
    const PlyElement* vertices = file.find("vertex");
    std::array<const PlyProperty*, 6> columns{};
    for (size_t i = 0; i < columns.size(); ++i) {
        constexpr const char* kNames[] = {"x", "y", "z", "red", "green", "blue"};
        columns[i] = vertices ? vertices->find(kNames[i]) : nullptr;
        if (!columns[i] || columns[i]->is_list)
            return fail(ErrorCode::bad_input, "{}: expected vertices with {}", quote_path(path),
                        fmt::join(kNames, ", "));
    }
    for (size_t row = 0; row < vertices->rows; ++row) {
        const auto at = [&](size_t column) { return float(columns[column]->values[row]); };
        points.position.push_back({at(0), at(1), at(2)});
        points.color.push_back({at(3) / 255, at(4) / 255, at(5) / 255});
    }
    return points;
}

// whether the pictures are JPEGs, as the first one is
Result<bool> has_jpegs(const DriveInput& drive)
{
    SR_TRY(const Path first, drive.color(0));
    return first.extension() == ".jpg";
}

} // namespace

Result<ExportReport> export_transforms(std::span<const DriveInput> drives, const Path& out,
                                       const ExportOptions& options)
{
    const DriveInput& drive = drives[0];
    SR_TRY(const bool jpeg, has_jpegs(drive));
    std::map<std::pair<std::string, uint32_t>, PictureNames> names;
    std::map<std::string, uint32_t> counts;
    for (size_t i = 0; i < drive.record.pictures.size(); ++i) {
        const std::string& camera = drive.record.pictures[i].camera;
        const uint32_t number = counts[camera]++;
        PictureNames& n = names[{camera, number}];
        n.color = picture_name(camera, "color", number, jpeg ? "jpg" : "png");
        SR_TRY(const auto color, color_file(drive, i, jpeg, options.quality));
        SR_CHECK(put_file(out / n.color, color));
        for (const auto& [kind, name] : {std::pair("depth", &n.depth), std::pair("label", &n.label)}) {
            SR_TRY(const std::optional<Path> file, drive.other(i, kind));
            if (!file)
                continue;
            *name = picture_name(camera, kind, number, file->extension().string().substr(1));
            SR_CHECK(copy_of(*file, out / *name));
        }
    }
    TransformsFiles files;
    files.pictures = [&](const std::string& camera, uint32_t number) { return names.at({camera, number}); };
    files.depth_unit = drive.record.depth_unit;
    const Path points = drive.folder / "points.ply";
    if (is_file(points)) {
        files.points = "points.ply";
        SR_CHECK(copy_of(points, out / files.points));
    }
    SR_CHECK(write_transforms(out / "transforms.json", drive.path, files));
    return ExportReport{.pictures = names.size()};
}

Result<ExportReport> export_colmap(std::span<const DriveInput> drives, const Path& out, const ExportOptions& options)
{
    const DriveInput& drive = drives[0];
    SR_TRY(const bool jpeg, has_jpegs(drive));
    const std::string extension = jpeg ? "jpg" : "png";
    std::map<std::string, uint32_t> counts;
    for (size_t i = 0; i < drive.record.pictures.size(); ++i) {
        const std::string& camera = drive.record.pictures[i].camera;
        const uint32_t number = counts[camera]++;
        SR_TRY(const auto color, color_file(drive, i, jpeg, options.quality));
        const std::string name = colmap_picture_name(camera, number, drive.record.sensors.size(), extension);
        SR_CHECK(put_file(out / "images" / name, color));
    }
    SR_TRY(const Splats points, read_points(drive.folder / "points.ply"));
    SR_CHECK(write_colmap(out / "sparse" / "0", drive.path, points, extension));
    return ExportReport{.pictures = drive.record.pictures.size()};
}

} // namespace semrover
