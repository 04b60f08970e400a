// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/json.h"
#include "tests/support/state_dict.h"
#include "tools/eval/pointnet.h"

#include <fstream>

namespace semrover {

// a small PointNet++ with random weights
inline Json tiny_pointnet_config()
{
    return {{"inputs", {"xyz", "rgb", "normalized"}},
            {"chunk", 2},
            {"points", 96},
            {"min_points", 20},
            {"pool", "mean"},
            {"layers",
             {{{"npoint", 40}, {"radius", 0.4}, {"nsample", 12}, {"mlp", {9, 11, 13}}},
              {{"npoint", 15}, {"radius", 0.9}, {"nsample", 7}, {"mlp", {17, 10}}}}}};
}

inline StateDict pointnet_weights(const Json& config)
{
    StateDict w;
    uint64_t width = 3 * config["inputs"].size();
    for (size_t i = 0; i < config["layers"].size(); ++i) {
        uint64_t channels = 3 + width;
        const Json& mlp = config["layers"][i]["mlp"];
        for (size_t j = 0; j < mlp.size(); ++j) {
            const std::string sa = fmt::format("sa{}.mlp_", i + 1);
            w.add_layer(fmt::format("{}convs.{}", sa, j), fmt::format("{}bns.{}", sa, j), mlp[j], channels, 1, 1, true);
            channels = mlp[j];
        }
        width = channels;
    }
    w.add("fp1.mlp_convs.0.weight", {3, 5, 1}, 1); // of the decoder: not used
    w.add("conv2.bias", {13}, 1);
    return w;
}

// NAME.safetensors and NAME.json
inline void write_pointnet(const std::filesystem::path& weights, const Json& config)
{
    pointnet_weights(config).write(weights);
    std::filesystem::path json = weights;
    std::ofstream(json.replace_extension(".json")) << config.dump();
}

} // namespace semrover
