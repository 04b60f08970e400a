// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/conditioning/scene_objects.h"
#include "engine/scene/grid.h"
#include "engine/voxfield/voxfield_model.h"

namespace semrover {

// objects of a scene as a caller gives them; none: guessed from the labels
using GivenObjects = std::optional<std::vector<SceneObject>>;

// What conditions a run's model beside labels: the given objects, or those guessed of `grid` with the model's usual
// ones. Numbers are as write_objects writes them, so that what was written gives the same. A model that knows labels
// alone is not conditioned. by_blocks: guess them as worlds do that are generated place by place (guess_blocks).
// Errors: bad_input, where such a model is given objects, and as guess_objects
Result<std::vector<SceneObject>> conditioning_objects(const VoxfieldModel& model, const GivenObjects& given,
                                                      const VoxelGrid& grid, uint64_t seed, bool by_blocks = false);

uint64_t hash_objects(std::span<const SceneObject> objects);

} // namespace semrover
