// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/world/world_objects.h"

#include "engine/conditioning/object_blocks.h"
#include "runtime/base/hash.h"
#include "runtime/base/quote.h"

#include <algorithm>

namespace semrover {

Result<std::vector<SceneObject>> conditioning_objects(const VoxfieldModel& model, const GivenObjects& given,
                                                      const VoxelGrid& grid, uint64_t seed, bool by_blocks)
{
    if (!model.config.condition.empty()) {
        std::vector<SceneObject> objects = given.value_or(std::vector<SceneObject>());
        if (!given) {
            const UsualObjects& usual = model.defaults.usual_objects;
            SR_TRY(objects, by_blocks ? guess_blocks(grid, usual, seed) : guess_objects(grid, usual, seed));
        }
        std::ranges::transform(objects, objects.begin(), as_written);
        return objects;
    }
    if (given && !given->empty())
        return fail(ErrorCode::bad_input, "{}: the model knows labels alone and cannot be conditioned on objects",
                    quote_path(model.folder));
    return std::vector<SceneObject>();
}

uint64_t hash_objects(std::span<const SceneObject> objects)
{
    Hash hash;
    for (const SceneObject& o : objects) {
        const std::array<double, 3> tint = o.tint.value_or(std::array<double, 3>{-1, -1, -1});
        const std::array<double, 11> values = {double(o.label), o.center[0], o.center[1], o.center[2],
                                               o.size[0],       o.size[1],   o.size[2],   o.heading,
                                               tint[0],         tint[1],     tint[2]};
        hash.add(std::as_bytes(std::span(values)));
        if (o.part)
            hash.add(std::as_bytes(std::span(&o.part, 1)));
    }
    return hash.value();
}

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
