// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/fuse/frame_pictures.h"

#include "runtime/base/quote.h"
#include "tools/trajectory/camera_text.h"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace semrover {

namespace {

constexpr size_t kMostPairs = size_t(1) << 22;

struct TimedFile {
    double time = 0;
    Path path;
};

// "1305031102.160407": seconds with a point
std::optional<double> time_of_name(const Path& path)
{
    const std::string stem = path.stem().string();
    const auto time = number_of(stem, "");
    if (!time || stem.find('.') == std::string::npos || !std::isfinite(*time))
        return std::nullopt;
    return *time;
}

// lines of a time and a path inside the folder
Result<std::vector<TimedFile>> listed_files(const Path& folder, const Path& list)
{
    const std::string name = quote_path(list);
    SR_TRY(const std::string text, read_text_file(list, kMaxPathBytes));
    std::vector<TimedFile> files;
    for (TextLines lines(text); lines.next();) {
        const std::vector<std::string_view> words = words_of(lines.line(), 2);
        if (words.empty())
            continue;
        const std::string where = fmt::format("{} line {}", name, lines.number());
        SR_TRY(const double time, number_of(words[0], where));
        if (words.size() != 2 || !std::isfinite(time))
            return fail(ErrorCode::bad_input, "{}: expected a time and the path of a picture, found {}", where,
                        quote(lines.line(), 60));
        SR_TRY(Path path, path_inside(folder, words[1], where));
        files.push_back({time, std::move(path)});
    }
    return files;
}

Result<std::vector<TimedFile>> files_named_by_time(const Path& folder)
{
    SR_TRY(const std::vector<Path> paths, list_files(folder));
    std::vector<TimedFile> files;
    for (const Path& path : paths) {
        const std::string ending = path.extension().string();
        if (std::ranges::find(kPictureEndings, ending) == std::end(kPictureEndings))
            continue;
        const auto time = time_of_name(path);
        if (!time)
            return fail(ErrorCode::bad_input, "{}: expected a name of seconds with a point, as others there have",
                        quote_path(path));
        files.push_back({*time, path});
    }
    return files;
}

// pictures of one of these kinds: those of a list, else those of a folder; none where there is neither
Result<std::vector<TimedFile>> timed_files(const Path& folder, std::initializer_list<const char*> kinds)
{
    for (const char* kind : kinds) {
        const Path list = folder / (std::string(kind) + ".txt");
        if (!is_file(list) && !is_folder(folder / kind))
            continue;
        SR_TRY(std::vector<TimedFile> files,
               is_file(list) ? listed_files(folder, list) : files_named_by_time(folder / kind));
        std::ranges::stable_sort(files, {}, &TimedFile::time);
        return files;
    }
    return std::vector<TimedFile>();
}

std::vector<double> times_of(const std::vector<TimedFile>& files)
{
    std::vector<double> times;
    for (const TimedFile& file : files)
        times.push_back(file.time);
    return times;
}

// what each depth picture has of another kind; null: nothing of its moment
Result<std::vector<const TimedFile*>> partners(const std::vector<TimedFile>& depth, const std::vector<TimedFile>& other)
{
    SR_TRY(const auto pairs, associate_times(times_of(depth), times_of(other)));
    std::vector<const TimedFile*> found(depth.size(), nullptr);
    for (const auto& [a, b] : pairs)
        found[a] = &other[b];
    return found;
}

} // namespace

Result<std::vector<std::pair<size_t, size_t>>> associate_times(std::span<const double> a, std::span<const double> b,
                                                               double within)
{
    std::vector<std::tuple<double, size_t, size_t>> close;
    size_t first = 0;
    for (size_t i = 0; i < a.size(); ++i) {
        while (first < b.size() && b[first] <= a[i] - within)
            ++first;
        for (size_t j = first; j < b.size() && b[j] < a[i] + within; ++j) {
            close.emplace_back(std::abs(a[i] - b[j]), i, j);
            if (close.size() > kMostPairs)
                return fail(ErrorCode::bad_input, "more than {} pairs of times are within {} s of each other",
                            kMostPairs, within);
        }
    }
    std::ranges::sort(close);
    std::vector<bool> used_a(a.size()), used_b(b.size());
    std::vector<std::pair<size_t, size_t>> pairs;
    for (const auto& [difference, i, j] : close)
        if (!used_a[i] && !used_b[j]) {
            used_a[i] = used_b[j] = true;
            pairs.emplace_back(i, j);
        }
    std::ranges::sort(pairs);
    return pairs;
}

Result<bool> has_timed_pictures(const Path& folder)
{
    if (is_file(folder / "depth.txt"))
        return true;
    if (!is_folder(folder / "depth"))
        return false;
    SR_TRY(const std::vector<Path> paths, list_files(folder / "depth"));
    return std::ranges::any_of(paths, [](const Path& path) { return time_of_name(path).has_value(); });
}

Result<TimedFrames> find_timed_pictures(const Path& folder, const Path& poses, const std::vector<CameraFrame>& path)
{
    std::vector<CameraFrame> cameras = path;
    std::ranges::stable_sort(cameras, {}, &CameraFrame::time);
    std::vector<double> times;
    for (const CameraFrame& camera : cameras)
        times.push_back(camera.time);
    SR_TRY(const std::vector<TimedFile> depth, timed_files(folder, {"depth"}));
    SR_TRY(const std::vector<TimedFile> color, timed_files(folder, {"rgb", "color"}));
    SR_TRY(const std::vector<TimedFile> label, timed_files(folder, {"label"}));
    SR_TRY(const auto colors, partners(depth, color));
    SR_TRY(const auto labels, partners(depth, label));
    SR_TRY(const auto pairs, associate_times(times_of(depth), times));
    TimedFrames out;
    out.depths = depth.size();
    for (const auto& [d, pose] : pairs) {
        if ((!color.empty() && !colors[d]) || (!label.empty() && !labels[d]))
            continue;
        out.cameras.push_back(cameras[pose]);
        out.pictures.push_back(
            {depth[d].path, labels[d] ? labels[d]->path : Path(), colors[d] ? colors[d]->path : Path()});
    }
    if (out.cameras.empty())
        return fail(ErrorCode::bad_input,
                    "no picture of {} has a pose of {} within {} s: expected names or times in seconds of one clock",
                    quote_path(folder), quote_path(poses), kSameMoment);
    return out;
}

} // namespace semrover
