// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/conditioning/scene_objects.h"
#include "engine/voxfield/voxfield_model.h"
#include "engine/world/world_labels.h"

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

// The objects that condition a world's model: those that were given or, block by block as generation comes near,
// guessed of the labels as the source has them. Edits change no object.
class WorldObjects {
  public:
    // model: outlives this. Errors: bad_input for objects that it cannot be conditioned on
    static Result<WorldObjects> create(const VoxfieldModel& model, const GivenObjects& given, uint64_t seed);

    static WorldObjects none(const VoxfieldModel& model) { return {model, 0}; } // of a world without a model

    // Those that may reach a voxel of the window, always in the same order. Errors: of the source; as guess_objects
    Result<std::vector<SceneObject>> near(WorldLabels& labels, const CellWindow& window);
    void keep_near(const CellWindow& window); // forgets the blocks that do not reach it

  private:
    WorldObjects(const VoxfieldModel& model, uint64_t seed) : model_(&model), seed_(seed) {}

    const VoxfieldModel* model_;
    uint64_t seed_;
    GivenObjects given_;
    std::map<TileIndex, std::vector<SceneObject>> blocks_;
};

} // namespace semrover
