// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/quote.h"
#include "tools/trajectory/camera_path.h"
#include "tools/trajectory/camera_text.h"

#include <algorithm>
#include <cctype>
#include <cmath>

namespace semrover {

namespace {

// cam0 of the data set is mounted so, to a few degrees: its right is y, its down is -x, its forward is z
constexpr Rigid kEurocForwardCamera = {0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

std::vector<std::string_view> fields_of(std::string_view line)
{
    std::vector<std::string_view> fields;
    for (size_t comma = 0; comma != std::string_view::npos && fields.size() < 64;) {
        comma = line.find(',');
        std::string_view field = line.substr(0, comma);
        const size_t first = field.find_first_not_of(" \t\r"), last = field.find_last_not_of(" \t\r");
        fields.push_back(first == std::string_view::npos ? "" : field.substr(first, last - first + 1));
        line.remove_prefix(comma == std::string_view::npos ? line.size() : comma + 1);
    }
    return fields;
}

struct EurocColumns {
    bool w_first = true;
    double seconds = 1e-9; // of a unit of time
};

// of a heading such as "#timestamp [ns],p_x,p_y,p_z,q_w,q_x,q_y,q_z" or "#timestamp, p_RS_R_x [m], ..., q_RS_w [], ..."
Result<EurocColumns> columns_of(std::string_view heading, std::string_view where)
{
    const auto fields = fields_of(heading);
    const auto has = [&](size_t field, std::string_view text) {
        return fields[field].find(text) != std::string_view::npos;
    };
    EurocColumns columns;
    if (fields.size() < 8)
        return columns; // a comment
    if (has(0, "[s]"))
        columns.seconds = 1;
    columns.w_first = has(4, "_w");
    const size_t x = columns.w_first ? 5 : 4;
    if (!has(1, "_x") || !has(2, "_y") || !has(3, "_z") || !has(x, "_x") || !has(x + 1, "_y") || !has(x + 2, "_z") ||
        !(columns.w_first || has(7, "_w")))
        return fail(ErrorCode::bad_input,
                    "{}: expected the columns timestamp, p_x, p_y, p_z, q_w, q_x, q_y, q_z (or q_w last), found {}",
                    where, quote(heading, 120));
    return columns;
}

Result<CameraFrame> euroc_frame(std::string_view line, const EurocColumns& columns, const Intrinsics& lens,
                                std::string_view where)
{
    std::vector<std::string_view> fields = fields_of(line);
    if (fields.size() < 8)
        return fail(ErrorCode::bad_input, "{}: expected 8 numbers or more with commas between them, found {}", where,
                    fields.size());
    fields.resize(8); // velocities and biases follow
    SR_TRY(std::vector<double> v, numbers_of_words(fields, where));
    if (!std::isfinite(v[0]))
        return fail(ErrorCode::bad_input, "{}: a time that is not finite", where);
    if (columns.w_first)
        std::rotate(v.begin() + 4, v.begin() + 5, v.end());
    SR_TRY(const Rigid body, rigid_from_quaternion({v[1], v[2], v[3]}, {v[4], v[5], v[6], v[7]}, where));
    return CameraFrame{v[0] * columns.seconds, "", {inverse(compose(body, kEurocForwardCamera))}, lens};
}

} // namespace

Result<CameraPath> read_euroc(const Path& path, const Intrinsics& lens)
{
    const std::string name = quote_path(path);
    SR_TRY(const std::string text, read_text_file(path, kMaxPathBytes));
    CameraPath cameras;
    cameras.body = PathBody{"an IMU (x up, y right, z forward, as EuRoC's)", kEurocForwardCamera};
    EurocColumns columns;
    for (TextLines lines(text); lines.next();) {
        const std::string where = fmt::format("{} line {}", name, lines.number());
        if (count_words(lines.line()) == 0 && !lines.line().starts_with('#'))
            continue;
        const bool heading = cameras.frames.empty() && std::isalpha(static_cast<unsigned char>(lines.line()[0]));
        if (heading || lines.line().starts_with('#')) {
            SR_TRY(columns, columns_of(lines.line(), where));
        } else {
            SR_TRY(CameraFrame frame, euroc_frame(lines.line(), columns, lens, where));
            cameras.frames.push_back(std::move(frame));
        }
    }
    if (cameras.frames.empty())
        return fail(ErrorCode::bad_input, "{}: a trajectory without poses", name);
    return cameras;
}

} // namespace semrover
