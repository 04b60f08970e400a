// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// trajectories of matrices: KITTI-360's, a 4x4 matrix a line or in four lines, Redwood's
#include "runtime/base/quote.h"
#include "tools/trajectory/camera_path.h"
#include "tools/trajectory/camera_text.h"

#include <cmath>

namespace semrover {

namespace {

struct NumberedLine {
    std::vector<double> numbers;
    std::string where;
};

// lines with numbers, at most `most` on each
Result<std::vector<NumberedLine>> lines_of_numbers(const Path& path, size_t most)
{
    const std::string name = quote_path(path);
    SR_TRY(const std::string text, read_text_file(path, kMaxPathBytes));
    std::vector<NumberedLine> rows;
    for (TextLines lines(text); lines.next();) {
        NumberedLine row{{}, fmt::format("{} line {}", name, lines.number())};
        SR_TRY(row.numbers, numbers_of_words(words_of(lines.line(), most), row.where));
        if (!row.numbers.empty())
            rows.push_back(std::move(row));
    }
    if (rows.empty())
        return fail(ErrorCode::bad_input, "{}: a trajectory without poses", name);
    return rows;
}

Status expect_numbers(const NumberedLine& row, size_t count, std::string_view what)
{
    if (row.numbers.size() != count)
        return fail(ErrorCode::bad_input, "{}: expected the {} numbers of {}, found {}", row.where, count, what,
                    row.numbers.size() > count ? "more" : fmt::format("{}", row.numbers.size()));
    return {};
}

// four lines of four numbers from `at` on
Result<Rigid> matrix_in_lines(const std::vector<NumberedLine>& rows, size_t at)
{
    std::vector<double> values;
    for (size_t i = at; i < at + 4; ++i) {
        if (i >= rows.size())
            return fail(ErrorCode::bad_input, "{}: the file ends within a 4x4 matrix", rows.back().where);
        SR_CHECK(expect_numbers(rows[i], 4, "a row of a 4x4 matrix"));
        values.insert(values.end(), rows[i].numbers.begin(), rows[i].numbers.end());
    }
    return rigid_from_matrix(values, rows[at].where);
}

Result<double> frame_number(double value, std::string_view where)
{
    if (!(value >= 0 && value <= 1e15) || value != std::floor(value))
        return fail(ErrorCode::bad_input, "{}: expected the number of a frame, found {}", where, value);
    return value;
}

} // namespace

Result<CameraPath> read_kitti360(const Path& path, const Intrinsics& lens)
{
    SR_TRY(const std::vector<NumberedLine> rows, lines_of_numbers(path, 17));
    CameraPath cameras{.frames = {}, .numbered = true, .body = {}, .warnings = {}};
    const size_t count = rows[0].numbers.size() == 13 ? 13 : 17;
    Rigid axes = kIdentity;
    if (count == 13) { // of the IMU: right is y, down is z, forward is x
        axes = {0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 1};
        cameras.body = PathBody{"a vehicle's IMU (x forward, y right, z down)", axes};
    }
    for (const NumberedLine& row : rows) {
        SR_CHECK(expect_numbers(row, count, count == 13 ? "a frame and a 3x4 matrix" : "a frame and a 4x4 matrix"));
        SR_TRY(const double number, frame_number(row.numbers[0], row.where));
        SR_TRY(const Rigid pose, rigid_from_matrix(std::span(row.numbers).subspan(1), row.where));
        cameras.frames.push_back({number, "", {inverse(compose(pose, axes))}, lens});
    }
    return cameras;
}

Result<CameraPath> read_matrices(const Path& path, const Intrinsics& lens)
{
    SR_TRY(const std::vector<NumberedLine> rows, lines_of_numbers(path, 16));
    const size_t lines = rows[0].numbers.size() == 4 ? 4 : 1;
    CameraPath cameras;
    for (size_t at = 0; at < rows.size(); at += lines) {
        Rigid pose = kIdentity;
        if (lines == 4) {
            SR_TRY(pose, matrix_in_lines(rows, at));
        } else {
            SR_CHECK(expect_numbers(rows[at], 16, "a 4x4 matrix"));
            SR_TRY(pose, rigid_from_matrix(rows[at].numbers, rows[at].where));
        }
        cameras.frames.push_back({double(cameras.frames.size()), "", {inverse(pose)}, lens});
    }
    return cameras;
}

Result<CameraPath> read_redwood(const Path& path, const Intrinsics& lens)
{
    SR_TRY(const std::vector<NumberedLine> rows, lines_of_numbers(path, 4));
    CameraPath cameras{.frames = {}, .numbered = true, .body = {}, .warnings = {}};
    for (size_t at = 0; at < rows.size(); at += 5) {
        SR_CHECK(expect_numbers(rows[at], 3, "a frame's heading"));
        SR_TRY(const double number, frame_number(rows[at].numbers[0], rows[at].where));
        SR_TRY(const Rigid pose, matrix_in_lines(rows, at + 1));
        cameras.frames.push_back({number, "", {inverse(pose)}, lens});
    }
    return cameras;
}

} // namespace semrover
