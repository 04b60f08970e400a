// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/dataset/rigid_file.h"

#include "engine/format/npy.h"
#include "runtime/base/json_numbers.h"
#include "runtime/base/quote.h"
#include "tools/trajectory/camera_text.h"

#include <algorithm>
#include <optional>

namespace semrover {

namespace {

constexpr uint64_t kMaxRigidBytes = 64 << 10;

Result<Rigid> rigid_of_npy(const std::string& file, std::string_view where)
{
    SR_TRY(const NpyHeader header, parse_npy_header(file, where));
    if ((header.dtype != DType::f32 && header.dtype != DType::f64) || header.data_bytes != file.size() - header.bytes)
        return fail(ErrorCode::bad_input, "{}: expected a 3x4 or 4x4 array of float32 or float64", where);
    const auto* begin = reinterpret_cast<const std::byte*>(file.data() + header.bytes);
    const NpyArray array = decode_npy(header, {begin, begin + header.data_bytes});
    std::vector<double> values;
    if (header.dtype == DType::f64)
        values = array.values<double>();
    else
        std::ranges::copy(array.values<float>(), std::back_inserter(values));
    return rigid_from_matrix(values, where);
}

// behind the key on its line
Result<Rigid> rigid_on_line(const std::vector<std::string_view>& words, size_t rows_of, std::string_view where)
{
    SR_TRY(std::vector<double> v, numbers_of_words({words.begin() + 1, words.end()}, where));
    if (v.size() != rows_of * 3)
        return fail(ErrorCode::bad_input, "{}: expected {} numbers, found {}", where, rows_of * 3,
                    v.size() > rows_of * 3 ? "more" : fmt::format("{}", v.size()));
    if (rows_of == 3)
        v = {v[0], v[1], v[2], 0, v[3], v[4], v[5], 0, v[6], v[7], v[8], 0};
    return rigid_from_matrix(v, where);
}

} // namespace

Result<Rigid> parse_rigid(std::string_view text, std::string_view where)
{
    std::string spaced(text);
    std::ranges::replace(spaced, ',', ' ');
    std::vector<double> values;
    for (TextLines lines(spaced); lines.next();) {
        SR_TRY(const std::vector<double> row, numbers_of_words(words_of(lines.line(), 16), where));
        values.insert(values.end(), row.begin(), row.end());
    }
    return rigid_from_matrix(values, where);
}

Result<Rigid> read_rigid(const Path& path)
{
    const std::string name = quote_path(path);
    SR_TRY(const std::string text, read_text_file(path, kMaxRigidBytes));
    if (path.extension() == ".npy")
        return rigid_of_npy(text, name);
    if (path.extension() != ".json")
        return parse_rigid(text, name);
    SR_TRY(const Json json, parse_json(text, name));
    SR_TRY(const std::vector<double> values, numbers_of(json, name));
    return rigid_from_matrix(values, name);
}

Result<Rigid> read_kitti_lidar(const Path& path)
{
    const std::string name = quote_path(path);
    SR_TRY(const std::string text, read_text_file(path, kMaxPathBytes));
    std::optional<Rigid> rectify, lidar_to_camera;
    for (TextLines lines(text); lines.next();) {
        const std::vector<std::string_view> words = words_of(lines.line(), 13);
        if (words.empty())
            continue;
        const std::string_view key = words[0].substr(0, words[0].find(':')); // tracking has none
        const std::string where = fmt::format("{} line {}", name, lines.number());
        if (key == "Tr")
            return rigid_on_line(words, 4, where);
        if (key == "R0_rect" || key == "R_rect") {
            SR_TRY(rectify, rigid_on_line(words, 3, where));
        } else if (key == "Tr_velo_to_cam" || key == "Tr_velo_cam") {
            SR_TRY(lidar_to_camera, rigid_on_line(words, 4, where));
        }
    }
    if (!rectify || !lidar_to_camera)
        return fail(
            ErrorCode::bad_input,
            "{}: expected lines R0_rect: and Tr_velo_to_cam: (of tracking: R_rect and Tr_velo_cam; of odometry: "
            "Tr:)",
            name);
    return compose(*rectify, *lidar_to_camera);
}

} // namespace semrover
