// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/network.h"

#include <functional>
#include <random>

namespace semrover {

// Graphs of real ops with everything that makes scheduling hard: values read many times, in-place updates, tensors that
// are written in parts, chains that fuse, and outputs that are read again.
class RandomGraph {
  public:
    using External = std::function<Tensor(uint32_t rows, uint32_t cols)>;

    RandomGraph(Graph& graph, uint32_t seed, External external)
        : g_(graph), random_(seed), external_(std::move(external)), weight_(external_(kCols, kCols))
    {
        for (uint32_t rows : {8u, 24u, 64u}) {
            values_.push_back(external_(rows, kCols));
            values_.push_back(external_(rows, kCols));
            outputs_.push_back(external_(rows, kCols));
        }
        const uint32_t passes = 5 + below(30);
        for (uint32_t i = 0; i < passes; ++i)
            grow();
        for (const Tensor& out : outputs_) // whatever was made last is seen
            add(g_, pick(out.rows), pick(out.rows), {out});
    }
    const std::vector<Tensor>& outputs() const { return outputs_; }

  private:
    static constexpr uint32_t kCols = 64;

    uint32_t below(uint32_t n) { return uint32_t(random_() % n); }
    Tensor pick(uint32_t rows = 0) // rather a new value than an old one
    {
        for (;;) {
            const size_t at =
                values_.size() - 1 - std::min<size_t>(below(uint32_t(values_.size())), below(uint32_t(values_.size())));
            if (!rows || values_[at].rows == rows)
                return values_[at];
        }
    }
    void stack() // two writers of the parts of one tensor
    {
        const Tensor a = pick(), b = pick(a.rows), whole = g_.matrix(2 * a.rows, kCols, DType::f32, "stack");
        add(g_, a, b, {whole});
        add(g_, b, b, {whole, a.rows});
        const Tensor folded = gelu(g_, whole);
        values_.push_back(folded.row_range(a.rows, a.rows));
    }
    void grow()
    {
        const Tensor x = pick(), y = pick(x.rows);
        switch (below(8)) {
        case 0:
            values_.push_back(gelu(g_, x));
            break;
        case 1:
            values_.push_back(silu(g_, x));
            break;
        case 2:
            values_.push_back(add(g_, x, y));
            break;
        case 3:
            values_.push_back(gemm(g_, x, weight_, {}, {.dtype = DType::f32}));
            break;
        case 4:
            values_.push_back(add(g_, gelu(g_, gemm(g_, x, weight_, {}, {.dtype = DType::f32})), y));
            break;
        case 5:
            stack();
            break;
        case 6: { // in place
            const Tensor t = add(g_, x, y);
            add(g_, x, t, {t});
            values_.push_back(t);
            break;
        }
        default: { // an output that others read
            const Tensor out = outputs_[below(uint32_t(outputs_.size()))];
            add(g_, pick(out.rows), pick(out.rows), {out});
            values_.push_back(gelu(g_, out));
        }
        }
    }

    Graph& g_;
    std::mt19937 random_;
    External external_;
    Tensor weight_;
    std::vector<Tensor> values_, outputs_;
};

} // namespace semrover
