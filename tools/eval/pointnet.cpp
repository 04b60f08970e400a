// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/eval/pointnet.h"

#include "kernels/recognition.h"
#include "runtime/base/quote.h"
#include "tools/eval/folded_weights.h"

namespace semrover {

struct Pointnet::Impl {
    PointnetConfig config;
    FoldedWeights weights;
    std::vector<std::vector<uint32_t>> layers; // of each set abstraction, numbers in weights

    Impl(PointnetConfig c, SafetensorsSet file) : config(std::move(c)), weights(std::move(file))
    {
        uint32_t width = config.input_width();
        for (size_t i = 0; i < config.layers.size(); ++i) {
            uint32_t channels = 3 + width;
            std::vector<uint32_t>& own = layers.emplace_back();
            for (size_t j = 0; j < config.layers[i].mlp.size(); ++j) {
                const std::string name = fmt::format("sa{}.mlp_", i + 1);
                FoldedWeights::Shape shape{{1, 1, 0, 0}, {channels}, config.layers[i].mlp[j], true, 1e-5};
                own.push_back(weights.add(fmt::format("{}convs.{}", name, j), fmt::format("{}bns.{}", name, j), shape));
                channels = weights.outputs(own.back());
            }
            width = channels;
        }
    }
    // the widths that the file has are those of the config
    Status check(const Path& path) const
    {
        for (size_t i = 0; i < layers.size(); ++i)
            for (size_t j = 0; j < layers[i].size(); ++j)
                if (weights.outputs(layers[i][j]) != config.layers[i].mlp[j])
                    return fail(ErrorCode::bad_input, "{}: sa{}.mlp_convs.{} has {} outputs, its config says {}",
                                quote_path(path), i + 1, j, weights.outputs(layers[i][j]), config.layers[i].mlp[j]);
        return {};
    }
};

Pointnet::Pointnet(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Pointnet::~Pointnet() = default;

Result<std::unique_ptr<Pointnet>> Pointnet::load(Device& device, const Path& path, std::vector<std::string>& warnings)
{
    SR_TRY(SafetensorsSet file, SafetensorsSet::open(path));
    Path config_path = path;
    SR_TRY(PointnetConfig config, read_pointnet_config(config_path.replace_extension(".json"), warnings));
    auto impl = std::make_unique<Impl>(std::move(config), std::move(file));
    SR_CHECK(impl->weights.load(device, "sa"));
    SR_CHECK(impl->check(path));
    return std::unique_ptr<Pointnet>(new Pointnet(std::move(impl)));
}

const PointnetConfig& Pointnet::config() const
{
    return impl_->config;
}

uint32_t Pointnet::features() const
{
    return impl_->config.layers.back().mlp.back();
}

Tensor Pointnet::forward(Graph& g, Tensor positions, Tensor inputs, uint32_t sets) const
{
    const PointnetConfig& c = impl_->config;
    Tensor features = inputs;
    for (size_t i = 0; i < c.layers.size(); ++i) {
        const SetAbstraction& layer = c.layers[i];
        const PointSamples centers = farthest_point(g, positions, sets, layer.npoint);
        const Tensor members = ball_query(g, positions, centers.points, {sets, layer.radius, layer.nsample});
        Tensor x = group_points(g, positions, centers.points, features, members);
        for (const uint32_t n : impl_->layers[i]) {
            Tensor weight = impl_->weights.weight(g, n);
            weight.cols = x.cols; // its padding is zero, as that of x
            x = relu(g, gemm(g, x, weight, impl_->weights.bias(g, n), {.dtype = DType::f32}));
        }
        const PoolOptions members_of_a_group{false, layer.nsample, 1, layer.nsample, 1, 0, 0};
        features = pool2d(g, {x, 1, x.rows, 1}, members_of_a_group).data;
        positions = centers.points;
    }
    const uint32_t points = c.layers.back().npoint;
    const PoolOptions points_of_a_set{c.pool == PointnetConfig::Pool::mean, points, 1, points, 1, 0, 0};
    return pool2d(g, {features, 1, sets * points, 1}, points_of_a_set).data;
}

} // namespace semrover
