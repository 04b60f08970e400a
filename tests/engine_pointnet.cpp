// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "tests/support/json_text.h"
#include "tests/support/kernel_case.h"
#include "tests/support/pointnet_files.h"
#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"
#include "tools/eval/pointnet.h"

#include <algorithm>
#include <set>

namespace semrover {
namespace engine_pointnet_test {

// points on multiples of 1/64 m, so that every distance is exact in fp32
ScenePoints lattice_scene(size_t points, double side, uint32_t seed)
{
    std::mt19937 random(seed);
    const uint32_t steps = uint32_t(side * 64);
    ScenePoints scene;
    for (size_t i = 0; i < points; ++i) {
        scene.positions.push_back(
            {float(random() % steps) / 64 - 1, float(random() % steps) / 64 - 3, float(random() % 64) / 64 + 0.5f});
        scene.colors.push_back({float(random() % 256) / 255, float(random() % 256) / 255, float(random() % 256) / 255});
    }
    return scene;
}

using Row = std::vector<double>;

double distance2(const Row& a, const Row& b)
{
    return (a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2]) * (a[2] - b[2]);
}

// one chunk through the network, naively and in double
class PointnetReference {
  public:
    PointnetReference(const Json& config, const StateDict& weights) : config_(config), w_(weights) {}

    Row operator()(std::vector<Row> points, std::vector<Row> features) const
    {
        for (size_t i = 0; i < config_["layers"].size(); ++i) {
            const std::vector<size_t> centers = farthest(points, config_["layers"][i]["npoint"]);
            std::vector<Row> next, next_points;
            for (const size_t c : centers) {
                next.push_back(group(points, features, c, i));
                next_points.push_back(points[c]);
            }
            points = next_points;
            features = next;
        }
        Row pooled = features[0];
        for (size_t n = 0; n < pooled.size(); ++n) {
            double sum = 0;
            for (const Row& f : features) {
                pooled[n] = std::max(pooled[n], f[n]);
                sum += f[n];
            }
            if (config_["pool"] == "mean")
                pooled[n] = sum / double(features.size());
        }
        return pooled;
    }

  private:
    static std::vector<size_t> farthest(const std::vector<Row>& points, size_t count)
    {
        std::vector<size_t> chosen{0};
        while (chosen.size() < count) {
            size_t best = 0;
            double best_distance = -1;
            for (size_t i = 0; i < points.size(); ++i) {
                double nearest = 1e300;
                for (const size_t c : chosen)
                    nearest = std::min(nearest, distance2(points[i], points[c]));
                if (nearest > best_distance) {
                    best_distance = nearest;
                    best = i;
                }
            }
            chosen.push_back(best);
        }
        return chosen;
    }
    Row group(const std::vector<Row>& points, const std::vector<Row>& features, size_t center, size_t layer) const
    {
        const float radius = config_["layers"][layer]["radius"];
        std::vector<size_t> members;
        for (size_t i = 0; i < points.size() && members.size() < config_["layers"][layer]["nsample"]; ++i)
            if (distance2(points[i], points[center]) <= double(radius) * radius)
                members.push_back(i);
        Row most;
        for (const size_t m : members) { // repeated ones change no maximum
            Row x;
            for (size_t a = 0; a < 3; ++a)
                x.push_back(points[m][a] - points[center][a]);
            x.insert(x.end(), features[m].begin(), features[m].end());
            for (size_t j = 0; j < config_["layers"][layer]["mlp"].size(); ++j)
                x = dense(x, fmt::format("sa{}.mlp_convs.{}", layer + 1, j),
                          fmt::format("sa{}.mlp_bns.{}", layer + 1, j));
            most.resize(x.size());
            for (size_t n = 0; n < x.size(); ++n)
                most[n] = std::max(most[n], x[n]); // after a relu nothing is below 0
        }
        return most;
    }
    Row dense(const Row& x, const std::string& conv, const std::string& norm) const
    {
        Row y(w_.size(conv + ".weight", 0));
        for (size_t n = 0; n < y.size(); ++n) {
            double sum = w_.values(conv + ".bias")[n];
            for (size_t c = 0; c < x.size(); ++c)
                sum += w_.values(conv + ".weight")[n * x.size() + c] * x[c];
            sum = (sum - w_.values(norm + ".running_mean")[n]) / std::sqrt(w_.values(norm + ".running_var")[n] + 1e-5);
            y[n] = std::max(sum * w_.values(norm + ".weight")[n] + w_.values(norm + ".bias")[n], 0.);
        }
        return y;
    }

