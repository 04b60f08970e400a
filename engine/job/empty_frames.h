// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/camera.h"
#include "engine/deferred/frame_images.h"
#include "engine/job/job.h"
#include "engine/splat/bounds.h"

namespace semrover {

// "x -1.2 to 30, y 4 to 8.5, z 0 to 1.7 m"
std::string extent_text(const Bounds& bounds);
Bounds bounds_of(const CameraPath& path); // of the cameras' positions

bool sees_nothing(const FramePixels& frame);

// Counts the frames of a drive that see nothing of the scene: most often path and grid lie in different frames.
class EmptyFrames {
  public:
    // allowed: that no frame sees anything is no error
    EmptyFrames(const CameraPath& path, const Path& scene_name, bool allowed)
        : path_(bounds_of(path)), scene_name_(scene_name), allowed_(allowed)
    {
    }
    void set_scene(const Bounds& bounds) { scene_ = bounds; }

    void add(bool sees_nothing)
    {
        ++frames_;
        empty_ += sees_nothing;
    }
    size_t count() const { return empty_; }
    bool all() const { return frames_ > 0 && empty_ == frames_; }

    // when all frames were added: a warning where some see nothing, with both extents. bad_input where none does
    Status report(const JobCallbacks& callbacks) const;

  private:
    Bounds path_, scene_{};
    Path scene_name_;
    bool allowed_;
    size_t frames_ = 0, empty_ = 0;
};

} // namespace semrover
