// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/export/map_mask.h"

#include "engine/camera/lens.h"
#include "engine/format/depth_picture.h"
#include "engine/format/number_image.h"
#include "engine/scene/palette.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

constexpr double kAround = 60, kGrid = 10; // metres
constexpr uint32_t kEvery = 2;             // pixels
constexpr uint8_t kTerrainLabel = 9;

bool is_way(uint16_t label)
{
    return label < kClassCount && is_ground(uint8_t(label)) && label != kTerrainLabel;
}

Result<MapMask> empty_mask(const DriveInput& drive, double metres)
{
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    for (const DriveRecord::Moment& m : drive.record.moments)
        for (size_t axis = 0; axis < 2; ++axis) {
            const double at = translation_of(m.vehicle_to_world)[axis];
            low[axis] = std::min(low[axis], kGrid * std::floor((at - kAround) / kGrid));
            high[axis] = std::max(high[axis], kGrid * std::ceil((at + kAround) / kGrid));
        }
    const double width = (high[0] - low[0]) / metres, height = (high[1] - low[1]) / metres;
    if (!(width <= kMaxImageSide && height <= kMaxImageSide))
        return fail(ErrorCode::bad_input, "the drive is {:.0f} x {:.0f} m with what is around it, a map holds {:.0f} m",
                    high[0] - low[0], high[1] - low[1], kMaxImageSide * metres);
    MapMask mask{low[0], low[1], uint32_t(std::lround(width)), uint32_t(std::lround(height)), {}, false};
    mask.pixels.resize(size_t(mask.width) * mask.height);
    return mask;
}

Status add_picture(const DriveInput& drive, size_t picture, double metres, MapMask& mask)
{
    SR_TRY(const std::optional<Path> label_file, drive.other(picture, "label"));
    SR_TRY(const std::optional<Path> depth_file, drive.other(picture, "depth"));
    if (!label_file || !depth_file)
        return {};
    SR_TRY(const LabelImage labels, read_label_image(*label_file));
    SR_TRY(const DepthPicture depth, read_depth_picture(*depth_file, drive.record.depth_unit));
    const CameraFrame& frame = drive.path.frames[picture];
    const Lens lens(frame.intrinsics);
    const Rigid to_world = frame.pose.camera_to_world();
    mask.known = true;
    for (uint32_t y = 0; y < std::min(labels.size.height, depth.height); y += kEvery)
        for (uint32_t x = 0; x < std::min(labels.size.width, depth.width); x += kEvery) {
            const uint32_t units = depth.pixels[size_t(y) * depth.width + x];
            const auto ray = is_way(labels.numbers[size_t(y) * labels.size.width + x]) && units
                                 ? lens.ray(x + 0.5, y + 0.5)
                                 : std::nullopt;
            if (!ray)
                continue;
            const double far = units * depth.unit / lens.depth(*ray);
            const Point3 at = transform(to_world, {(*ray)[0] * far, (*ray)[1] * far, (*ray)[2] * far});
            const double column = std::floor((at[0] - mask.left) / metres);
            const double row = mask.height - 1 - std::floor((at[1] - mask.bottom) / metres);
            if (column >= 0 && column < mask.width && row >= 0 && row < mask.height)
                mask.pixels[size_t(row) * mask.width + size_t(column)] = 255;
        }
    return {};
}

} // namespace

Result<MapMask> map_mask_of(const DriveInput& drive, double metres_per_pixel)
{
    SR_TRY(MapMask mask, empty_mask(drive, metres_per_pixel));
    for (size_t i = 0; i < drive.record.pictures.size(); ++i)
        SR_CHECK(add_picture(drive, i, metres_per_pixel, mask));
    return mask;
}

} // namespace semrover
