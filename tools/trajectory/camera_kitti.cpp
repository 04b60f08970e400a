// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/camera/image_size.h"
#include "runtime/base/json_numbers.h"
#include "runtime/base/quote.h"
#include "tools/trajectory/camera_path.h"
#include "tools/trajectory/camera_text.h"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace semrover {

namespace {

constexpr double kFirstPixel = 0.5; // where its centre is, counted from the image's corner

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

// the numbers behind a key; none where no line has it
Result<std::optional<std::vector<double>>> numbers_of_key(std::string_view text, std::string_view key, size_t count,
                                                          const std::string& name)
{
    for (TextLines lines(text); lines.next();) {
        std::vector<std::string_view> words = words_of(lines.line(), count + 1);
        if (words.empty() || words[0] != key)
            continue;
        words.erase(words.begin());
        const std::string where = fmt::format("{}: {}", name, key);
        SR_TRY(std::vector<double> numbers, numbers_of_words(words, where));
        if (numbers.size() != count)
            return fail(ErrorCode::bad_input, "{} expected {} numbers, found {}", where, count,
                        numbers.size() > count ? "more" : fmt::format("{}", numbers.size()));
        return std::optional(std::move(numbers));
    }
    return std::optional<std::vector<double>>();
}

// S_rect_00: width height, of the raw data's calibration; odometry's has none
Result<ImageSize> read_size(std::string_view text, const Intrinsics& given, bool size_given, const std::string& name)
{
    SR_TRY(const auto size, numbers_of_key(text, "S_rect_00:", 2, name));
    if (!size && !size_given)
        return fail(ErrorCode::bad_input,
                    "{}: has no size of the pictures (S_rect_00); give it with `width` and `height`", name);
    if (!size)
        return ImageSize{given.width, given.height};
    SR_TRY(const uint32_t width, image_side((*size)[0], name + ": S_rect_00: width"));
    SR_TRY(const uint32_t height, image_side((*size)[1], name + ": S_rect_00: height"));
    return ImageSize{width, height};
}

// P0, the projection of the camera that the poses are of: fx 0 cx 0  0 fy cy 0  0 0 1 0
Result<Intrinsics> read_projection(const KittiFiles& files, const Intrinsics& given)
{
    const std::string name = quote_path(files.calibration);
    SR_TRY(const std::string text, read_text_file(files.calibration, kMaxPathBytes));
    const char* key = "P0:";
    SR_TRY(auto p, numbers_of_key(text, key, 12, name));
    if (!p) {
        key = "P_rect_00:";
        SR_TRY(p, numbers_of_key(text, key, 12, name));
    }
    if (!p)
        return fail(ErrorCode::bad_input, "{}: no line P0: with the projection of the camera", name);
    const std::string where = fmt::format("{}: {}", name, key);
    const std::vector<double>& m = *p;
    if (m[1] != 0 || m[4] != 0 || m[8] != 0 || m[9] != 0 || m[10] != 1)
        return fail(ErrorCode::bad_input, "{} expected a projection without skew or rotation", where);
    SR_TRY(const ImageSize size, read_size(text, given, files.size_given, name));
    // KITTI counts from the centre of the first pixel
    const Intrinsics k{m[0], m[5], m[2] + kFirstPixel, m[6] + kFirstPixel, size.width, size.height};
    SR_CHECK(check_intrinsics(k, where));
    const double x = k.cx / k.width, y = k.cy / k.height;
    if (!(x > 0.25 && x < 0.75 && y > 0.25 && y < 0.75)) // of other pictures than the calibrated ones
        return fail(ErrorCode::bad_input,
                    "{} the principal point ({:.1f}, {:.1f}) is far from the middle of {} x {} pixels; give the "
                    "size of the calibrated pictures with `width` and `height`",
                    where, k.cx, k.cy, k.width, k.height);
    return k;
}

} // namespace

Result<CameraPath> read_kitti(const Path& path, const Intrinsics& intrinsics, const KittiFiles& files)
{
    const std::string name = quote_path(path);
    SR_CHECK(check_intrinsics(intrinsics, name));
    SR_TRY(const std::string text, read_text_file(path, kMaxPathBytes));
    Intrinsics k = intrinsics;
    if (!files.calibration.empty()) {
        SR_TRY(k, read_projection(files, intrinsics));
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
        return fail(ErrorCode::bad_input, "{}: a trajectory without poses, expected lines of 12 numbers", name);
    if (!files.times.empty()) {
        SR_TRY(const std::vector<double> times, read_times(files.times, cameras.frames.size()));
        for (size_t i = 0; i < times.size(); ++i)
            cameras.frames[i].time = times[i];
    }
    return cameras;
}

bool has_kitti_calibration(const CameraPath& cameras)
{
    const Intrinsics& k = cameras.frames[0].intrinsics;
    return k.model == CameraModel::pinhole &&
           std::ranges::all_of(cameras.frames, [&](const CameraFrame& f) { return f.intrinsics == k; });
}

Status write_kitti(const Path& path, const CameraPath& cameras)
{
    std::string text, times;
    for (const CameraFrame& frame : cameras.frames) {
        SR_ASSERT(frame.camera == cameras.frames[0].camera, "a KITTI path of cameras {} and {}",
                  cameras.frames[0].camera, frame.camera);
        const Rigid camera_to_world = frame.pose.camera_to_world();
        fmt::format_to(std::back_inserter(text), "{}\n", fmt::join(std::span(camera_to_world).first(12), " "));
        fmt::format_to(std::back_inserter(times), "{}\n", frame.time);
    }
    SR_CHECK(write_file_atomically(path, text));
    SR_CHECK(write_file_atomically(path.parent_path() / "times.txt", times));
    if (!has_kitti_calibration(cameras))
        return {};
    const Intrinsics& k = cameras.frames[0].intrinsics;
    return write_file_atomically(path.parent_path() / "calib.txt",
                                 fmt::format("S_rect_00: {} {}\nP0: {} 0 {} 0 0 {} {} 0 0 0 1 0\n", k.width, k.height,
                                             k.fx, k.cx - kFirstPixel, k.fy, k.cy - kFirstPixel));
}

} // namespace semrover
