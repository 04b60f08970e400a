// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/model/random_weights.h"

#include "runtime/base/hash.h"
#include "runtime/base/mix64.h"

#include <cmath>

namespace semrover {

namespace {

// 24 bits as -1 <= x < 1
float centred(uint64_t bits)
{
    return float(int32_t(bits & 0xffffff) - 0x800000) * (1.f / 0x800000);
}

} // namespace

void random_tensor(uint64_t seed, const TensorSpec& spec, std::vector<float>& values)
{
    uint64_t count = 1, fan_in = 1;
    for (size_t i = 0; i < spec.shape.size(); ++i) {
        count *= spec.shape[i];
        fan_in *= i ? spec.shape[i] : 1;
    }
    float centre = 0, scale = std::sqrt(3.f / float(fan_in)); // a uniform number's variance is scale^2 / 3
    if (spec.shape.size() < 2) {
        const bool norm = spec.name.ends_with("weight");
        centre = norm ? 1.f : 0.f;
        scale = norm ? 0.1f : 0.05f;
    }
    Hash hash;
    hash.add(spec.name);
    const uint64_t key = mix64(hash.value() ^ mix64(seed + kMixStep));
    values.resize(count);
    float* out = values.data();
    const uint64_t pairs = count / 2;
    for (uint64_t i = 0; i < pairs; ++i) {
        const uint64_t bits = mix64(key + i * kMixStep);
        out[2 * i] = centre + scale * centred(bits);
        out[2 * i + 1] = centre + scale * centred(bits >> 32);
    }
    if (count % 2)
        out[count - 1] = centre + scale * centred(mix64(key + pairs * kMixStep));
}

} // namespace semrover
