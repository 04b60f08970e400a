// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/result.h"
#include "runtime/graph/buffer_slice.h"
#include "runtime/graph/kernel.h"
#include "runtime/graph/limits.h"
#include "runtime/graph/tensor.h"

#include <initializer_list>
#include <map>
#include <string>
#include <string_view>
#include <vector>

// A graph of dispatches over lazy tensors. Built once per (model, shape, batch), compiled by named stages over plain
// data (plan.h), then replayed (program.h). Nothing here touches Vulkan.
namespace semrover {

class Slot;

struct Grid {
    enum class Unit : uint8_t { groups, threads, row_tiles, tiles } unit = Unit::groups;
    uint32_t x = 1, y = 1, z = 1;
};
// workgroups; invocations (divided by the local size, folded over y when there are too many: see lib/thread.glsl);
// tiles of rows (divided by the variant's kTileM and folded likewise); tiles of an output of rows x cols (divided by
// kTileM and kTileN: x runs over rows, y over columns)
constexpr Grid groups(uint32_t x, uint32_t y = 1, uint32_t z = 1)
{
    return {Grid::Unit::groups, x, y, z};
}
constexpr Grid threads(uint32_t x)
{
    return {Grid::Unit::threads, x, 1, 1};
}
constexpr Grid row_tiles(uint32_t rows)
{
    return {Grid::Unit::row_tiles, rows, 1, 1};
}
constexpr Grid tiles(uint32_t rows, uint32_t cols, uint32_t z = 1)
{
    return {Grid::Unit::tiles, rows, cols, z};
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

struct DispatchOptions {
    std::vector<ConstantValue> constants = {};
    // with these the op can be cut into bands of rows; needs a push member `rows`, and `first_row` where the shader
    // must know which rows it has
    std::vector<BandedBinding> banded = {};
    // the constant with which a producer of binding X can do this dispatch's work in its epilogue ("kGelu")
    std::string_view absorbed_as = {};
    bool keeps_x = false;       // absorbed: the producer goes on writing X, others may read it (statistics of X)
    double flops = 0;           // counted
    double most_operations = 0; // about, at most: where the data says how many
    // columns of K that suit its shape, where a workgroup has some at a time in shared memory; 0: any
    uint32_t depth_step = 0;
    uint32_t depth = 0, image_rows = 0; // K, and rows of one image; 0: not to be cut into slices of K
    uint32_t without_needs = 0; // KernelNeeds that a variant may not have for this one: its shape does not suit them
};

struct Resource {
    std::string name; // a label, never a key
    uint64_t bytes = 0;
    bool external = false;
    BufferSlice memory; // external only
};

struct Node {
    const Kernel* kernel = nullptr;
    std::vector<Tensor> tensors; // one per binding
    std::vector<uint8_t> push;
    Grid grid;
    DispatchOptions options;
};

struct GraphDesc {
    std::vector<Resource> resources;
    std::vector<Node> nodes;
    bool in_order = false;
};

class Graph {
  public:
    // uninitialised memory of the graph; rows padded to kRowPadding elements
    [[nodiscard]] Tensor matrix(uint32_t rows, uint32_t cols, DType dtype, std::string_view name = "");
    // count elements, no padding between rows of `width`
    [[nodiscard]] Tensor array(uint32_t count, DType dtype, std::string_view name = "", uint32_t width = 1);
    // memory outside the graph; ld = 0: padded as matrix() does
    [[nodiscard]] Tensor external(const BufferSlice& memory, uint32_t rows, uint32_t cols, DType dtype,
                                  std::string_view name = "", uint32_t ld = 0);

    // tensors in binding order; the shader says which are read and which are written
    template <typename Push>
    void dispatch(const Kernel& kernel, std::initializer_list<Tensor> tensors, const Push& push, Grid grid,
                  DispatchOptions options = {})
    {
        const auto* bytes = reinterpret_cast<const uint8_t*>(&push);
        add(kernel, tensors, {bytes, bytes + sizeof(Push)}, grid, std::move(options));
    }
    void dispatch(const Kernel& kernel, std::initializer_list<Tensor> tensors, Grid grid, DispatchOptions options = {})
    {
        add(kernel, tensors, {}, grid, std::move(options));
    }

    // The only way to keep what a graph makes: `made`, a whole tensor of this graph, is made in memory outside it, of
    // the same shape and row length. `made` and views of it go on being good and lie there too. What reads the memory's
    // old contents must be in the graph before the pass that makes `made`.
    Tensor keep(Tensor made, Tensor memory);
    Tensor keep(Tensor made, const Slot& slot);

    // Passes run in the order in which they are added, also where they could run side by side: halves of the work that
    // follow each other then share their memory.
    void keep_order() { desc_.in_order = true; }

    // the resource of a piece of memory that has an owner: the same one every time (Slot::in)
    uint32_t outside(const void* owner, uint32_t item, const BufferSlice& memory, std::string_view name);

    const GraphDesc& desc() const { return desc_; }

  private:
    void add(const Kernel& kernel, std::initializer_list<Tensor> tensors, std::vector<uint8_t> push, Grid grid,
             DispatchOptions options);
    Tensor placed(Tensor t) const; // where it is now, if it was kept
    bool share_bytes(const Tensor& a, const Tensor& b) const;
    void check_keep(const Tensor& made, const Tensor& memory) const;

    GraphDesc desc_;
    std::map<uint32_t, Tensor> kept_;                            // transient -> the memory that it lies in
    std::map<std::pair<const void*, uint32_t>, uint32_t> owned_; // owner and item -> resource
};

} // namespace semrover
