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

// a file beside the poses, if it is there
Path beside(const Path& path, const char* name)
{
    std::error_code ignored;
    const Path file = path.parent_path() / name;
    return path.filename() != name && std::filesystem::exists(file, ignored) ? file : Path();
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

Result<CameraPath> read_camera_path(const Path& path, const Intrinsics& fallback)
{
    std::error_code ignored;
    if (std::filesystem::is_directory(path, ignored)) {
        if (!std::filesystem::exists(path / "cameras.txt", ignored))
            return fail(ErrorCode::bad_input, "{}: a folder without cameras.txt, expected COLMAP's text model",
                        quote_path(path));
        return read_colmap(path);
    }
    if (path.extension() == ".json") {
        SR_TRY(const Json file, read_json(path));
        return file.is_object() && file.contains("camera_path") ? parse_camera_path_json(file, quote_path(path))
                                                                : parse_transforms(file, quote_path(path), fallback);
    }
    SR_TRY(const std::string text, read_text_file(path, kMaxPathBytes));
    if (is_kitti(text))
        return read_kitti(path, fallback, {beside(path, "times.txt"), beside(path, "calib.txt")});
    return read_tum(path, fallback);
}

} // namespace semrover
