// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/camera.h"
#include "engine/conditioning/scene_objects.h"
#include "engine/scene/actors.h"
#include "engine/splat/rasterizer.h"

namespace semrover {

// The actors of a scene as its splats have them: splats of one made of an object lie where the object is, those of
// others in the actor's own frame.
class SceneActors {
  public:
    SceneActors() = default; // none
    // objects: of the scene, looked at now. Takes time by the actors alone. Errors: bad_input for an actor that is made
    // of an object that is not there, and for another with an object's id
    static Result<SceneActors> create(std::vector<Actor> actors, const ObjectsById& objects);

    std::span<const Actor> all() const { return actors_; }
    uint32_t size() const { return uint32_t(actors_.size()); }
    // by the number of a thing in pictures: its actor + 1, 0 of what stands (SplatOptions::mover_rows)
    const std::vector<uint32_t>& rows() const { return rows_; }

    // does the camera move, or one of them, while the frame is read out? (RasterizerOptions::moving)
    bool moving(const CameraFrame& frame) const;
    // as these cameras see them at their times; moving: as RasterizerOptions has it, during their readouts
    SplatMovers seen_by(std::span<const CameraFrame> frames, bool moving = false) const;
    // from the frame of one camera to that of the next: of what stands, then of each actor (splat_flow)
    std::vector<std::array<float, 12>> moves(const CameraFrame& now, const CameraFrame& next) const;

  private:
    std::vector<Actor> actors_;
    std::vector<Rigid> from_splats_; // to each actor's own frame
    std::vector<uint32_t> rows_;
};

} // namespace semrover
