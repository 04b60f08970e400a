// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/dataset/depth_image.h"

#include "engine/format/number_image.h"
#include "runtime/base/quote.h"

#include <cmath>

namespace semrover {

namespace {

constexpr uint64_t kMaxDepthBytes = 1u << 30;
constexpr uint32_t kCarlaFar = 0xffffff;
constexpr double kCarlaMetres = 1000;

Result<DepthImage> depth_of_array(std::span<const std::byte> file, std::string_view where, const DepthEncoding& e)
{
    SR_TRY(ArrayImage image, decode_array_image(file, where));
    const auto unit = float(e.unit.value_or(image.whole ? e.usual_unit : 1));
    for (float& d : image.values)
        d = std::isfinite(d) && d > 0 && !(image.whole && d == 65535) ? d * unit : 0;
    return DepthImage{image.size, std::move(image.values), e.kind.value_or(DepthKind::z)};
}

Result<DepthImage> depth_of_gray(std::span<const std::byte> file, std::string_view where, const DepthEncoding& e)
{
    SR_TRY(const PngNumbers image, decode_png_numbers(file, where));
    DepthImage depth{image.info.size, {}, e.kind.value_or(DepthKind::z)};
    depth.metres.reserve(image.values.size());
    const auto unit = float(e.unit.value_or(e.usual_unit));
    for (const uint16_t d : image.values)
        depth.metres.push_back(d == 65535 ? 0 : float(d) * unit);
    return depth;
}

Result<DepthImage> depth_of_carla(std::span<const std::byte> file, std::string_view where)
{
    SR_TRY(const ImageRgb8 image, decode_image_rgb8(file, where));
    DepthImage depth{{image.width, image.height}, {}, DepthKind::carla};
    depth.metres.reserve(image.pixels.size() / 3);
    bool gray = true;
    for (size_t i = 0; i < image.pixels.size(); i += 3) {
        const uint8_t* rgb = &image.pixels[i];
        const uint32_t d = rgb[0] | uint32_t(rgb[1]) << 8 | uint32_t(rgb[2]) << 16;
        depth.metres.push_back(d == kCarlaFar ? 0 : float(d * kCarlaMetres / kCarlaFar));
        gray = gray && rgb[0] == rgb[1] && rgb[1] == rgb[2];
    }
    if (gray) // of CARLA's 24 bits the lowest are never like the highest all over a picture
        return fail(
            ErrorCode::bad_input,
            "{}: a gray picture of 8 bits, made to be looked at; expected a PNG of 16-bit gray, CARLA's depth in "
            "its colours as they are, or a .npy",
            where);
    return depth;
}

std::string png_text(const PngInfo& info)
{
    constexpr const char* kNames[] = {"gray", "gray and alpha", "palette colours", "colour", "colour and alpha"};
    return fmt::format("{} of {} bits", kNames[size_t(info.kind)], info.bits);
}

Result<DepthImage> depth_of_png(std::span<const std::byte> file, std::string_view where, const DepthEncoding& e)
{
    SR_TRY(const PngInfo info, png_info(file, where));
    const bool colour = (info.kind == PngKind::rgb || info.kind == PngKind::rgba) && info.bits == 8;
    if (colour && e.kind.value_or(DepthKind::carla) == DepthKind::carla)
        return depth_of_carla(file, where);
    if (e.kind == DepthKind::carla)
        return fail(ErrorCode::bad_input, "{}: expected CARLA's depth in 8-bit colours, found {}", where,
                    png_text(info));
    if (info.kind != PngKind::gray || info.bits != 16)
        return fail(ErrorCode::bad_input, "{}: expected a PNG of 16-bit gray, or a .npy, found {}", where,
                    png_text(info));
    return depth_of_gray(file, where, e);
}

} // namespace

Result<DepthImage> read_depth_image(const Path& path, const DepthEncoding& e)
{
    const std::string where = quote_path(path);
    SR_TRY(const std::vector<std::byte> file, read_file(path, kMaxDepthBytes));
    if (!is_array(file))
        return depth_of_png(file, where, e);
    if (e.kind == DepthKind::carla)
        return fail(ErrorCode::bad_input, "{}: expected CARLA's depth in 8-bit colours, found an array", where);
    return depth_of_array(file, where, e);
}

void make_axial(DepthImage& depth, const Intrinsics& k)
{
    SR_ASSERT((depth.size == ImageSize{k.width, k.height}), "depth of {} x {} pixels, a camera of {} x {}",
              depth.size.width, depth.size.height, k.width, k.height);
    for (size_t i = 0; i < depth.metres.size(); ++i) {
        const double x = (double(i % k.width) + 0.5 - k.cx) / k.fx, y = (double(i / k.width) + 0.5 - k.cy) / k.fy;
        depth.metres[i] = float(depth.metres[i] / std::sqrt(x * x + y * y + 1));
    }
    depth.kind = DepthKind::z;
}

} // namespace semrover
