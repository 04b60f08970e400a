// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/trajectory/path_format.h"

#include "runtime/base/quote.h"
#include "runtime/base/text_start.h"
#include "tools/trajectory/camera_path.h"
#include "tools/trajectory/camera_text.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

constexpr uint64_t kMaxPoseBytes = 4096;

// 16 numbers, finite or not
Result<std::vector<double>> sixteen_of(std::string_view text, const std::string& name)
{
    std::vector<double> values;
    for (TextLines lines(text); lines.next();) {
        SR_TRY(const std::vector<double> row, numbers_of_words(semrover::words_of(lines.line(), 16), name));
        values.insert(values.end(), row.begin(), row.end());
    }
    if (values.size() != 16)
        return fail(ErrorCode::bad_input, "{}: expected the 16 numbers of a 4x4 matrix, found {}", name, values.size());
    return values;
}

Result<std::vector<double>> read_sixteen(const Path& path)
{
    SR_TRY(const std::string text, read_text_file(path, kMaxPoseBytes));
    return sixteen_of(text, quote_path(path));
}

// what the pictures of the same frame are called, without their ending: "0" of 0.txt, "frame-000000" of
// frame-000000.pose.txt
std::string picture_of(const Path& file)
{
    const Path stem = file.stem();
    return stem.extension() == ".pose" ? stem.stem().string() : stem.string();
}

// the last number in a file's name; none without one, and for one of more than 15 digits
std::optional<uint64_t> number_in_name(const Path& file)
{
    const std::string name = file.filename().string();
    const size_t last = name.find_last_of("0123456789");
    if (last == std::string::npos)
        return std::nullopt;
    const size_t before = name.find_last_not_of("0123456789", last);
    const std::string digits = name.substr(before == std::string::npos ? 0 : before + 1,
                                           last - (before == std::string::npos ? 0 : before + 1) + 1);
    if (digits.size() > 15)
        return std::nullopt;
    return std::stoull(digits);
}

} // namespace

Result<std::vector<Path>> pose_files_in(const Path& folder)
{
    SR_TRY(const std::vector<Path> listed, list_files(folder));
    std::vector<Path> files, poses;
    for (const Path& file : listed) {
        const std::string name = file.filename().string();
        if (name.ends_with(".pose.txt"))
            poses.push_back(file);
        if (name.ends_with(".txt") && number_in_name(file))
            files.push_back(file);
    }
    if (!poses.empty())
        files = std::move(poses);
    std::ranges::sort(files, natural_less, [](const Path& file) { return file.filename().string(); });
    if (files.empty())
        return files;
    SR_TRY(const MappedFile first, MappedFile::open(files.front()));
    const std::string_view bytes(reinterpret_cast<const char*>(first.bytes().data()), first.bytes().size());
    const auto text = text_after_mark(bytes, "");
    return bytes.size() <= kMaxPoseBytes && text && sixteen_of(*text, "") ? files : std::vector<Path>();
}

Result<CameraPath> read_pose_files(const Path& folder, const Intrinsics& lens)
{
    CameraPath path{.frames = {}, .numbered = true, .body = {}, .warnings = {}};
    SR_TRY(const std::vector<Path> files, pose_files_in(folder));
    for (const Path& file : files) {
        SR_TRY(const std::vector<double> values, read_sixteen(file));
        if (!std::ranges::all_of(values, [](double v) { return std::isfinite(v); }))
            continue;
        SR_TRY(const Rigid camera_to_world, rigid_from_matrix(values, quote_path(file)));
        path.frames.push_back(
            {double(number_in_name(file).value_or(0)), "", {inverse(camera_to_world)}, lens, picture_of(file)});
    }
    if (path.frames.empty())
        return fail(ErrorCode::bad_input, "{}: a trajectory without poses, expected files of a 4x4 matrix each",
                    quote_path(folder));
    if (path.frames.size() < files.size())
        path.warnings.push_back(fmt::format("{}: {} of {} files have no pose (inf), and are left out",
                                            quote_path(folder), files.size() - path.frames.size(), files.size()));
    return path;
}

} // namespace semrover
