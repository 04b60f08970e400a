// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/device/memory.h"
#include "runtime/graph/tensor.h"

#include <memory>
#include <span>
#include <string>
#include <vector>

namespace semrover {

class Graph;
struct DeviceLimits;
struct TensorPoolMemory; // items of a TensorPool, and its blocks once they are there

// A matrix of a TensorPool. Cheap to copy, and good as long as its TensorPool is, wherever that is moved to. Its memory
// is there from TensorPool::allocate() on; before, its tensors are good for planning.
class DeviceTensor {
  public:
    DeviceTensor() = default; // none

    bool valid() const { return memory_ != nullptr; }
    uint32_t rows() const { return shape_.rows; }
    uint32_t cols() const { return shape_.cols; }
    uint32_t ld() const { return shape_.ld; } // elements from one row to the next
    DType dtype() const { return shape_.dtype; }
    uint64_t bytes() const { return shape_.bytes(); }
    const std::string& name() const;
    bool same_as(const DeviceTensor& other) const
    {
        return memory_ == other.memory_ && item_ == other.item_;
    } // or its rows

    // the tensor in a graph: of one resource, however often it is asked for; none of none
    Tensor in(Graph& g) const;
    BufferSlice slice() const;

    DeviceTensor row_range(uint32_t first, uint32_t count) const;

    // Copies, after everything submitted so far. Elements as they lie, rows() * ld() of them:
    template <typename Range>
    Status write(Device& device, const Range& values) const
    {
        return write_bytes(device, std::as_bytes(std::span(values)));
    }
    template <typename T>
    Result<std::vector<T>> read(Device& device) const
    {
        std::vector<T> values(bytes() / sizeof(T));
        SR_CHECK(read_bytes(device, std::as_writable_bytes(std::span(values))));
        return values;
    }
    // rows of cols() numbers without padding, for fp32 and fp16: the first rows; what is not given becomes zero
    Status write_rows(Device& device, std::span<const float> values) const;
    Result<std::vector<float>> read_rows(Device& device, uint32_t count) const;
    Status clear(Device& device) const;

  private:
    friend class TensorPool;
    DeviceTensor(TensorPoolMemory* memory, uint32_t item, const Tensor& shape)
        : memory_(memory), item_(item), shape_(shape)
    {
    }
    Status write_bytes(Device& device, std::span<const std::byte> bytes) const;
    Status read_bytes(Device& device, std::span<std::byte> bytes) const;

    TensorPoolMemory* memory_ = nullptr;
    uint32_t item_ = 0;
    Tensor shape_; // of no resource; its offset counts from the item's start
};

// Typed memory that outlives graphs: weights, inputs, outputs, what stays from one run to the next. First every tensor
// is declared, which is the only place that says its size; then all of them are allocated, in blocks of at most the
// device's largest allocation, so that the sum is known before anything exists.
class TensorPool {
  public:
    TensorPool();
    ~TensorPool();
    TensorPool(TensorPool&&) noexcept;
    TensorPool& operator=(TensorPool&&) noexcept;

    // ld = 0: rows padded to kRowPadding elements
    [[nodiscard]] DeviceTensor tensor(uint32_t rows, uint32_t cols, DType dtype, std::string_view name,
                                      uint32_t ld = 0);
    uint64_t planned_bytes(const DeviceLimits& limits) const;
    Status allocate(Device& device, const char* label); // label: in the error when there is not enough memory

  private:
    std::unique_ptr<TensorPoolMemory> memory_;
};

} // namespace semrover
