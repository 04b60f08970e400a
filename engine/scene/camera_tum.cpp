// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/scene/camera_path.h"
#include "runtime/quote.h"

#include <charconv>
#include <iterator>

namespace semrover {

namespace {

constexpr uint64_t kMaxPathBytes = 16u << 20;
constexpr std::string_view kBlanks = " \t\r";
constexpr std::string_view kFields = "t tx ty tz qx qy qz qw";

// the numbers of one line, none for a blank line or a comment
Result<std::vector<double>> line_numbers(std::string_view line, std::string_view where)
{
    std::vector<double> numbers;
    line = line.substr(0, line.find('#'));
    while (true) {
        const size_t begin = line.find_first_not_of(kBlanks);
        if (begin == std::string_view::npos)
            break;
        line.remove_prefix(begin);
        const std::string_view word = line.substr(0, line.find_first_of(kBlanks));
        double value = 0;
        const std::string_view digits = word.starts_with('+') ? word.substr(1) : word;
        const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
        if (error != std::errc() || end != digits.data() + digits.size())
            return fail(ErrorCode::bad_input, "{}: expected a number, found {}", where, quote(word, 40));
        numbers.push_back(value);
        if (numbers.size() > 8)
            break;
        line.remove_prefix(word.size());
    }
    if (!numbers.empty() && numbers.size() != 8)
        return fail(ErrorCode::bad_input, "{}: expected the 8 numbers {}, found {}", where, kFields,
                    numbers.size() > 8 ? "more" : fmt::format("{}", numbers.size()));
    return numbers;
}

} // namespace

Result<CameraPath> read_tum(const Path& path, const Intrinsics& intrinsics)
{
    const std::string name = quote_path(path);
    SR_CHECK(check_intrinsics(intrinsics, name));
    SR_TRY(const std::string text, read_text_file(path, kMaxPathBytes));
    CameraPath cameras;
    size_t number = 0;
    for (std::string_view rest = text; !rest.empty();) {
        const size_t length = rest.find('\n');
        const std::string_view line = rest.substr(0, length);
        rest.remove_prefix(length == std::string_view::npos ? rest.size() : length + 1);
        const std::string where = fmt::format("{} line {}", name, ++number);
        SR_TRY(const std::vector<double> v, line_numbers(line, where));
        if (v.empty())
            continue;
        SR_TRY(const Rigid camera_to_world, rigid_from_quaternion({v[1], v[2], v[3]}, {v[4], v[5], v[6], v[7]}, where));
        if (!(v[0] - v[0] == 0)) // infinite or NaN
            return fail(ErrorCode::bad_input, "{}: a time that is not finite", where);
        cameras.frames.push_back({v[0], "", {inverse(camera_to_world)}, intrinsics});
    }
    if (cameras.frames.empty())
        return fail(ErrorCode::bad_input, "{}: a camera path without poses, expected lines of {}", name, kFields);
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

Result<CameraPath> read_camera_path(const Path& path, const Intrinsics& fallback)
{
    return path.extension() == ".json" ? read_transforms(path, fallback) : read_tum(path, fallback);
}

} // namespace semrover
