// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/world/conditioning_objects.h"

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

} // namespace semrover
