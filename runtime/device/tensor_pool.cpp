// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/device/tensor_pool.h"

#include "runtime/device/device.h"

#include <numeric>

namespace semrover {

struct TensorPoolMemory {
    struct Item {
        std::string name;
        uint64_t bytes, offset = 0;
        uint32_t block = 0;
    };
    std::vector<Item> items;
    std::vector<std::unique_ptr<Buffer>> blocks;

    // one item after the other; places them, and returns the sizes of the blocks
    std::vector<uint64_t> lay_out(const DeviceLimits& limits, std::vector<Item>& placed) const
    {
        std::vector<uint64_t> sizes;
        for (Item& item : placed) {
            const uint64_t bytes = round_up64(item.bytes, limits.offset_alignment);
            if (sizes.empty() || sizes.back() + bytes > limits.max_allocation)
                sizes.push_back(0);
            item.block = uint32_t(sizes.size() - 1);
            item.offset = sizes.back();
            sizes.back() += bytes;
        }
        return sizes;
    }
    BufferSlice slice(uint32_t index) const
    {
        const Item& item = items[index];
        return {blocks.empty() ? nullptr : blocks[item.block].get(), item.offset, item.bytes};
    }
};

const std::string& DeviceTensor::name() const
{
    return memory_->items[item_].name;
}

Tensor DeviceTensor::in(Graph& g) const
{
    if (!valid())
        return {};
    Tensor t = shape_;
    t.resource = g.resource_of(memory_, item_, memory_->slice(item_), name());
    return t;
}

BufferSlice DeviceTensor::slice() const
{
    return memory_->slice(item_).part(shape_.offset, bytes());
}

DeviceTensor DeviceTensor::row_range(uint32_t first, uint32_t count) const
{
    SR_ASSERT(uint64_t(first) + count <= rows(), "rows {} to {} of '{}', which has {}", first, uint64_t(first) + count,
              name(), rows());
    return {memory_, item_, shape_.row_range(first, count)};
}

Status DeviceTensor::write_bytes(Device& device, std::span<const std::byte> bytes) const
{
    SR_ASSERT(bytes.size() == this->bytes(), "{} bytes written to '{}', which has {}", bytes.size(), name(),
              this->bytes());
    return device.write(slice(), bytes);
}

Status DeviceTensor::read_bytes(Device& device, std::span<std::byte> bytes) const
{
    SR_ASSERT(bytes.size() == this->bytes(), "{} bytes read from '{}', which has {}", bytes.size(), name(),
              this->bytes());
    return device.read(slice(), bytes);
}

Status DeviceTensor::write_rows(Device& device, std::span<const float> values) const
{
    SR_ASSERT((dtype() == DType::f32 || dtype() == DType::f16) && values.size() % cols() == 0 &&
                  values.size() / cols() <= rows(),
              "{} numbers for '{}', [{}, {}] {}", values.size(), name(), rows(), cols(), dtype_name(dtype()));
    std::vector<std::byte> bytes(this->bytes());
    for (size_t r = 0; r < values.size() / cols(); ++r)
        from_float(values.subspan(r * cols(), cols()), dtype(), &bytes[r * shape_.row_bytes()]);
    return write_bytes(device, bytes);
}

Result<std::vector<float>> DeviceTensor::read_rows(Device& device, uint32_t count) const
{
    const DeviceTensor some = row_range(0, count);
    std::vector<std::byte> bytes(some.bytes());
    SR_CHECK(some.read_bytes(device, bytes));
    std::vector<float> values(size_t(count) * cols());
    const size_t row = cols() * dtype_bytes(dtype());
    for (size_t r = 0; r < count; ++r)
        to_float(std::span(bytes).subspan(r * shape_.row_bytes(), row), dtype(), &values[r * cols()]);
    return values;
}

Status DeviceTensor::clear(Device& device) const
{
    return device.clear(slice());
}

TensorPool::TensorPool() : memory_(std::make_unique<TensorPoolMemory>()) {}
TensorPool::~TensorPool() = default;
TensorPool::TensorPool(TensorPool&&) noexcept = default;
TensorPool& TensorPool::operator=(TensorPool&&) noexcept = default;

DeviceTensor TensorPool::tensor(uint32_t rows, uint32_t cols, DType dtype, std::string_view name, uint32_t ld)
{
    SR_ASSERT(memory_->blocks.empty(), "'{}' is declared after the state was allocated", name);
    SR_ASSERT(rows > 0 && cols > 0 && (!ld || ld >= cols), "slot '{}' is [{}, {}] with rows {} apart", name, rows, cols,
              ld);
    SR_ASSERT(cols % block_of(dtype).elements == 0, "slot '{}' has {} columns, not whole blocks of {}", name, cols,
              dtype_name(dtype));
    const Tensor shape{Tensor::kNone, dtype, rows, cols, ld ? ld : round_up(cols, kRowPadding), 0};
    memory_->items.push_back({std::string(name), shape.bytes()});
    return {memory_.get(), uint32_t(memory_->items.size() - 1), shape};
}

uint64_t TensorPool::planned_bytes(const DeviceLimits& limits) const
{
    std::vector<TensorPoolMemory::Item> items = memory_->items;
    const std::vector<uint64_t> blocks = memory_->lay_out(limits, items);
    return std::accumulate(blocks.begin(), blocks.end(), uint64_t(0));
}

Status TensorPool::allocate(Device& device, const char* label)
{
    SR_ASSERT(memory_->blocks.empty(), "the state is allocated already: {}", label);
    for (uint64_t bytes : memory_->lay_out(device.limits(), memory_->items)) {
        SR_TRY(auto block, Buffer::create(device, bytes, MemoryKind::device, label));
        memory_->blocks.push_back(std::move(block));
    }
    return {};
}

// here, so that graphs need not know what a slot is
Tensor Graph::keep(Tensor made, const DeviceTensor& slot)
{
    return keep(made, slot.in(*this));
}

} // namespace semrover
