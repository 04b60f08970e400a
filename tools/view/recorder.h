// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/file.h"
#include "tools/view/camera.h"

#include <vector>

namespace semrover::view {

// The way of the camera, to be saved as a path that `semrover render --path` reads.
class Recorder {
  public:
    bool on = false;

    void add(const Camera& camera, double seconds); // while it is on, and only where the camera has moved
    void clear() { poses_.clear(); }
    size_t size() const { return poses_.size(); }
    const Camera& at(size_t n) const { return poses_[n].camera; }

    // By the name: .json is nerfstudio's transforms.json with the lens of a picture of this size, .tum and .txt are
    // TUM, which has no lens. usage: another name, nothing recorded.
    Status save(const Path& path, uint32_t width, uint32_t height) const;

  private:
    struct Pose {
        double seconds = 0;
        Camera camera;
    };
    std::string tum() const;
    std::string transforms(uint32_t width, uint32_t height) const;

    std::vector<Pose> poses_;
};

} // namespace semrover::view
