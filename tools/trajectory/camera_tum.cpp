// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/quote.h"
#include "tools/trajectory/camera_path.h"
#include "tools/trajectory/camera_text.h"

#include <cmath>
#include <iterator>

namespace semrover {

namespace {

constexpr std::string_view kFields = "t tx ty tz qx qy qz qw";

// none for a blank line or a comment
Result<std::optional<CameraFrame>> read_line(std::string_view line, std::string_view where,
                                             const Intrinsics& intrinsics)
{
    const std::vector<std::string_view> words = words_of(line, 8);
    SR_TRY(const std::vector<double> v, numbers_of_words(words, where));
    if (v.empty())
        return std::optional<CameraFrame>();
    if (v.size() != 8)
        return fail(ErrorCode::bad_input, "{}: expected the 8 numbers {}, found {}", where, kFields,
                    v.size() > 8 ? "more" : fmt::format("{}", v.size()));
    SR_TRY(const Rigid camera_to_world, rigid_from_quaternion({v[1], v[2], v[3]}, {v[4], v[5], v[6], v[7]}, where));
    if (!std::isfinite(v[0]))
        return fail(ErrorCode::bad_input, "{}: a time that is not finite", where);
    return std::optional(CameraFrame{v[0], "", {inverse(camera_to_world)}, intrinsics});
}

} // namespace

Result<CameraPath> read_tum(const Path& path, const Intrinsics& intrinsics)
{
    const std::string name = quote_path(path);
    SR_CHECK(check_intrinsics(intrinsics, name));
    SR_TRY(const std::string text, read_text_file(path, kMaxPathBytes));
    CameraPath cameras;
    for (TextLines lines(text); lines.next();) {
        SR_TRY(const auto frame, read_line(lines.line(), fmt::format("{} line {}", name, lines.number()), intrinsics));
        if (frame)
            cameras.frames.push_back(*frame);
    }
    if (cameras.frames.empty())
        return fail(ErrorCode::bad_input, "{}: a trajectory without poses, expected lines of {}", name, kFields);
    return cameras;
}

Status write_tum(const Path& path, const CameraPath& cameras)
{
    std::string text = "# timestamp tx ty tz qx qy qz qw   camera to world; camera axes x right, y down, z forward\n";
    for (const CameraFrame& frame : cameras.frames) {
        SR_ASSERT(frame.camera == cameras.frames[0].camera, "a TUM path of cameras {} and {}", cameras.frames[0].camera,
                  frame.camera);
        const Rigid camera_to_world = frame.pose.camera_to_world();
        fmt::format_to(std::back_inserter(text), "{} {} {}\n", frame.time,
                       fmt::join(translation_of(camera_to_world), " "), fmt::join(quaternion_of(camera_to_world), " "));
    }
    return write_file_atomically(path, text);
}

} // namespace semrover
