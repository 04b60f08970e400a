// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/drawn_scene.h"
#include "engine/job/sweep_drawing.h"
#include "tests/support/kernel_case.h"

namespace semrover {

// what a sweep of a scene sees, read back
inline SweepImage draw_sweep(const DrawnScene& scene, const LidarSweep& sweep)
{
    auto drawing = SweepDrawing::create(test_device(), scene.splats, scene.actors, sweep.lidar, {});
    EXPECT_TRUE(drawing) << drawing.error().message;
    Result<SweepImage> image = (*drawing)->render(sweep);
    EXPECT_TRUE(image) << image.error().message;
    return std::move(*image);
}

// where a ray is in it
inline size_t pixel_of(const SweepPicture& picture, uint32_t beam, uint32_t column)
{
    return beam * picture.width + size_t(int(column) + picture.shifts[beam] - picture.first);
}

} // namespace semrover
