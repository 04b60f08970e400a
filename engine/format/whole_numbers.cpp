// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/whole_numbers.h"

#include <cmath>
#include <limits>

namespace semrover {

namespace {

template <typename T, typename From>
bool converts(const std::vector<From>& values, std::vector<T>& out)
{
    out.resize(values.size());
    for (size_t i = 0; i < values.size(); ++i) {
        if constexpr (std::is_floating_point_v<From>) {
            if (!(double(values[i]) >= double(std::numeric_limits<T>::min()) &&
                  double(values[i]) <= double(std::numeric_limits<T>::max())) ||
                values[i] != std::floor(values[i]))
                return false;
        } else if (!std::in_range<T>(values[i])) {
            return false;
        }
        out[i] = static_cast<T>(values[i]);
    }
    return true;
}

std::vector<float> floats_of(const std::vector<uint16_t>& halves)
{
    std::vector<float> values;
    values.reserve(halves.size());
    for (const uint16_t half : halves)
        values.push_back(half_to_float(half));
    return values;
}

template <typename T>
std::optional<bool> convert_any(const NpyArray& array, std::vector<T>& out)
{
    switch (array.dtype) {
    case DType::boolean:
    case DType::u8:
        return converts(array.values<uint8_t>(), out);
    case DType::i8:
        return converts(array.values<int8_t>(), out);
    case DType::u16:
        return converts(array.values<uint16_t>(), out);
    case DType::i16:
        return converts(array.values<int16_t>(), out);
    case DType::u32:
        return converts(array.values<uint32_t>(), out);
    case DType::i32:
        return converts(array.values<int32_t>(), out);
    case DType::u64:
        return converts(array.values<uint64_t>(), out);
    case DType::i64:
        return converts(array.values<int64_t>(), out);
    case DType::f16:
        return converts(floats_of(array.values<uint16_t>()), out);
    case DType::f32:
        return converts(array.values<float>(), out);
    case DType::f64:
        return converts(array.values<double>(), out);
    default:
        return std::nullopt;
    }
}

} // namespace

template <typename T>
Result<std::vector<T>> whole_numbers(const NpyArray& array, std::string_view where)
{
    std::vector<T> out;
    const std::optional<bool> fits = convert_any(array, out);
    if (!fits)
        return fail(ErrorCode::bad_input, "{}: expected whole numbers, found {}", where, dtype_name(array.dtype));
    if (!*fits)
        return fail(ErrorCode::bad_input, "{}: expected whole numbers of {} to {}, found another", where,
                    std::numeric_limits<T>::min(), std::numeric_limits<T>::max());
    return out;
}

template Result<std::vector<uint8_t>> whole_numbers(const NpyArray&, std::string_view);
template Result<std::vector<int32_t>> whole_numbers(const NpyArray&, std::string_view);
template Result<std::vector<uint32_t>> whole_numbers(const NpyArray&, std::string_view);

} // namespace semrover
