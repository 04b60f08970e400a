// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/graph/kernel.h"
#include "runtime/graph/limits.h"
#include "runtime/graph/tensor.h"

#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

// One dispatch of a kernel: what an op says of it, and what the stages of a plan add (plan.h).
namespace semrover {

// of the output, that a workgroup makes
struct Tile {
    uint32_t rows = 1, cols = 1;

    bool operator==(const Tile&) const = default;
};

struct Grid {
    enum class Unit : uint8_t { groups, threads, row_tiles, tiles } unit = Unit::groups;
    uint32_t x = 1, y = 1, z = 1;
    Tile tile = {};
};
// workgroups
constexpr Grid groups(uint32_t x, uint32_t y = 1, uint32_t z = 1)
{
    return {Grid::Unit::groups, x, y, z};
}
// invocations, each of which makes that many rows: divided by the local size, and folded over y when there are too many
// (lib/thread.glsl)
constexpr Grid threads(uint32_t x, uint32_t rows_each = 1)
{
    return {Grid::Unit::threads, x, 1, 1, {rows_each, 1}};
}
// rows, so many of which a workgroup makes; folded likewise
constexpr Grid row_tiles(uint32_t rows, uint32_t rows_each)
{
    return {Grid::Unit::row_tiles, rows, 1, 1, {rows_each, 1}};
}
// an output of rows x cols, of which a workgroup makes a tile, or that of the alternative that is taken: x runs over
// rows, y over columns
constexpr Grid tiles(uint32_t rows, uint32_t cols, uint32_t z = 1, Tile tile = {})
{
    return {Grid::Unit::tiles, rows, cols, z, tile};
}

struct ConstantValue {
    std::string_view name;
    uint32_t value;
};

// what a convolution reaches: the rows of input pixels that rows of output pixels need. Images are padded in rows.
struct RowWindow {
    uint32_t out_width = 0, out_height = 0, out_image_rows = 0; // out_width = 0: no window
    uint32_t in_width = 0, in_height = 0, in_image_rows = 0;    // in_height: after upsampling
    uint32_t stride = 1, padding = 0, kernel = 1;
    uint32_t shift = 0; // 1: input pixels are seen twice as large

    // rows [first, last) of the input that rows [first, first + count) of the output need
    std::pair<uint64_t, uint64_t> input_rows(uint64_t first, uint64_t count) const;
};

// a binding whose rows belong to rows of the output
struct BandedBinding {
    std::string_view name;
    uint32_t divisor = 1; // row r of the output belongs to row r / divisor of the binding
    RowWindow window;     // or to the rows around it; then push member `<binding>_first` says which comes first

    BandedBinding(const char* n) : name(n) {}
    BandedBinding(std::string_view n, uint32_t d) : name(n), divisor(d) {}
    BandedBinding(std::string_view n, const RowWindow& w) : name(n), window(w) {}
};

// one way to make the same bits: a tile, and the constants with which the shader makes it
struct Alternative {
    Tile tile;
    std::vector<ConstantValue> constants;
};

struct DispatchOptions {
    const KernelVariant* variant = nullptr; // as Graph::variant() chose it; none: as it would
    std::vector<ConstantValue> constants = {};
    // bindings of which a band of rows is bound where the whole does not fit; needs a push member `rows`, and
    // `first_row` where the shader must know which rows it has
    std::vector<BandedBinding> banded = {};
    // constant that turns this op on in the epilogue of the pass that makes its X ("kGelu"); empty: it is never fused
    std::string_view epilogue = {};
    bool keeps_x = false; // when fused, the producer still writes X, which others may read (statistics of X)
    double flops = 0;     // counted
    double max_flops = 0; // upper bound, where the data decides
    // tiles with the same result: the first is used until runs on the device have found the fastest
    std::vector<Alternative> alternatives = {};
};

struct PassBinding {
    uint32_t resource = 0;
    uint64_t offset = 0; // bytes from the resource's start
    uint64_t bytes = 0;
    Access access = Access::read;
    BindingKind kind = BindingKind::storage;
    std::string_view name;

    bool given() const { return resource != Tensor::kNone; } // else the shader does not use it
};

struct Pass {
    const Kernel* kernel = nullptr;
    const KernelVariant* variant = nullptr;
    std::vector<Tensor> tensors;            // one per binding, or none
    std::map<uint32_t, uint32_t> constants; // id -> value, those that differ from the default
    std::vector<uint8_t> push;
    Grid grid;
    DispatchOptions options;

    // what follows is the plan's
    std::vector<PassBinding> bindings;
    uint32_t group_count[3] = {1, 1, 1};
    std::vector<uint32_t> epilogues; // ids of the constants of fused epilogues, and the bindings that they use
    std::vector<size_t> epilogue_bindings;
    uint32_t level = 0;       // passes of one level run without a barrier between them
    uint32_t alternative = 0; // the one that is taken

    std::string name() const;                                 // "gemm.coopmat"
    void set_constant(std::string_view name, uint32_t value); // where the shader has one
    void set_push(std::string_view name, uint32_t value);     // the shader has such a member
    void take(uint32_t index); // one of options.alternatives; workgroups are counted later
    void bind();               // bindings of the tensors
};

} // namespace semrover
