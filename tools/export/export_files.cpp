// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/export/export_files.h"

#include "engine/format/image.h"
#include "runtime/base/quote.h"

namespace semrover {

Status put_file(const Path& path, std::span<const std::byte> bytes)
{
    SR_CHECK(make_folder(path.parent_path()));
    return write_file_atomically(path, bytes);
}

Status put_file(const Path& path, std::string_view text)
{
    return put_file(path, std::as_bytes(std::span(text.data(), text.size())));
}

Result<std::vector<std::byte>> color_file(const DriveInput& drive, size_t picture, bool jpeg, int quality)
{
    SR_TRY(const Path file, drive.color(picture));
    if ((file.extension() == ".jpg") == jpeg) {
        SR_TRY(const MappedFile mapped, MappedFile::open(file));
        return std::vector<std::byte>(mapped.bytes().begin(), mapped.bytes().end());
    }
    SR_TRY(const ImageRgb8 image, drive.read_color(picture));
    return jpeg ? encode_jpeg_rgb8(image.width, image.height, image.pixels, quality)
                : encode_png_rgb8(image.width, image.height, image.pixels);
}

std::string rows_text(Rigid matrix, size_t rows)
{
    for (double& v : matrix)
        v += 0.0; // no -0
    return fmt::format("{}", fmt::join(std::span(matrix).first(4 * rows), " "));
}

std::string matrix_text(const Rigid& matrix)
{
    std::string text;
    for (size_t row = 0; row < 4; ++row)
        text += fmt::format("{}\n", fmt::join(std::span(matrix).subspan(4 * row, 4), " "));
    return text;
}

Status check_pinhole(const Sensor& sensor, std::string_view where)
{
    if (sensor.intrinsics.model == CameraModel::pinhole)
        return {};
    return fail(ErrorCode::bad_input, "camera {} has the lens {}: {} holds pictures of pinholes", quote(sensor.name),
                name_of(sensor.intrinsics.model), where);
}

Rigid forward_to_vehicle(const Sensor& sensor)
{
    return compose(sensor.sensor_to_vehicle, inverse(kForwardCamera));
}

} // namespace semrover
