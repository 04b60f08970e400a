// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/number_image.h"

#include "engine/format/npy.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cstring>

namespace semrover {

namespace {

Result<ImageSize> image_size(uint64_t width, uint64_t height, std::string_view where)
{
    for (const uint64_t side : {width, height})
        if (side < 1 || side > kMaxImageSide)
            return fail(ErrorCode::bad_input, "{}: a picture of {} x {} pixels, expected 1 to {} each way", where,
                        width, height, kMaxImageSide);
    return ImageSize{uint32_t(width), uint32_t(height)};
}

struct NpyLayout {
    NpyHeader header;
    ImageSize size;
};

Result<NpyLayout> npy_layout(std::span<const std::byte> file, std::string_view where)
{
    const std::string_view text(reinterpret_cast<const char*>(file.data()), file.size());
    SR_TRY(NpyHeader header, parse_npy_header(text.substr(0, kNpyHeaderBytes), where));
    std::vector<uint64_t> shape = header.shape;
    if (shape.size() == 3 && shape.back() == 1)
        shape.pop_back();
    else if (shape.size() == 3 && shape.front() == 1)
        shape.erase(shape.begin());
    if (shape.size() != 2)
        return fail(ErrorCode::bad_input, "{}: an array of shape ({}), expected [height, width]", where,
                    fmt::join(header.shape, ", "));
    SR_TRY(const ImageSize size, image_size(shape[1], shape[0], where));
    if (header.data_bytes > file.size() - header.bytes)
        return fail(ErrorCode::bad_input, "{}: the file is cut: {} bytes of pixels, expected {}", where,
                    file.size() - header.bytes, header.data_bytes);
    return NpyLayout{std::move(header), size};
}

// COLMAP's `WIDTH&HEIGHT&CHANNELS&`, then fp32, rows one after the other
struct ColmapLayout {
    ImageSize size;
    size_t header_bytes = 0;
};

bool is_colmap(std::span<const std::byte> file)
{
    constexpr size_t kMostDigits = 20;
    size_t digits = 0;
    while (digits < std::min(file.size(), kMostDigits) && std::isdigit(uint8_t(file[digits])))
        ++digits;
    return digits > 0 && digits < file.size() && file[digits] == std::byte('&');
}

Result<ColmapLayout> colmap_layout(std::span<const std::byte> file, std::string_view where)
{
    const std::string_view text(reinterpret_cast<const char*>(file.data()), std::min<size_t>(file.size(), 64));
    std::array<uint64_t, 3> shape{};
    const char* at = text.data();
    const char* const end = at + text.size();
    for (uint64_t& side : shape) {
        const auto [next, error] = std::from_chars(at, end, side);
        if (error != std::errc() || next == end || *next != '&')
            return fail(ErrorCode::bad_input, "{}: expected COLMAP's WIDTH&HEIGHT&CHANNELS& at its beginning", where);
        at = next + 1;
    }
    if (shape[2] != 1)
        return fail(ErrorCode::bad_input, "{}: a map of {} channels, expected 1: depth", where, shape[2]);
    SR_TRY(const ImageSize size, image_size(shape[0], shape[1], where));
    const ColmapLayout layout{size, size_t(at - text.data())};
    const uint64_t bytes = shape[0] * shape[1] * sizeof(float), found = file.size() - layout.header_bytes;
    if (found != bytes)
        return fail(ErrorCode::bad_input, "{}: {} bytes of pixels, expected {}", where, found, bytes);
    return layout;
}

template <typename T>
std::vector<float> npy_values_as_floats(const NpyArray& array)
{
    const std::vector<T> values = array.values<T>();
    return {values.begin(), values.end()};
}

std::vector<float> npy_floats(const NpyArray& array)
{
    switch (array.dtype) {
    case DType::f64:
        return npy_values_as_floats<double>(array);
    case DType::i64:
        return npy_values_as_floats<int64_t>(array);
    case DType::u64:
        return npy_values_as_floats<uint64_t>(array);
    case DType::f32:
        return array.values<float>();
    case DType::i32:
        return npy_values_as_floats<int32_t>(array);
    case DType::u32:
        return npy_values_as_floats<uint32_t>(array);
    case DType::i16:
        return npy_values_as_floats<int16_t>(array);
    case DType::u16:
        return npy_values_as_floats<uint16_t>(array);
    case DType::i8:
        return npy_values_as_floats<int8_t>(array);
    case DType::u8:
    case DType::boolean:
        return npy_values_as_floats<uint8_t>(array);
    case DType::f16:
    case DType::bf16:
    case DType::q8_0: // no file has it
        break;
    }
    std::vector<float> values(array.elements());
    to_float(array.data, array.dtype, values.data());
    return values;
}

constexpr uint64_t kMaxLabelBytes = 1u << 30;
constexpr const char* kExpectedNumbers =
    "class numbers: a PNG of gray values or palette indices (1 to 16 bits), or a .npy";

Result<LabelImage> numbers_of_png(std::span<const std::byte> file, std::string_view where)
{
    SR_TRY(PngNumbers image, decode_png_numbers(file, where));
    const ImageSize size = image.info.size;
    if (image.color) {
        const auto& [pixel, rgb] = *image.color;
        return fail(ErrorCode::bad_input,
                    "{}: a picture in colour, expected {}; found the colour ({}) at column {}, row {}{}", where,
                    kExpectedNumbers, fmt::join(rgb, ", "), pixel % size.width, pixel / size.width,
                    rgb[1] == 0 && rgb[2] == 0 ? " (CARLA's tags are its red channel: save that as gray)" : "");
    }
    return LabelImage{size, label_numbers(std::move(image))};
}

Result<LabelImage> numbers_of_array(std::span<const std::byte> file, std::string_view where)
{
    SR_TRY(const ArrayImage image, decode_array_image(file, where));
    if (!image.whole)
        return fail(ErrorCode::bad_input, "{}: an array of fractions, expected whole class numbers", where);
    LabelImage labels{image.size, {}};
    labels.numbers.resize(image.values.size());
    for (size_t i = 0; i < image.values.size(); ++i) {
        const float value = image.values[i];
        if (value < -1 || value > kNoNumber)
            return fail(ErrorCode::bad_input,
                        "{}: class number {} at column {}, row {}, expected 0 to {}, or -1 for nothing", where, value,
                        i % image.size.width, i / image.size.width, kNoNumber - 1);
        labels.numbers[i] = value < 0 ? kNoNumber : uint16_t(value);
    }
    return labels;
}

} // namespace

Result<ArrayImage> decode_array_image(std::span<const std::byte> file, std::string_view where)
{
    if (is_colmap(file)) {
        SR_TRY(const ColmapLayout layout, colmap_layout(file, where));
        ArrayImage image{layout.size, false, std::vector<float>(size_t(layout.size.width) * layout.size.height)};
        std::memcpy(image.values.data(), file.data() + layout.header_bytes, image.values.size() * sizeof(float));
        return image;
    }
    SR_TRY(const NpyLayout layout, npy_layout(file, where));
    const auto data = file.subspan(layout.header.bytes, layout.header.data_bytes);
    const DType type = layout.header.dtype;
    const bool whole = type != DType::f16 && type != DType::f32 && type != DType::f64;
    return ArrayImage{layout.size, whole, npy_floats(decode_npy(layout.header, {data.begin(), data.end()}))};
}

bool is_array(std::span<const std::byte> file)
{
    return std::string_view(reinterpret_cast<const char*>(file.data()), file.size()).starts_with("\x93NUMPY") ||
           is_colmap(file);
}

Result<ImageSize> number_image_size(const Path& path)
{
    const std::string where = quote_path(path);
    SR_TRY(const MappedFile file, MappedFile::open(path));
    if (is_colmap(file.bytes())) {
        SR_TRY(const ColmapLayout layout, colmap_layout(file.bytes(), where));
        return layout.size;
    }
    if (is_array(file.bytes())) {
        SR_TRY(const NpyLayout layout, npy_layout(file.bytes(), where));
        return layout.size;
    }
    SR_TRY(const PngInfo info, png_info(file.bytes(), where));
    return info.size;
}

std::vector<uint16_t> label_numbers(PngNumbers image)
{
    for (size_t i = 0; i < image.transparent.size(); ++i)
        if (image.transparent[i])
            image.values[i] = kNoNumber;
    return std::move(image.values);
}

Result<LabelImage> read_label_image(const Path& path)
{
    const std::string where = quote_path(path);
    SR_TRY(const std::vector<std::byte> file, read_file(path, kMaxLabelBytes));
    if (is_array(file))
        return numbers_of_array(file, where);
    if (file.size() > 2 && file[0] == std::byte(0xff) && file[1] == std::byte(0xd8))
        return fail(ErrorCode::bad_input, "{}: a JPEG, whose compression changes numbers, expected {}", where,
                    kExpectedNumbers);
    return numbers_of_png(file, where);
}

} // namespace semrover
