// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/camera.h"
#include "runtime/device/executable.h"
#include "runtime/device/tensor_pool.h"
#include "tools/trace/trace_scene.h"

#include <memory>

namespace semrover {

struct Daylight {
    double sun_azimuth = 2.4;   // radians from x towards y: where the sun stands
    double sun_elevation = 0.8; // radians, above 0
    double cloud_cover = 0.4;   // 0..1
    double cloud_seed = 0;
    double exposure = 1.35;
    double haze = 1500; // metres after which 1/e of a thing's light is left
};

// a daylight for a seed: from morning to evening, more or less cloudy
Daylight daylight_of_seed(uint64_t seed);

// one frame, but for depth in the encodings that `render` writes (engine/deferred/frame_images.h); where there is sky:
// depth 0, normal 128, label 10, visible 0
struct TracedImage {
    uint32_t width = 0, height = 0;
    std::vector<uint8_t> color = {}, normal = {}, label = {}, visible = {}; // color and normal [height, width, 3]
    std::vector<float> depth = {};                                          // metres along the axis
    std::vector<uint32_t> instance = {};                                    // number of the thing, 0: none
};

// FOLDER/{color,depth,normal,label,instance,visible}/NNNNNN.png; folders are made. Errors: bad_input
Status write_traced_image(const Path& folder, uint32_t number, const TracedImage& image);

// Pictures of one size of a scene, which must outlive it.
class Tracer {
  public:
    static Result<std::unique_ptr<Tracer>> create(Device& device, const DeviceTraceScene& scene,
                                                  const ShadeOptions& options);
    // errors: device_lost, out_of_memory
    Result<TracedImage> render(const CameraFrame& frame, const Daylight& light);

  private:
    explicit Tracer(Device& device) : device_(device) {}

    Device& device_;
    ShadeOptions options_;
    TensorPool memory_;
    DeviceTensor view_, picture_;
    std::unique_ptr<Executable> executable_;
};

} // namespace semrover
