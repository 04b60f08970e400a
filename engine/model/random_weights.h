// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/safetensors.h"

namespace semrover {

// Values for a tensor of an untrained network, as a function of (seed, name, shape), the same on every machine:
// uniform, with variance 1 / fan-in for weights, so that activations neither grow nor fade with depth; 1 +- 0.1 for
// norms;
// +- 0.05 for biases.
void random_tensor(uint64_t seed, const TensorSpec& spec, std::vector<float>& values);

} // namespace semrover
