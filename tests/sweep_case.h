// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/sweep_drawing.h"
#include "tests/kernel_case.h"

namespace semrover {

// what a sweep of a scene sees, read back
inline SweepImage draw_sweep(const DrawnScene& scene, const LidarSweep& sweep)
{
    auto drawing = SweepDrawing::create(test_device(), scene, sweep.lidar, {});
    EXPECT_TRUE(drawing) << drawing.error().message;
    SweepImage image = (*drawing)->image();
    const Status status = (*drawing)->draw(sweep, [&](uint32_t part, SplatSlots seen) -> Status {
        std::vector<BufferSlice> slices;
        for (const Slot* slot : seen.all())
            slices.push_back(slot->slice());
        std::vector<std::vector<std::byte>> bytes(slices.size());
        SR_CHECK(test_device().read(slices, [&](const ReadPiece& piece) {
            bytes[piece.slice].insert(bytes[piece.slice].end(), piece.bytes.begin(), piece.bytes.end());
        }));
        for (size_t slot = 0; slot < bytes.size(); ++slot)
            (*drawing)->put(part, slot, bytes[slot], image);
        return {};
    });
    EXPECT_TRUE(status) << status.error().message;
    return image;
}

// where a ray is in it
inline size_t pixel_of(const SweepPicture& picture, uint32_t beam, uint32_t column)
{
    return beam * picture.width + size_t(int(column) + picture.shifts[beam] - picture.first);
}

} // namespace semrover
