// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/conditioning/object_blocks.h"

#include "engine/conditioning/cell_objects.h"
#include "engine/voxfield/voxfield_model.h"

#include <algorithm>
#include <gtest/gtest.h>

namespace semrover {
namespace engine_object_blocks_test {

const UsualObjects& usual()
{
    static const auto model = VoxfieldModel::open(SEMROVER_SOURCE_DIR "/assets/model");
    return model->defaults.usual_objects;
}

// the avenue of the demo; twice: and once more half a kilometre on
VoxelGrid avenue(bool twice = false)
{
    auto grid = read_grid(SEMROVER_SOURCE_DIR "/assets/scenes/avenue.semantic.sgrid");
    EXPECT_TRUE(grid) << grid.error().message;
    const size_t count = grid->cells.size();
    for (size_t c = 0; twice && c < count; ++c) {
        append_cell(*grid, *grid, c);
        grid->cells.back()[0] += 800;
    }
    return std::move(*grid);
}

// box, class and colour of the object that a voxel belongs to
std::vector<std::string> owners_of(const VoxelGrid& grid, const std::vector<SceneObject>& objects)
{
    const auto owners = objects_of_cells(grid, objects);
    EXPECT_TRUE(owners) << owners.error().message;
    std::vector<std::string> text;
    for (const int32_t owner : *owners) {
        if (owner == kNoObject) {
            text.emplace_back();
            continue;
        }
        const SceneObject& o = objects[size_t(owner)];
        text.push_back(fmt::format("{} {} {} {} {} {}", o.label, o.center[0], o.center[1], o.size[0], o.heading,
                                   tint_text(*o.tint)));
    }
    return text;
}

TEST(engine_object_blocks, what_a_cell_belongs_to_depends_on_the_labels_near_it)
{
    const VoxelGrid whole = avenue(true);
    const int32_t edge = object_block_cells(whole.voxel_size);
    EXPECT_EQ(edge, 64);
    const auto all = guess_blocks(whole, usual(), 3);
    ASSERT_TRUE(all) << all.error().message;
    const std::vector<std::string> expected = owners_of(whole, *all);
    EXPECT_GT(std::ranges::count_if(expected, [](const auto& text) { return !text.empty(); }),
              int64_t(whole.cells.size() / 4));
    // a place of 17 voxels, from the blocks that reach it and the labels that these are guessed from
    const Cell middle = whole.cells[whole.cells.size() / 16];
    const CellWindow place = {{middle[0] - 8, middle[1] - 8}, {middle[0] + 8, middle[1] + 8}};
    std::vector<SceneObject> near;
    for (const TileIndex& block : blocks_that_reach(place, edge)) {
        VoxelGrid labels;
        labels.voxel_size = whole.voxel_size;
        for (size_t c = 0; c < whole.cells.size(); ++c)
            if (labels_of_block(block, edge).holds(whole.cells[c])) {
                labels.cells.push_back(whole.cells[c]);
                labels.labels.push_back(whole.labels[c]);
            }
        const auto found = guess_block(labels, block, usual(), 3);
        ASSERT_TRUE(found) << found.error().message;
        near.insert(near.end(), found->begin(), found->end());
    }
    EXPECT_LT(near.size(), all->size());
    const std::vector<std::string> here = owners_of(whole, near);
    size_t compared = 0;
    for (size_t c = 0; c < whole.cells.size(); ++c)
        if (place.holds(whole.cells[c])) {
            EXPECT_EQ(here[c], expected[c]) << c;
            ++compared;
        }
    EXPECT_GT(compared, 100u);
}

TEST(engine_object_blocks, most_cells_have_the_objects_that_the_whole_scene_gives_them)
{
    const VoxelGrid grid = avenue();
    const auto blocks = guess_blocks(grid, usual(), 3), whole = guess_objects(grid, usual(), 3);
    ASSERT_TRUE(blocks && whole);
    const std::vector<std::string> a = owners_of(grid, *blocks), b = owners_of(grid, *whole);
    size_t conditioned = 0, both = 0;
    for (size_t c = 0; c < a.size(); ++c) {
        conditioned += !b[c].empty();
        both += !b[c].empty() && !a[c].empty();
    }
    RecordProperty("conditioned", int(conditioned));
    RecordProperty("both", int(both));
    EXPECT_GT(both, conditioned * 9 / 10);
    for (size_t o = 0; o < blocks->size(); ++o)
        EXPECT_EQ((*blocks)[o].id, o);
}

} // namespace engine_object_blocks_test
} // namespace semrover
