// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/label_image.h"

#include "engine/format/npy_image.h"
#include "runtime/base/quote.h"

namespace semrover {

namespace {

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

Result<LabelImage> numbers_of_npy(std::span<const std::byte> file, std::string_view where)
{
    SR_TRY(const NpyImage image, decode_npy_image(file, where));
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
    if (is_npy(file))
        return numbers_of_npy(file, where);
    if (file.size() > 2 && file[0] == std::byte(0xff) && file[1] == std::byte(0xd8))
        return fail(ErrorCode::bad_input, "{}: a JPEG, whose compression changes numbers, expected {}", where,
                    kExpectedNumbers);
    return numbers_of_png(file, where);
}

} // namespace semrover
