// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/json.h"
#include "tools/cli/commands.h"
#include "tools/eval/features.h"

#include <array>
#include <optional>

namespace semrover {

// The two sets that a metric compares: images or grids through a network, or features and moments from files
struct EvalOptions {
    std::array<std::string, 2> sets;
    std::string network; // a safetensors file; not needed when both sets are features already
    std::string save;    // a folder for the features that were computed
    uint32_t batch = 0;  // images or chunks at a time; 0: 8 images, 4 chunks
    uint64_t seed = 0;   // of what is drawn at random
};
void add_eval_options(CLI::App& command, EvalOptions& options);

// what a network looks at
enum class EvalNetwork { images, points };

struct EvalSet {
    std::optional<Features> features;
    std::optional<Gaussian> moments; // of a file with mu and sigma: no features
    Json description;                // path, kind, samples
};
struct EvalSets {
    std::array<EvalSet, 2> set;
    Json report; // a, b, features, network, device, peak_bytes: for --json
};

// `only`: the kind of network that the metric is defined with, if any. Errors: usage when a network is needed and not
// given, or an output exists; bad_input; interrupted; the device's
Result<EvalSets> load_eval_sets(const EvalOptions& options, std::optional<EvalNetwork> only, const Globals& globals);

// both sets' features; bad_input, naming the metric, when one has moments only
Status require_features(const EvalSets& sets, std::string_view metric);

// "1000 images and 980 images, 2048 features each"
std::string sets_text(const EvalSets& sets);

} // namespace semrover