    Json config_;
    const StateDict& w_;
};

std::vector<Row> rows_of(const std::vector<float>& values, size_t first, size_t count, size_t width, size_t used)
{
    std::vector<Row> rows;
    for (size_t i = first; i < first + count; ++i)
        rows.emplace_back(values.begin() + int64_t(i * width), values.begin() + int64_t(i * width + used));
    return rows;
}

void check(const Json& config)
{
    const ScratchFolder folder;
    write_pointnet(folder / "net.safetensors", config);
    std::vector<std::string> warnings;
    auto network = Pointnet::load(test_device(), folder / "net.safetensors", warnings);
    ASSERT_TRUE(network) << network.error().message;
    EXPECT_TRUE(warnings.empty());
    const auto chunks = cut_chunks(lattice_scene(700, 6, 3), (*network)->config());
    ASSERT_TRUE(chunks) << chunks.error().message;
    ASSERT_GE(chunks->count, 5u);
    auto extractor = PointFeatures::create(test_device(), **network, 3);
    ASSERT_TRUE(extractor) << extractor.error().message;
    Features features;
    ASSERT_TRUE((*extractor)->append(*chunks, 0, 3, features));
    ASSERT_TRUE((*extractor)->append(*chunks, 3, 2, features)); // a batch that is not full
    ASSERT_EQ(features.rows, 5u);
    ASSERT_EQ(features.cols, (*network)->features());
    const StateDict weights = pointnet_weights(config);
    const PointnetReference reference(config, weights);
    const uint32_t points = chunks->points;
    for (uint32_t i = 0; i < 5; ++i) {
        const Row expect = reference(rows_of(chunks->positions, i * points, points, 4, 3),
                                     rows_of(chunks->inputs, i * points, points, chunks->width, chunks->width));
        ASSERT_EQ(expect.size(), features.cols);
        for (size_t n = 0; n < expect.size(); ++n)
            ASSERT_NEAR(features.row(i)[n], expect[n], 1e-5 * (1 + expect[n])) << "chunk " << i << " feature " << n;
    }
}

TEST(engine_pointnet, features_of_a_tiny_network_match_a_naive_one_in_double)
{
    check(tiny_pointnet_config());
}

TEST(engine_pointnet, features_of_other_inputs_and_one_layer_match_too)
{
    Json config = tiny_pointnet_config();
    config["inputs"] = {"rgb"};
    config["pool"] = "max";
    config["points"] = 30;
    config["layers"] = {{{"npoint", 30}, {"radius", 100}, {"nsample", 40}, {"mlp", {8}}}};
    check(config);
}

TEST(engine_pointnet, batches_shrink_to_the_budget)
{
    const ScratchFolder folder;
    write_pointnet(folder / "net.safetensors", tiny_pointnet_config());
    auto device = Device::create({.max_bytes = 400 << 10});
    std::vector<std::string> warnings;
    auto network = Pointnet::load(**device, folder / "net.safetensors", warnings);
    ASSERT_TRUE(network) << network.error().message;
    const auto extractor = PointFeatures::create(**device, **network, 64);
    ASSERT_TRUE(extractor) << extractor.error().message;
    EXPECT_LT((*extractor)->batch(), 64u);
    EXPECT_LE((*device)->peak_bytes(), 400u << 10);
}

TEST(engine_pointnet, chunks_are_columns_with_equally_many_points_around_their_own_origin)
{
    PointnetConfig c;
    c.inputs = {PointnetConfig::Input::xyz, PointnetConfig::Input::rgb, PointnetConfig::Input::normalized};
    c.chunk = 2;
    c.points = 50;
    c.min_points = 3;
    ScenePoints scene;
    for (int i = 0; i < 5; ++i) { // column (0, 0): fewer than wanted
        scene.positions.push_back({0.25f * float(i), 1.5f, float(i) + 7});
        scene.colors.push_back({float(i) / 5, 0, 1});
    }
    for (int i = 0; i < 200; ++i) { // column (-1, 3): more
        scene.positions.push_back({-0.5f, 6 + float(i) / 128, 10});
        scene.colors.push_back({0.5f, 0.25f, 0});
    }
    scene.positions.push_back({100, 100, 0}); // too few
    scene.colors.push_back({0, 0, 0});
    const auto y = cut_chunks(scene, c);
    ASSERT_TRUE(y) << y.error().message;
    EXPECT_EQ(y->count, 2u);
    EXPECT_EQ(y->left_out, 1u);
    ASSERT_EQ(y->positions.size(), 2u * 50 * 4);
    ASSERT_EQ(y->inputs.size(), 2u * 50 * 9);
    std::set<float> many, few;
    for (size_t i = 0; i < 50; ++i) {         // (-1, 3) comes first
        EXPECT_EQ(y->positions[4 * i], 0.5f); // -0.5 - -1
        many.insert(y->positions[4 * i + 1]);
        EXPECT_EQ(y->positions[4 * i + 2], 0);
        EXPECT_EQ(y->inputs[9 * i + 4], 0.25f);
        EXPECT_EQ(y->inputs[9 * i + 8], 10.f / 11);
        const size_t j = 50 + i;
        EXPECT_EQ(y->positions[4 * j], 0.25f * y->positions[4 * j + 2] - 1);
        EXPECT_EQ(y->positions[4 * j + 1], 0.5f);
        EXPECT_EQ(y->inputs[9 * j + 3], y->inputs[9 * j + 2] / 5);
        EXPECT_EQ(y->inputs[9 * j + 5], 1);
        few.insert(y->positions[4 * j + 2]);
    }
    EXPECT_EQ(many.size(), 50u); // none twice
    EXPECT_EQ(few, (std::set<float>{0, 1, 2, 3, 4}));
    for (size_t i = 0; i < 5; ++i) // repeated in their order
        EXPECT_EQ(y->positions[4 * (50 + i) + 2], y->positions[4 * (55 + i) + 2]);
    EXPECT_EQ(cut_chunks(scene, c)->positions, y->positions);
    EXPECT_NE(cut_chunks(scene, c, 1)->positions, y->positions);
    scene.positions[3][2] = NAN;
    EXPECT_TRUE(says(cut_chunks(scene, c), "point 3 lies at 0.75, 1.5, nan"));
    scene.positions[3] = {1e30f, 0, 0};
    EXPECT_TRUE(says(cut_chunks(scene, c), "point 3 lies at 1e+30"));
}

TEST(engine_pointnet, files_that_do_not_fit_are_refused)
{
    const ScratchFolder folder;
    const Path path = folder / "net.safetensors";
    const auto refused = [&](const Json& config, std::string_view text) {
        pointnet_weights(tiny_pointnet_config()).write(path);
        folder.put("net.json", config.dump());
        std::vector<std::string> warnings;
        EXPECT_TRUE(says(Pointnet::load(test_device(), path, warnings), text));
    };
    pointnet_weights(tiny_pointnet_config()).write(path);
    std::vector<std::string> warnings;
    EXPECT_TRUE(says(Pointnet::load(test_device(), path, warnings), "net.json")); // no config
    Json c = tiny_pointnet_config();
    c["layers"][1]["mlp"] = {17, 12};
    refused(c, "sa2.mlp_convs.1 has 10 outputs, its config says 12");
    c["layers"][1]["mlp"] = {17};
    refused(c, "7 unexpected: sa2.mlp_bns.1.bias [10], ");
    c["layers"][1]["mlp"] = {17, 10, 4};
    refused(c, "sa2.mlp_convs.2.weight [4, 10, 1, 1]");
    c = tiny_pointnet_config();
    c["inputs"] = {"xyz", "rgb"};
    refused(c, "sa1.mlp_convs.0.weight expected [9, 9, 1, 1] found [9, 12, 1, 1]");
    c["inputs"] = {"xyz", "normal"};
    refused(c, "inputs");
    c = tiny_pointnet_config();
    c["layers"][0]["npoint"] = 97;
    refused(c, "npoint");
    c["layers"][0]["npoint"] = 10; // fewer than the second layer wants
    refused(c, "layer 2");
    c = tiny_pointnet_config();
    c["layers"][1].erase("radius");
    refused(c, "layer 2: npoint, radius, nsample and mlp are needed");
    c["layers"] = Json::array();
    refused(c, "a list of 1 to 8 layers");
    c = tiny_pointnet_config();
    c["pool"] = "sum";
    refused(c, "pool");
    c = tiny_pointnet_config();
    c["chunk"] = -1;
    refused(c, "chunk");
    refused(Json::array(), "net.json");
    StateDict w = pointnet_weights(tiny_pointnet_config());
    w.tensors["sa1.mlp_convs.2.bias"].second[4] = INFINITY;
    w.write(path);
    folder.put("net.json", tiny_pointnet_config().dump());
    EXPECT_TRUE(says(Pointnet::load(test_device(), path, warnings), "sa1.mlp_convs.2.bias"));
    StateDict other;
    other.add("Conv2d_1a_3x3.conv.weight", {2, 3, 3, 3}, 1);
    other.write(path);
    EXPECT_TRUE(
        says(Pointnet::load(test_device(), path, warnings), "expected tensors such as 'sa1.mlp_convs.0.weight'"));
}

} // namespace engine_pointnet_test
} // namespace semrover
