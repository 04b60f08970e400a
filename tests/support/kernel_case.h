// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/network.h"
#include "runtime/device/executable.h"

#include <cstring>
#include <gtest/gtest.h>
#include <random>

// What every kernel test needs: matrices on the host, their way to the device and back.
namespace semrover {

// one device for a test program; SEMROVER_LIMITS lowers its limits
Device& test_device();

// values as the device will see them: rounded to the dtype, rows padded
struct HostMatrix {
    uint32_t rows = 0, cols = 0, ld = 0;
    DType dtype = DType::f32;
    std::vector<float> values;     // [rows, ld]
    std::vector<std::byte> blocks; // of q8_0 alone: what the values are made of, as it lies on the device

    HostMatrix() = default;
    HostMatrix(uint32_t r, uint32_t c, DType t)
        : rows(r), cols(c), ld(round_up(c, kRowPadding)), dtype(t), values(size_t(r) * ld)
    {
    }
    float at(uint32_t r, uint32_t c) const { return values[size_t(r) * ld + c]; }
    void set(uint32_t r, uint32_t c, float v)
    {
        values[size_t(r) * ld + c] = dtype == DType::f16 ? half_to_float(float_to_half(v)) : v;
    }
};

class KernelCase {
  public:
    explicit KernelCase(Device& device, uint32_t seed = 1) : graph(device.limits()), device_(device), random_(seed) {}

    Graph graph;

    HostMatrix random(uint32_t rows, uint32_t cols, DType dtype, float scale = 1); // normal, but of q8_0 uniform
    std::vector<uint32_t> indices(uint32_t count, uint32_t below);

    Tensor input(const HostMatrix& m);
    template <typename T>
    Tensor input(const std::vector<T>& v, uint32_t width = 1)
    {
        static_assert(sizeof(T) == 4);
        const DType dtype = std::is_floating_point_v<T> ? DType::f32 : std::is_signed_v<T> ? DType::i32 : DType::u32;
        const auto* bytes = reinterpret_cast<const std::byte*>(v.data());
        return graph.external(upload({bytes, bytes + v.size() * 4}), uint32_t(v.size() / width), width, dtype, "input",
                              width);
    }
    // memory that a kernel writes and the test reads
    Tensor output(uint32_t rows, uint32_t cols, DType dtype, uint32_t ld = 0);

    Status compile_and_run();
    const Plan& plan() const { return executable_->plan(); }

    // runs the graph and reads y, which is copied out of the arena through an executable that ends in memory of ours
    HostMatrix run(Tensor y);
    HostMatrix read(const Tensor& t);
    template <typename T>
    std::vector<T> read_array(const Tensor& t)
    {
        const std::vector<std::byte> bytes = read_bytes(t);
        std::vector<T> v(bytes.size() / sizeof(T));
        std::memcpy(v.data(), bytes.data(), v.size() * sizeof(T));
        return v;
    }

    void expect_zero_padding(const HostMatrix& m);

  private:
    HostMatrix random_blocks(uint32_t rows, uint32_t cols, float scale);
    BufferSlice upload(const std::vector<std::byte>& bytes);
    std::vector<std::byte> read_bytes(const Tensor& t);

    Device& device_;
    std::mt19937 random_;
    std::vector<std::unique_ptr<Buffer>> buffers_;
    std::unique_ptr<Executable> executable_;
};

} // namespace semrover
