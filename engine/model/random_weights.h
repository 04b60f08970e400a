// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/safetensors.h"

namespace semrover {

// Fills a tensor of an untrained network as a function of (seed, name, shape), the same on every machine. Weights are
// uniform with variance 1 / fan-in, so that activations neither grow nor fade with depth; norms are 1 +- 0.1, biases
// +- 0.05.
void random_tensor(uint64_t seed, const TensorSpec& spec, std::vector<float>& values);

} // namespace semrover
