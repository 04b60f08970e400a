// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/camera_path.h"
#include "engine/format/camera_text.h"
#include "runtime/base/quote.h"

#include <cmath>
#include <iterator>

namespace semrover {

namespace {

Result<std::vector<double>> read_times(const Path& path, size_t poses)
{
    const std::string name = quote_path(path);
    SR_TRY(const std::string text, read_text_file(path, kMaxPathBytes));
    std::vector<double> times;
    for (TextLines lines(text); lines.next();) {
        const std::string where = fmt::format("{} line {}", name, lines.number());
        const std::vector<std::string_view> words = words_of(lines.line(), 1);
        if (words.empty())
            continue;
        SR_TRY(const double time, number_of(words[0], where));
        if (words.size() != 1 || !std::isfinite(time))
            return fail(ErrorCode::bad_input, "{}: expected one time in seconds, found {}", where,
                        quote(lines.line(), 60));
        times.push_back(time);
    }
    if (times.size() != poses)
        return fail(ErrorCode::bad_input, "{}: expected a time for each of the {} poses, found {}", name, poses,
                    times.size());
    return times;
}

// P0, the projection of the camera that the poses are of: fx 0 cx 0  0 fy cy 0  0 0 1 0
Result<Intrinsics> read_projection(const Path& path, const Intrinsics& size)
{
    const std::string name = quote_path(path);
    SR_TRY(const std::string text, read_text_file(path, kMaxPathBytes));
    for (TextLines lines(text); lines.next();) {
        std::vector<std::string_view> words = words_of(lines.line(), 13);
        if (words.empty() || (words[0] != "P0:" && words[0] != "P_rect_00:"))
            continue;
        const std::string where = fmt::format("{}: {}", name, words[0]);
        words.erase(words.begin());
        SR_TRY(const std::vector<double> p, numbers_of_words(words, where));
        if (p.size() != 12)
            return fail(ErrorCode::bad_input, "{} expected 12 numbers, found {}", where,
                        p.size() > 12 ? "more" : fmt::format("{}", p.size()));
        if (p[1] != 0 || p[4] != 0 || p[8] != 0 || p[9] != 0 || p[10] != 1)
            return fail(ErrorCode::bad_input, "{} expected a projection without skew or rotation", where);
        // KITTI counts from the centre of the first pixel
        const Intrinsics k{p[0], p[5], p[2] + 0.5, p[6] + 0.5, size.width, size.height};
        SR_CHECK(check_intrinsics(k, where));
        const double x = k.cx / k.width, y = k.cy / k.height;
        if (!(x > 0.25 && x < 0.75 && y > 0.25 && y < 0.75)) // the file does not say what size its pictures have
            return fail(ErrorCode::bad_input,
                        "{} the principal point ({:.1f}, {:.1f}) is far from the middle of {} x {} pixels; give the "
                        "size of the calibrated pictures with -W and -H",
                        where, k.cx, k.cy, k.width, k.height);
        return k;
    }
    return fail(ErrorCode::bad_input, "{}: no line P0: with the projection of the camera", name);
}

} // namespace

Result<CameraPath> read_kitti(const Path& path, const Intrinsics& intrinsics, const KittiFiles& files)
{
    const std::string name = quote_path(path);
    SR_CHECK(check_intrinsics(intrinsics, name));
    SR_TRY(const std::string text, read_text_file(path, kMaxPathBytes));
    Intrinsics k = intrinsics;
    if (!files.calibration.empty()) {
        SR_TRY(k, read_projection(files.calibration, intrinsics));
    }
    CameraPath cameras;
    for (TextLines lines(text); lines.next();) {
        const std::string where = fmt::format("{} line {}", name, lines.number());
        SR_TRY(const std::vector<double> v, numbers_of_words(words_of(lines.line(), 12), where));
        if (v.empty())
            continue;
        if (v.size() != 12)
            return fail(ErrorCode::bad_input, "{}: expected the 12 numbers of a 3x4 matrix, found {}", where,
                        v.size() > 12 ? "more" : fmt::format("{}", v.size()));
        SR_TRY(const Rigid camera_to_world, rigid_from_matrix(v, where));
        cameras.frames.push_back({double(cameras.frames.size()), "", {inverse(camera_to_world)}, k});
    }
    if (cameras.frames.empty())
        return fail(ErrorCode::bad_input, "{}: a camera path without poses, expected lines of 12 numbers", name);
    if (!files.times.empty()) {
        SR_TRY(const std::vector<double> times, read_times(files.times, cameras.frames.size()));
        for (size_t i = 0; i < times.size(); ++i)
            cameras.frames[i].time = times[i];
    }
    return cameras;
}

Status write_kitti(const Path& path, const CameraPath& cameras)
{
    std::string text;
    for (const CameraFrame& frame : cameras.frames) {
        SR_ASSERT(frame.camera == cameras.frames[0].camera, "a KITTI path of cameras {} and {}",
                  cameras.frames[0].camera, frame.camera);
        const Rigid camera_to_world = frame.pose.camera_to_world();
        fmt::format_to(std::back_inserter(text), "{}\n", fmt::join(std::span(camera_to_world).first(12), " "));
    }
    return write_file_atomically(path, text);
}

} // namespace semrover
