// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/trajectory/path_format.h"

#include "runtime/base/json.h"
#include "runtime/base/quote.h"
#include "runtime/base/text_start.h"
#include "tools/trajectory/camera_text.h"

#include <algorithm>

namespace semrover {

namespace {

// in the order of PathFormat
constexpr std::string_view kPathNames[] = {"tum",      "kitti",   "transforms", "camera_path", "colmap",   "kitti360",
                                           "matrices", "redwood", "pose_files", "euroc",       "pandaset", "nuscenes"};

constexpr std::string_view kExpected =
    "a trajectory: TUM (8 numbers a line), KITTI (12), KITTI-360 (13 or 17), 4x4 matrices (16), EuRoC's .csv, "
    "Redwood's .log, transforms.json, camera_path.json, PandaSet's poses.json, nuScenes' ego_pose.json, or a folder: "
    "COLMAP's (cameras.bin or cameras.txt, also in sparse/0), one with poses.txt, or one with a file of a 4x4 matrix "
    "for each frame";

constexpr size_t kBeginning = 16 << 10;

// without a byte order mark; of UTF-16, whose zeros say that it is no text that is read here, as it is
std::string_view beginning_of(const MappedFile& file, size_t most)
{
    const auto bytes = file.bytes();
    const std::string_view all(reinterpret_cast<const char*>(bytes.data()), std::min(bytes.size(), most));
    return text_after_mark(all, "").value_or(all);
}

bool holds(std::string_view text, std::string_view what)
{
    return text.find(what) != std::string_view::npos;
}

std::string_view without_blanks(std::string_view text)
{
    const size_t first = text.find_first_not_of(" \t\r\n");
    return first == std::string_view::npos ? std::string_view() : text.substr(first);
}

// note: by its keys alone, so that broken JSON is an error of the format that it was meant to be
std::optional<PathFormat> format_of_json(std::string_view whole)
{
    const std::string_view text = without_blanks(whole), start = text.substr(0, kBeginning);
    if (text.starts_with('[') && holds(start, "\"position\"") && holds(start, "\"heading\""))
        return PathFormat::pandaset;
    if (text.starts_with('[') && holds(start, "\"rotation\"") && holds(start, "\"translation\"") &&
        holds(start, "\"timestamp\"") && !holds(start, "\"size\""))
        return PathFormat::nuscenes;
    if (text.starts_with('{') && holds(text, "\"camera_path\""))
        return PathFormat::camera_path;
    if (text.starts_with('{') && holds(text, "\"frames\""))
        return PathFormat::transforms;
    return std::nullopt;
}

// the first line that is neither blank nor a comment, and the numbers on it; none for other words
struct FirstLine {
    std::string_view line;
    std::optional<size_t> numbers;
    bool commas = false;
};
FirstLine first_line_of(std::string_view text)
{
    for (TextLines lines(text); lines.next();) {
        if (count_words(lines.line()) == 0)
            continue;
        FirstLine first{.line = lines.line(), .numbers = {}, .commas = holds(lines.line(), ",")};
        std::string spaced(first.line.substr(0, first.line.find('#')));
        std::ranges::replace(spaced, ',', ' ');
        const auto words = words_of(spaced, 32);
        if (numbers_of_words(words, ""))
            first.numbers = words.size();
        return first;
    }
    return {};
}

std::optional<PathFormat> format_of_text(std::string_view text)
{
    const FirstLine first = first_line_of(text);
    if (first.commas) // EuRoC's, or a heading of its columns without a '#'
        return first.numbers >= 8 || (holds(first.line, "_x") && holds(first.line, "_w"))
                   ? std::optional(PathFormat::euroc)
                   : std::nullopt;
    switch (first.numbers.value_or(0)) {
    case 8:
        return PathFormat::tum;
    case 12:
        return PathFormat::kitti;
    case 13:
    case 17:
        return PathFormat::kitti360;
    case 4:
    case 16:
        return PathFormat::matrices;
    case 3:
        return PathFormat::redwood;
    default:
        return std::nullopt;
    }
}

Result<std::optional<FoundPath>> find_in_folder(const Path& folder)
{
    for (const char* model : {".", "sparse/0", "sparse", "0", "colmap/sparse/0"})
        for (const char* file : {"cameras.bin", "cameras.txt", "images.txt"}) {
            const Path at = (folder / model).lexically_normal();
            SR_TRY(const FileType type, examine(at / file));
            if (type != FileType::not_found)
                return std::optional(FoundPath{PathFormat::colmap, at});
        }
    for (const char* file : {"poses.txt", "transforms.json", "poses.json", "ego_pose.json"}) {
        SR_TRY(const FileType type, examine(folder / file));
        if (type == FileType::regular)
            return find_path(folder / file);
    }
    for (const Path& at : {folder, folder / "pose"}) {
        SR_TRY(const FileType type, examine(at));
        if (type != FileType::directory)
            continue;
        SR_TRY(const std::vector<Path> files, pose_files_in(at));
        if (!files.empty())
            return std::optional(FoundPath{PathFormat::pose_files, at});
    }
    return std::optional<FoundPath>();
}

std::string keys_of(const Json& object)
{
    std::string keys;
    size_t count = 0;
    for (const auto& item : object.items())
        if (++count <= 6)
            keys += fmt::format("{}{}", keys.empty() ? "" : ", ", printable(item.key(), 40));
    return count == 0 ? "no keys" : fmt::format("the keys {}{}", keys, count > 6 ? ", ..." : "");
}

std::string look_of_json(const Json& json)
{
    if (json.is_object())
        return fmt::format("JSON, an object with {}", keys_of(json));
    if (json.is_array() && !json.empty() && json[0].is_object())
        return fmt::format("JSON, an array of objects with {}", keys_of(json[0]));
    return fmt::format("JSON, {} {}", json.is_array() ? "an" : "a", json.type_name());
}

std::string look_of_text(std::string_view text)
{
    const FirstLine first = first_line_of(text);
    if (first.line.empty())
        return "text without a line of data";
    if (first.numbers)
        return fmt::format("text whose first line has {} number{}{}", *first.numbers, *first.numbers == 1 ? "" : "s",
                           first.commas ? " with commas between them" : "");
    return fmt::format("text that begins with {}", quote(first.line, 60));
}

Result<std::string> look_of_folder(const Path& folder)
{
    SR_TRY(const std::vector<Path> files, list_files(folder));
    if (files.empty())
        return std::string("a folder without files");
    return fmt::format("a folder of {} file{}, such as {}", files.size(), files.size() == 1 ? "" : "s",
                       quote(files.front().filename().string(), 60));
}

Result<std::string> look_of(const Path& path)
{
    if (is_folder(path))
        return look_of_folder(path);
    SR_TRY(const MappedFile file, MappedFile::open(path));
    const std::string_view text = beginning_of(file, kBeginning);
    if (text.empty())
        return std::string("an empty file");
    SR_CHECK(text_after_mark(text, quote_path(path)));
    if (text.find('\0') != std::string_view::npos)
        return fmt::format("a binary file of {} bytes", file.bytes().size());
    if (path.extension() == ".json") {
        SR_TRY(const Json json, read_json(path));
        return look_of_json(json);
    }
    return look_of_text(text);
}

} // namespace

std::string_view name_of(PathFormat format)
{
    return kPathNames[size_t(format)];
}

std::optional<PathFormat> path_format_of(std::string_view name)
{
    const auto found = std::ranges::find(kPathNames, name);
    if (found == std::end(kPathNames))
        return std::nullopt;
    return PathFormat(found - std::begin(kPathNames));
}

Result<std::optional<FoundPath>> find_path(const Path& path)
{
    SR_TRY(const FileType type, examine(path));
    if (type == FileType::not_found)
        return std::optional<FoundPath>();
    if (type == FileType::directory)
        return find_in_folder(path);
    SR_TRY(const MappedFile file, MappedFile::open(path));
    std::optional<PathFormat> format;
    if (path.extension() == ".json")
        format = format_of_json(beginning_of(file, file.bytes().size()));
    else if (const std::string_view text = beginning_of(file, kBeginning); !holds(text, std::string_view("\0", 1)))
        format = format_of_text(text);
    return format ? std::optional(FoundPath{*format, path}) : std::nullopt;
}

Status refuse_unknown_path(const Path& path, std::string_view others)
{
    SR_TRY(const std::string look, look_of(path));
    return fail(ErrorCode::bad_input, "{}: is {}; expected {}{}", quote_path(path), look, kExpected, others);
}

} // namespace semrover
