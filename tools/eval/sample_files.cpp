// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/eval/sample_files.h"

#include "runtime/base/quote.h"

#include <algorithm>
#include <initializer_list>
#include <sstream>

namespace semrover {

namespace {

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
    if (!is_folder(folder))
        return fail(ErrorCode::bad_input, "{}: expected a folder, this is none", quote_path(folder));
    SR_TRY(std::vector<Path> files, list_tree(folder));
    std::erase_if(files, [&](const Path& path) { return std::ranges::find(endings, ending(path)) == endings.end(); });
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
    const bool refined = is_folder(folder / "frames");
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
    if (is_folder(path)) {
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
        if (!is_file(files.back()))
            return fail(ErrorCode::bad_input, "{}: line names {}, which is no file", quote_path(path),
                        quote_path(files.back()));
    }
    if (files.empty())
        return fail(ErrorCode::bad_input, "{}: names no grid", quote_path(path));
    return files;
}

} // namespace semrover
