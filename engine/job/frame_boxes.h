// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/annotation/box_lines.h"
#include "engine/deferred/frame_images.h"
#include "engine/job/drawn_scene.h"

namespace semrover {

// a picture of a path, from its folder on, without its kind: "front/000012"
std::string frame_key(const std::string& camera, uint32_t number);

// The lines of boxes.jsonl of a drive whose pictures have instances: made as pictures are, written when all are there.
class FrameBoxes {
  public:
    // bad_input for a path that a DriveRecord cannot hold
    static Result<std::unique_ptr<FrameBoxes>> create(const CameraPath& path, const DrawOptions& draw,
                                                      const PictureEncoding& encoding);

    // of a frame of the path; on any thread
    std::string line(const CameraFrame& frame, uint32_t number, const FramePixels& pixels) const;
    // on one thread at a time; a second line of a picture replaces the first
    void keep(const std::string& key, std::string line) { lines_[key] = std::move(line); }
    // of all pictures, in the path's order; objects.json beside it
    Status write(const Path& folder) const;

  private:
    FrameBoxes(DriveRecord record, const DrawOptions& draw, const PictureEncoding& encoding);

    DriveRecord record_;
    std::vector<SceneObject> objects_;
    std::vector<PlacedObject> standing_; // those that no actor is
    std::vector<Actor> actors_;
    PictureEncoding encoding_;
    std::map<std::string, std::string> lines_;
};

constexpr const char* kObjectsName = "objects.json";

} // namespace semrover
