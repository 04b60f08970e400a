// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/cli/depth_options.h"

#include "tools/cli/choice.h"
#include "tools/cli/number_option.h"

#include <algorithm>
#include <CLI/CLI.hpp>

namespace semrover {

namespace {

const std::vector<std::string> kDepthKinds = {"z", "ray", "carla"}; // as DepthKind

} // namespace

std::string_view name_of(std::optional<DepthKind> kind)
{
    return kind ? std::string_view(kDepthKinds[size_t(*kind)]) : "auto";
}

void add_depth_options(CLI::App& command, DepthEncoding& e)
{
    add_choice(command, "--depth-kind", kDepthKinds,
               "depth along the axis (z), from the camera along each ray (Hypersim, Unreal, Blender), or CARLA's 24 "
               "bits; carla for 8-bit colour pictures, else z",
               [&e](const std::string& word) {
                   e.kind = DepthKind(std::ranges::find(kDepthKinds, word) - kDepthKinds.begin());
               });
    add_number(command, "--depth-scale", e.unit,
               "metres of one unit of depth; 0.001 (TUM RGB-D: 0.0002, KITTI: 0.00390625), of fractions in .npy 1",
               1e-6, 10.0);
}

} // namespace semrover
