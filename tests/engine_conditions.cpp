// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "engine/conditioning/voxel_conditions.h"
#include "engine/voxfield/token_sampler.h"
#include "runtime/base/json.h"
#include "tests/support/json_text.h"
#include "tests/support/says.h"

#include <gtest/gtest.h>
#include <numbers>

namespace semrover {
namespace engine_conditions_test {

constexpr uint32_t kWidth = 64;

Device& device()
{
    static const std::unique_ptr<Device> d = std::move(*Device::create({}));
    return *d;
}

const Transformer& transformer()
{
    static const std::unique_ptr<Transformer> t = std::move(
        *Transformer::load(device(), SEMROVER_SOURCE_DIR "/tests/golden/transformer_objects/model", DType::f16));
    return *t;
}

SceneObject car()
{
    return {.id = 0, .label = 13, .center = {2.4, 0, 0.6}, .size = {4.2, 1.8, 1.2}, .heading = 0};
}

TEST(engine_conditions, a_cell_is_told_how_far_it_lies_from_each_face_of_its_box)
{
    std::vector<float> row(60, 9);
    object_condition(car(), {3.4, 0.5, 0.6}, row);
    const double faces[] = {1.1, 3.1, 0.4, 1.4, 0.6, 0.6};
    EXPECT_EQ(row[0], 1);
    for (size_t face = 0; face < 6; ++face) {
        EXPECT_NEAR(row[1 + face] * 4, faces[face], 1e-6);
        for (size_t w = 0; w < 4; ++w) {
            const double angle = 2 * std::numbers::pi * faces[face] / double(1 << w);
            EXPECT_NEAR(row[7 + 4 * face + w], std::sin(angle), 1e-6);
            EXPECT_NEAR(row[31 + 4 * face + w], std::cos(angle), 1e-6);
        }
    }
    EXPECT_NEAR(row[55] * 4, std::log2(4.2), 1e-6);
    EXPECT_NEAR(row[56] * 4, std::log2(1.8), 1e-6);
    EXPECT_NEAR(row[57] * 4, std::log2(1.2), 1e-6);
    EXPECT_EQ(row[58], 0);
    EXPECT_EQ(row[59], 1);
    object_condition(car(), {-20, 0, 0.6}, row);
    EXPECT_EQ(row[1] * 4, 8);
    EXPECT_EQ(row[2] * 4, -2);
}

TEST(engine_conditions, parts_are_joined_in_the_order_of_the_config_and_what_is_not_known_is_zero)
{
    VoxelGrid grid;
    grid.voxel_size = 0.6f;
    grid.cells = {{4, 0, 0}, {4, 0, 1}, {40, 0, 0}};
    grid.labels = {13, 2, 13};
    SceneObject painted = car();
    painted.tint = {1, 0.5, 0};
    TransformerConfig config;
    config.condition = {ConditionPart::tint, ConditionPart::object};
    const VoxelConditions conditioned = *VoxelConditions::create(config, grid, std::span(&painted, 1));
    ASSERT_EQ(conditioned.width(), kWidth);
    std::vector<float> row(kWidth, 9), expected(60);
    conditioned.row(0, grid.cells[0], row);
    EXPECT_EQ(std::vector<float>(row.begin(), row.begin() + 4), (std::vector<float>{1, 1, 0, -1}));
    object_condition(painted, {2.7, 0.3, 0.3}, expected);
    for (size_t i = 0; i < 60; ++i)
        EXPECT_NEAR(row[4 + i], expected[i], 1e-6) << i;
    for (uint32_t cell : {1u, 2u}) { // another class; far away
        conditioned.row(cell, grid.cells[cell], row);
        EXPECT_EQ(row, std::vector<float>(kWidth, 0.f)) << cell;
    }
    SceneObject street = painted;
    street.label = grid.labels[1] = 0; // ground has no front
    const VoxelConditions ground = *VoxelConditions::create(config, grid, std::span(&street, 1));
    ground.row(1, grid.cells[1], row);
    EXPECT_EQ(std::vector<float>(row.begin(), row.begin() + 4), (std::vector<float>{1, 1, 0, -1}));
    EXPECT_EQ(std::vector<float>(row.begin() + 4, row.end()), std::vector<float>(60, 0.f));
    config.condition = {ConditionPart::tint};
    const SceneObject plain = car();
    const VoxelConditions colors = *VoxelConditions::create(config, grid, std::span(&plain, 1));
    row.assign(4, 9);
    colors.row(0, grid.cells[0], row);
    EXPECT_EQ(row, std::vector<float>(4, 0.f));
    EXPECT_TRUE(VoxelConditions::create(config, grid, {})->empty());
}

TEST(engine_conditions, a_cell_is_told_the_part_it_lies_in_beside_its_object)
{
    VoxelGrid grid;
    grid.voxel_size = 0.6f;
    grid.cells = {{0, 0, 0}, {1, 0, 0}, {4, 0, 0}};
    grid.labels = {2, 2, 2};
    const SceneObject house{.id = 0, .label = 2, .center = {1, 5, 4}, .size = {10, 8, 8}, .tint = {{0.5, 0.5, 1}}};
    SceneObject window{.id = 1, .label = 2, .center = {0.2, 0.3, 0.3}, .size = {1, 0.6, 1}, .heading = 0.5};
    window.part = true;
    SceneObject lit = window;
    lit.center[0] = 1.2;
    lit.tint = {1, 1, 0};
    const std::vector<SceneObject> objects = {house, window, lit};
    TransformerConfig config;
    config.condition = {ConditionPart::tint, ConditionPart::part};
    const VoxelConditions conditioned = *VoxelConditions::create(config, grid, objects);
    ASSERT_EQ(conditioned.width(), 4u + 64u);
    for (uint32_t cell : {0u, 1u, 2u}) {
        std::vector<float> row(conditioned.width(), 9), expected(60, 0.f);
        conditioned.row(cell, grid.cells[cell], row);
        EXPECT_EQ(std::vector<float>(row.begin(), row.begin() + 4), (std::vector<float>{1, 0, 0, 1})) << "the house's";
        if (cell < 2)
            object_condition(cell ? lit : window,
                             {(grid.cells[cell][0] + 0.5) * double(grid.voxel_size), 0.5 * double(grid.voxel_size),
                              0.5 * double(grid.voxel_size)},
                             expected);
        EXPECT_EQ(std::vector<float>(row.begin() + 4, row.begin() + 64), expected) << cell;
        const std::vector<float> tint = cell == 1 ? std::vector<float>{1, 1, 1, -1} : std::vector<float>(4, 0.f);
        EXPECT_EQ(std::vector<float>(row.begin() + 64, row.end()), tint) << cell;
    }
    config.condition = {ConditionPart::tint};
    std::vector<float> row(4, 9);
    VoxelConditions::create(config, grid, objects)->row(0, grid.cells[0], row);
    EXPECT_EQ(row, (std::vector<float>{1, 0, 0, 1})) << "a model without parts is conditioned on the rest as ever";
}

TEST(engine_conditions, a_config_names_each_part_once)
{
    const auto config = [](const char* list) { return parse_transformer_config(Json{{"condition", json_of(list)}}); };
    EXPECT_EQ(config(R"(["tint", "object"])")->condition_width(), kWidth);
    EXPECT_EQ(config("[]")->condition_width(), 0u);
    EXPECT_EQ(config("null")->condition_width(), 0u);
    EXPECT_EQ(config(R"(["object", "tint", "part"])")->condition_width(), 128u);
    EXPECT_TRUE(says(config(R"(["tint", "tint"])"), "condition"));
    EXPECT_TRUE(says(config(R"(["object", "part", "part"])"), "condition"));
    EXPECT_TRUE(says(config(R"(["colour"])"), "condition"));
    EXPECT_TRUE(says(config(R"("tint")"), "condition"));
    const Json unheard = {{"condition_voxels", true}};
    EXPECT_TRUE(says(parse_transformer_config(unheard), "condition_voxels"));
    EXPECT_TRUE((*parse_transformer_config({{"condition", {"tint"}}, {"condition_voxels", true}})).condition_voxels);
}

TEST(engine_conditions, a_config_says_how_points_of_the_training_data_lay)
{
    EXPECT_EQ(parse_transformer_config(Json::object())->placement, "shifted");
    EXPECT_EQ(parse_transformer_config(Json{{"placement", "canonical"}})->placement, "canonical");
    EXPECT_TRUE(says(parse_transformer_config(Json{{"placement", "random"}}), "placement"));
}

RegionInput patch(int32_t x, uint32_t cells, bool conditioned)
{
    RegionInput r;
    const SceneObject object = car();
    for (uint32_t i = 0; i < cells; ++i) {
        r.cells.push_back({x + int32_t(i % 7), int32_t(i / 7), 0});
        r.labels.push_back(i % 20);
        r.condition.resize((i + 1) * kWidth);
        if (conditioned && i % 2) {
            object_condition(object, {0.1 * i, 0, 0}, std::span(r.condition).last(kWidth));
            tint_condition({0.9, 0.2, 0.1 * (i % 10)}, std::span(r.condition).last(4));
        }
    }
    r.fixed.resize(cells * transformer().config().channels());
    return r;
}

std::vector<float> run(const std::vector<RegionInput>& regions, float guidance)
{
    SchedulerConfig config;
    config.prediction = Prediction::sample;
    config.spacing = TimestepSpacing::trailing;
    auto sampler = TokenSampler::create(device(), transformer(), *plan_sampling(config, 3), {{guidance}, 7});
    EXPECT_TRUE(sampler) << sampler.error().message;
    auto tokens = (*sampler)->run(regions);
    EXPECT_TRUE(tokens) << tokens.error().message;
    return *tokens;
}

TEST(engine_conditions, zeros_and_nothing_are_the_same_and_what_is_told_is_heard)
{
    for (float guidance : {1.f, 2.f}) {
        const RegionInput conditioned = patch(0, 33, true), zeros = patch(0, 33, false);
        RegionInput nothing = zeros;
        nothing.condition.clear();
        const std::vector<float> silent = run({nothing}, guidance);
        EXPECT_EQ(run({zeros}, guidance), silent);
        EXPECT_NE(run({conditioned}, guidance), silent);
    }
}

TEST(engine_conditions, a_region_is_the_same_alone_and_beside_one_that_is_told_nothing)
{
    RegionInput nothing = patch(90, 20, false);
    nothing.condition.clear();
    const RegionInput conditioned = patch(0, 33, true);
    const std::vector<float> alone = run({conditioned}, 2), batched = run({nothing, conditioned}, 2);
    const int64_t channels = transformer().config().channels();
    EXPECT_EQ(std::vector<float>(batched.begin() + 20 * channels, batched.end()), alone);
}

} // namespace engine_conditions_test
} // namespace semrover
