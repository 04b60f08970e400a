// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/graph/plan.h"
#include "runtime/graph/variant.h"
#include "tests/support/kernel_case.h"

#include <cmath>

namespace semrover {

// a row of softmax(scores) v in double, key by key
struct SoftmaxSum {
    std::vector<double> y;
    std::vector<double> off; // how far y may be off where each weight is rounded to fp16: half a unit in the last place
    double total = 0;

    explicit SoftmaxSum(size_t channels) : y(channels), off(channels) {}

    // value(d): channel d of the key's value
    template <typename Value>
    void add(double weight, Value value)
    {
        total += weight;
        for (size_t d = 0; d < y.size(); ++d) {
            const double v = value(uint32_t(d));
            y[d] += weight * v;
            off[d] += std::max(weight * 0x1p-11, 0x1p-25) * std::abs(v);
        }
    }
    void finish()
    {
        for (size_t d = 0; d < y.size(); ++d) {
            y[d] /= total;
            off[d] /= total;
        }
    }
    // of channel d as a kernel writes it; the sum itself is in fp32
    double tolerance(size_t d, DType dtype, bool rounded_weights) const
    {
        return (dtype == DType::f16 ? 3e-8 + 6e-4 * std::abs(y[d]) : 0) + (rounded_weights ? off[d] : 0);
    }
};

// matrix units multiply fp16 weights; most: head_dim up to which a kernel uses them
inline bool rounds_weights(const Kernel& kernel, uint32_t head_dim, uint32_t most, DType dtype)
{
    const ConstantValue chunks[] = {{"kChunks", head_dim / 8}};
    const KernelVariant* v = choose_variant(kernel, test_device().limits(), chunks);
    return dtype == DType::f16 && head_dim <= most && v && v->name == "coopmat";
}

} // namespace semrover
