// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/eval/sample_files.h"

#include "runtime/base/quote.h"

#include <algorithm>
#include <initializer_list>
#include <sstream>

namespace semrover {

namespace {

namespace fs = std::filesystem;

constexpr size_t kMaxFiles = 1 << 22;
constexpr uint64_t kMaxListBytes = 64 << 20;

std::string ending(const Path& path)
{
    std::string text = path.extension().string();
    std::ranges::transform(text, text.begin(), [](unsigned char c) { return char(std::tolower(c)); });
    return text;
}

// regular files below a folder with one of these endings; links to folders are not followed
Result<std::vector<Path>> files_below(const Path& folder, std::initializer_list<std::string_view> endings)
{
    std::error_code error;
    if (!fs::is_directory(folder, error))
        return fail(ErrorCode::bad_input, "{}: expected a folder, this is none", quote_path(folder));
    std::vector<Path> files;
    for (fs::recursive_directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
        std::error_code unreadable;
        if (at->is_regular_file(unreadable) && std::ranges::find(endings, ending(at->path())) != endings.end())
            files.push_back(at->path());
        if (files.size() > kMaxFiles)
            return fail(ErrorCode::bad_input, "{}: more than {} files", quote_path(folder), kMaxFiles);
    }
    if (error)
        return fail(ErrorCode::bad_input, "cannot read {}: {}", quote_path(folder), printable(error.message()));
    std::ranges::sort(files);
    return files;
}

} // namespace

Result<std::vector<Path>> list_all_images(const Path& folder, bool arrays)
{
    SR_TRY(std::vector<Path> files, files_below(folder, {".png", ".jpg", ".jpeg", arrays ? ".npy" : ".png"}));
    if (files.empty())
        return fail(ErrorCode::bad_input, "{}: no PNG or JPEG images in it", quote_path(folder));
    return files;
}

Result<std::vector<Path>> list_images(const Path& folder)
{
    std::error_code error;
    const bool refined = fs::is_directory(folder / "frames", error);
    SR_TRY(std::vector<Path> files, list_all_images(refined ? folder / "frames" : folder));
    const auto is_color = [](const Path& path) { return path.parent_path().filename() == "color"; };
    if (!refined && std::ranges::any_of(files, is_color))
        std::erase_if(files, [&](const Path& path) { return !is_color(path); });
    return files;
}

Result<ImageRgb8> read_image(const Path& path)
{
    return ending(path) == ".png" ? read_png_rgb8(path) : read_jpeg_rgb8(path);
}

Result<std::vector<Path>> list_grids(const Path& path)
{
    std::error_code error;
    if (fs::is_directory(path, error)) {
        for (const std::string_view kind : {".sgrid", ".ply"}) {
            SR_TRY(std::vector<Path> files, files_below(path, {kind}));
            if (!files.empty())
                return files;
        }
        return fail(ErrorCode::bad_input, "{}: no .sgrid or .ply files in it", quote_path(path));
    }
    if (ending(path) != ".txt")
        return std::vector<Path>{path};
    SR_TRY(const std::string text, read_text_file(path, kMaxListBytes));
    std::vector<Path> files;
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) {
        while (!line.empty() && (line.back() == '\r' || line.back() == ' '))
            line.pop_back();
        if (line.empty())
            continue;
        files.push_back(path.parent_path() / line);
        if (!fs::is_regular_file(files.back(), error))
            return fail(ErrorCode::bad_input, "{}: line names {}, which is no file", quote_path(path),
                        quote_path(files.back()));
    }
    if (files.empty())
        return fail(ErrorCode::bad_input, "{}: names no grid", quote_path(path));
    return files;
}

} // namespace semrover
