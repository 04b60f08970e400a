// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/view/picture.h"
#include "tools/view/street.h"

namespace semrover::view {

struct RefinerRequest {
    std::string model; // with a renderer of single frames
    uint64_t seed = 0;
    uint32_t steps = 0; // 0: as the model says
};

// Makes one frame of what the camera sees: a sr_renderer of the library, which is opened for the first frame of a size.
class Refiner {
  public:
    Refiner(sr_context* context, RefinerRequest request) : context_(context), request_(std::move(request)) {}
    Refiner(const Refiner&) = delete;
    Refiner& operator=(const Refiner&) = delete;
    ~Refiner();

    bool busy() const { return busy_; }
    double step_ms() const { return step_ms_; } // of the last step
    uint32_t steps() const { return steps_; }   // of denoising a frame; 0 before the first

    Status begin(const Street& street, const Camera& camera, const Picture& picture);
    Result<bool> step(uint64_t budget_us, const Picture& picture); // true: the frame is in picture.refined()
    void cancel();

  private:
    Status open(uint32_t width, uint32_t height);

    sr_context* context_;
    RefinerRequest request_;
    sr_model* model_ = nullptr; // from the first frame on
    sr_renderer* renderer_ = nullptr;
    uint32_t width_ = 0, height_ = 0, steps_ = 0;
    bool busy_ = false;
    double step_ms_ = 0;
};

} // namespace semrover::view
