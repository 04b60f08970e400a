// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/camera.h"
#include "engine/splat/rasterizer.h"

#include <map>
#include <tuple>

namespace semrover {

// What files of 8 and 16 bits round away, as NumPy's arrays of float32, [height, width]:
// FOLDER/{depth_expected,depth_median,alpha}/NNNNNN.npy. Depths are metres, measured as SplatCamera::radial_depth says,
// 0 where nothing is drawn (docs/formats.md §6).
class FloatBuffers {
  public:
    // the scene must outlive it
    FloatBuffers(Device& device, const SurfelScene& scene, RasterizerOptions options)
        : device_(device), scene_(scene), options_(std::move(options))
    {
        options_.pixels_over.reset();
    }

    // draws the frame, waits for it and writes it. Errors: bad_input, out_of_memory, device_lost
    Status write(const Path& folder, uint32_t number, const CameraFrame& frame);

  private:
    Device& device_;
    const SurfelScene& scene_;
    RasterizerOptions options_;
    std::map<std::tuple<uint32_t, uint32_t, CameraModel>, std::unique_ptr<Rasterizer>> rasterizers_;
};

} // namespace semrover
