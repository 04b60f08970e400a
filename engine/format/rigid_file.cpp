// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/rigid_file.h"

#include "engine/format/camera_text.h"
#include "engine/format/npy.h"
#include "runtime/base/json_numbers.h"
#include "runtime/base/quote.h"

#include <algorithm>

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

} // namespace semrover
