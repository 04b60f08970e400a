// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/result.h"
#include "runtime/graph/buffer_slice.h"
#include "runtime/graph/pass.h"

#include <map>
#include <string>
#include <string_view>
#include <vector>

// A graph of dispatches over lazy tensors. Built once per (model, shape, batch), compiled by named stages over plain
// data (plan.h), then replayed (executable.h). Nothing here touches Vulkan.
namespace semrover {

class DeviceTensor;

struct Resource {
    std::string name; // a label, never a key
    uint64_t bytes = 0;
    bool external = false;
    BufferSlice memory; // external only
};

struct NamedTensor {
    std::string_view binding;
    Tensor tensor;
};

class Graph {
  public:
    // limits: of the device that will run it, which decide the variants of kernels
    explicit Graph(const DeviceLimits& limits) : limits_(limits) {}

    // uninitialised memory of the graph; rows padded to kRowPadding elements
    [[nodiscard]] Tensor matrix(uint32_t rows, uint32_t cols, DType dtype, std::string_view name = "");
    // count elements, no padding between rows of `width`
    [[nodiscard]] Tensor array(uint32_t count, DType dtype, std::string_view name = "", uint32_t width = 1);
    // memory outside the graph; ld = 0: padded as matrix() does
    [[nodiscard]] Tensor external(const BufferSlice& memory, uint32_t rows, uint32_t cols, DType dtype,
                                  std::string_view name = "", uint32_t ld = 0);

    // Tensors by the names of the shader's bindings, which say what is read and what is written. A binding without a
    // tensor, or with one that is not valid, is one that the shader does not use with these constants.
    template <typename Push>
    void dispatch(const Kernel& kernel, const std::vector<NamedTensor>& tensors, const Push& push, Grid grid,
                  DispatchOptions options = {})
    {
        const auto* bytes = reinterpret_cast<const uint8_t*>(&push);
        add(kernel, tensors, {bytes, bytes + sizeof(Push)}, grid, std::move(options));
    }
    void dispatch(const Kernel& kernel, const std::vector<NamedTensor>& tensors, Grid grid,
                  DispatchOptions options = {})
    {
        add(kernel, tensors, {}, grid, std::move(options));
    }

    // The variant of a kernel that this device runs with these constants and tensors (of as many bindings as are
    // given), for an op whose grid depends on it; `excluded`: KernelFeatures of variants that do not suit its shape.
    const KernelVariant& variant(const Kernel& kernel, std::span<const ConstantValue> constants = {},
                                 std::span<const Tensor> tensors = {}, uint32_t excluded = 0);

    // The only way to keep a result: `made`, a whole tensor of this graph, is written to memory outside it, of the same
    // shape and row length. `made` and views of it stay valid and mean that memory. Passes that read the memory's old
    // contents must be added before the one that makes `made`.
    Tensor keep(Tensor made, Tensor memory);
    Tensor keep(Tensor made, const DeviceTensor& slot);

    // Passes run in the order in which they are added, also where they could run side by side: halves of the work that
    // follow each other then share their memory.
    void keep_order() { in_order_ = true; }

    // the resource of a piece of memory that has an owner: the same one every time (DeviceTensor::in)
    uint32_t resource_of(const void* owner, uint32_t item, const BufferSlice& memory, std::string_view name);

    const DeviceLimits& limits() const { return limits_; }
    const std::vector<Resource>& resources() const { return resources_; }
    const std::vector<Pass>& passes() const { return passes_; }
    bool in_order() const { return in_order_; }
    const Status& status() const { return status_; } // no_device: a kernel that has no variant for it

  private:
    void add(const Kernel& kernel, const std::vector<NamedTensor>& tensors, std::vector<uint8_t> push, Grid grid,
             DispatchOptions options);
    std::vector<Tensor> by_binding(const Kernel& kernel, const std::vector<NamedTensor>& tensors) const;
    Tensor placed(Tensor t) const; // where it is now, if it was kept
    bool share_bytes(const Tensor& a, const Tensor& b) const;
    void check_keep(const Tensor& made, const Tensor& memory) const;

    DeviceLimits limits_;
    std::vector<Resource> resources_;
    std::vector<Pass> passes_;
    bool in_order_ = false;
    Status status_;
    std::map<uint32_t, Tensor> kept_;                            // transient -> the memory that it lies in
    std::map<std::pair<const void*, uint32_t>, uint32_t> owned_; // owner and item -> resource
};

} // namespace semrover
