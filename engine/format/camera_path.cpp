// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/camera_path.h"

#include "engine/format/camera_text.h"
#include "runtime/base/quote.h"

#include <algorithm>

namespace semrover {

namespace {

constexpr std::string_view kFormatNames[] = {"tum", "kitti", "transforms", "camera_path", "colmap"};

bool is_kitti(std::string_view text)
{
    for (TextLines lines(text); lines.next();)
        if (const size_t words = count_words(lines.line()); words > 0)
            return words == 12;
    return false;
}

// a file beside the poses, or of poses/NN.txt in sequences/NN, if it is there
Path beside(const Path& path, const char* name)
{
    for (const Path& folder : {path.parent_path(), path.parent_path() / ".." / "sequences" / path.stem()})
        if (path.filename() != name && is_file(folder / name))
            return folder / name;
    return {};
}

Result<CameraPath> read_path_folder(const Path& folder, const Intrinsics& fallback, bool size_given)
{
    if (is_there(folder / "cameras.bin") || is_there(folder / "cameras.txt"))
        return read_colmap(folder);
    if (is_file(folder / "poses.txt"))
        return read_camera_path(folder / "poses.txt", fallback, size_given);
    return fail(ErrorCode::bad_input,
                "{}: a folder without a path, expected COLMAP's cameras.bin or cameras.txt, or KITTI's poses.txt (as "
                "poses/00.txt it is named itself)",
                quote_path(folder));
}

} // namespace

std::string_view name_of(PathFormat format)
{
    return kFormatNames[size_t(format)];
}

std::optional<PathFormat> path_format_of(std::string_view name)
{
    const auto found = std::ranges::find(kFormatNames, name);
    if (found == std::end(kFormatNames))
        return std::nullopt;
    return PathFormat(found - std::begin(kFormatNames));
}

Status refuse_colmap_file(const Path& path)
{
    for (const char* name : {"cameras.bin", "images.bin", "points3D.bin", "rigs.bin", "frames.bin"})
        if (path.filename() == name)
            return fail(ErrorCode::bad_input,
                        "{}: a part of a COLMAP model, which is read as a whole; give its folder, {}", quote_path(path),
                        quote_path(path.has_parent_path() ? path.parent_path() : Path(".")));
    return {};
}

Result<CameraPath> read_camera_path(const Path& path, const Intrinsics& fallback, bool size_given)
{
    if (is_folder(path))
        return read_path_folder(path, fallback, size_given);
    if (path.extension() == ".json") {
        SR_TRY(const Json file, read_json(path));
        return file.is_object() && file.contains("camera_path") ? parse_camera_path_json(file, quote_path(path))
                                                                : parse_transforms(file, quote_path(path), fallback);
    }
    SR_CHECK(refuse_colmap_file(path));
    SR_TRY(const std::string text, read_text_file(path, kMaxPathBytes));
    if (is_kitti(text))
        return read_kitti(path, fallback, {beside(path, "times.txt"), beside(path, "calib.txt"), size_given});
    return read_tum(path, fallback);
}

} // namespace semrover
