// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/fusion/tsdf_volume.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace semrover {

namespace {

constexpr uint32_t kMaxFrames = 16;       // of a batch
constexpr uint64_t kMaxPixels = 2u << 20; // of a batch of more than one frame
constexpr uint32_t kGray = 0x808080;

uint32_t pixels_of(const CameraFrame& frame)
{
    return frame.intrinsics.width * frame.intrinsics.height;
}

std::array<float, kTsdfFrameWords> table_row(const CameraFrame& frame, const FusionBox& box, uint32_t first)
{
    const Intrinsics& k = frame.intrinsics;
    const Rigid& m = frame.pose.world_to_camera;
    std::array<float, kTsdfFrameWords> row = {float(k.fx), float(k.fy), float(k.cx), float(k.cy)};
    for (size_t r = 0; r < 3; ++r)
        for (size_t c = 0; c < 3; ++c)
            row[4 + r * 3 + c] = float(m[r * 4 + c]);
    const Point3 center = translation_of(frame.pose.camera_to_world());
    for (size_t axis = 0; axis < 3; ++axis) {
        const double at = center[axis] / box.voxel - double(box.low[axis]), whole = std::floor(at);
        row[13 + axis] = std::bit_cast<float>(int32_t(whole));
        row[16 + axis] = float(at - whole);
    }
    row[19] = std::bit_cast<float>(k.width);
    row[20] = std::bit_cast<float>(k.height);
    row[21] = std::bit_cast<float>(first);
    return row;
}

// depth; rgb, label << 24
void pack(const DepthImages& images, uint32_t excluded, uint32_t* out)
{
    for (size_t i = 0; i < images.depth.size(); ++i) {
        const uint32_t label = images.labels.empty() ? 255 : images.labels[i];
        const bool used = label >= 32 || !(excluded >> label & 1);
        uint32_t rgb = kGray;
        if (!images.colors.empty())
            rgb = images.colors[3 * i] | uint32_t(images.colors[3 * i + 1]) << 8 |
                  uint32_t(images.colors[3 * i + 2]) << 16;
        out[2 * i] = std::bit_cast<uint32_t>(used ? images.depth[i] : 0.f);
        out[2 * i + 1] = rgb | label << 24;
    }
}

} // namespace

Result<FrameBatch> FrameBatch::create(Device& device, const DepthFrames& frames)
{
    uint64_t largest = 1, all = 0;
    for (const CameraFrame& frame : frames.cameras) {
        largest = std::max<uint64_t>(largest, pixels_of(frame));
        all += pixels_of(frame);
    }
    constexpr uint64_t kPlaneBytes = 16;
    const uint64_t limit = std::min(device.limits().max_storage_range, device.limits().max_allocation) / kPlaneBytes;
    if (largest > limit)
        return fail(ErrorCode::out_of_memory, "a frame of {} pixels; this device has room for {}", largest, limit);
    FrameBatch batch(device);
    const auto pixels = uint32_t(std::min({std::max(largest, kMaxPixels), std::max(largest, all), limit}));
    batch.table_ = batch.state_.tensor(kMaxFrames, kTsdfFrameWords, DType::f32, "frames", kTsdfFrameWords);
    batch.pixels_ = batch.state_.tensor(pixels, 2, DType::u32, "pixels", 2);
    SR_CHECK(batch.state_.allocate(device, "frames to fuse"));
    SR_CHECK(batch.pixels_.clear(device));
    return batch;
}

size_t FrameBatch::fitting(const DepthFrames& frames, std::span<const uint32_t> order, size_t next) const
{
    size_t count = 0;
    uint64_t pixels = 0;
    while (count < kMaxFrames && next + count < order.size()) {
        pixels += pixels_of(frames.cameras[order[next + count]]);
        if (pixels > this->pixels())
            break;
        ++count;
    }
    return count;
}

Status FrameBatch::upload(const DepthFrames& frames, const FusionBox& box, std::span<const uint32_t> batch,
                          uint32_t excluded)
{
    std::vector<float> table(size_t(kMaxFrames) * kTsdfFrameWords);
    std::vector<uint32_t> words;
    for (size_t i = 0; i < batch.size(); ++i) {
        const CameraFrame& camera = frames.cameras[batch[i]];
        const size_t first = words.size() / 2, count = pixels_of(camera);
        SR_TRY(const DepthImages images, frames.load(batch[i]));
        SR_ASSERT(images.depth.size() == count && (images.labels.empty() || images.labels.size() == count) &&
                      (images.colors.empty() || images.colors.size() == 3 * count),
                  "pictures of another size than the camera's {} x {}", camera.intrinsics.width,
                  camera.intrinsics.height);
        words.resize(words.size() + 2 * count);
        pack(images, excluded, &words[2 * first]);
        std::ranges::copy(table_row(camera, box, uint32_t(first)), &table[i * kTsdfFrameWords]);
    }
    SR_CHECK(table_.write(*device_, table));
    return pixels_.row_range(0, uint32_t(words.size() / 2)).write(*device_, words);
}

TsdfFrames FrameBatch::in(Graph& g) const
{
    return {table_.in(g), pixels_.in(g)};
}

} // namespace semrover
