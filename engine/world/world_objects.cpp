// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/world/world_objects.h"

#include "engine/conditioning/object_blocks.h"

#include <algorithm>

namespace semrover {

Result<WorldObjects> WorldObjects::create(const VoxfieldModel& model, const GivenObjects& given, uint64_t seed)
{
    WorldObjects objects(model, seed);
    if (given || model.config.condition.empty()) {
        SR_TRY(objects.given_, conditioning_objects(model, given ? given : GivenObjects(std::in_place), {}, seed));
    }
    return objects;
}

Result<std::vector<SceneObject>> WorldObjects::near(WorldLabels& labels, const CellWindow& window)
{
    if (given_)
        return *given_;
    const int32_t edge = object_block_cells(labels.voxel_size());
    std::vector<SceneObject> objects;
    for (const TileIndex& block : blocks_that_reach(window, edge)) {
        if (!blocks_.contains(block)) {
            SR_TRY(const VoxelGrid around, labels.read(labels_of_block(block, edge)));
            SR_TRY(std::vector<SceneObject> found, guess_block(around, block, model_->defaults.usual_objects, seed_));
            std::ranges::transform(found, found.begin(), as_written);
            blocks_[block] = std::move(found);
        }
        const std::vector<SceneObject>& found = blocks_.at(block);
        objects.insert(objects.end(), found.begin(), found.end());
    }
    return objects;
}

void WorldObjects::keep_near(const CellWindow& window)
{
    const int32_t edge = object_block_cells(model_->config.voxel_size);
    const std::vector<TileIndex> near = blocks_that_reach(window, edge);
    std::erase_if(blocks_, [&](const auto& block) { return !std::ranges::binary_search(near, block.first); });
}

} // namespace semrover
