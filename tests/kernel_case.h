// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/network.h"
#include "runtime/device/program.h"

#include <cstring>
#include <gtest/gtest.h>
#include <random>

// What every kernel test needs: matrices on the host, their way to the device and back.
namespace semrover {

// one device for a test program; SEMROVER_LIMITS lowers its limits
inline Device& test_device()
{
    static const std::unique_ptr<Device> device = [] {
        auto made = Device::create({});
        if (!made) {
            ADD_FAILURE() << made.error().message;
            std::abort();
        }
        return std::move(*made);
    }();
    return *device;
}

// values as the device will see them: rounded to the dtype, rows padded
struct HostMatrix {
    uint32_t rows = 0, cols = 0, ld = 0;
    DType dtype = DType::f32;
    std::vector<float> values; // [rows, ld]

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
    explicit KernelCase(Device& device, uint32_t seed = 1) : device_(device), random_(seed) {}

    Graph graph;

    HostMatrix random(uint32_t rows, uint32_t cols, DType dtype, float scale = 1)
    {
        HostMatrix m(rows, cols, dtype);
        std::normal_distribution<float> normal(0, scale);
        for (uint32_t r = 0; r < rows; ++r)
            for (uint32_t c = 0; c < cols; ++c)
                m.set(r, c, normal(random_));
        return m;
    }
    std::vector<uint32_t> indices(uint32_t count, uint32_t below)
    {
        std::vector<uint32_t> v(count);
        for (uint32_t& i : v)
            i = uint32_t(random_() % below);
        return v;
    }

    Tensor input(const HostMatrix& m)
    {
        std::vector<std::byte> bytes(m.values.size() * dtype_bytes(m.dtype));
        for (size_t i = 0; i < m.values.size(); ++i) {
            const uint16_t half = float_to_half(m.values[i]);
            if (m.dtype == DType::f16)
                std::memcpy(&bytes[2 * i], &half, 2);
            else
                std::memcpy(&bytes[4 * i], &m.values[i], 4);
        }
        return graph.external(upload(bytes), m.rows, m.cols, m.dtype, "input", m.ld);
    }
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
    Tensor output(uint32_t rows, uint32_t cols, DType dtype, uint32_t ld = 0)
    {
        const uint32_t pitch = ld ? ld : round_up(cols, kRowPadding);
        std::vector<std::byte> poison(size_t(rows) * pitch * dtype_bytes(dtype), std::byte(0xff));
        return graph.external(upload(poison), rows, cols, dtype, "output", pitch);
    }

    Status compile_and_run()
    {
        SR_TRY(program_, Program::create(device_, graph));
        return program_->run();
    }
    const Plan& plan() const { return program_->plan(); }

    // runs the graph and reads y, which is copied out of the arena through a program that ends in memory of ours
    HostMatrix run(Tensor y)
    {
        const Tensor out = output(y.rows, y.cols, y.dtype, y.ld);
        redirect(y, out);
        const Status status = compile_and_run();
        EXPECT_TRUE(status) << status.error().message;
        return read(out);
    }
    HostMatrix read(const Tensor& t)
    {
        HostMatrix m(t.rows, t.cols, t.dtype);
        m.ld = t.ld;
        m.values.resize(size_t(t.rows) * t.ld);
        const std::vector<std::byte> bytes = read_bytes(t);
        for (size_t i = 0; i < m.values.size(); ++i) {
            uint16_t half = 0;
            if (t.dtype == DType::f16) {
                std::memcpy(&half, &bytes[2 * i], 2);
                m.values[i] = half_to_float(half);
            } else {
                std::memcpy(&m.values[i], &bytes[4 * i], 4);
            }
        }
        return m;
    }
    template <typename T>
    std::vector<T> read_array(const Tensor& t)
    {
        const std::vector<std::byte> bytes = read_bytes(t);
        std::vector<T> v(bytes.size() / sizeof(T));
        std::memcpy(v.data(), bytes.data(), v.size() * sizeof(T));
        return v;
    }

    void expect_zero_padding(const HostMatrix& m)
    {
        for (uint32_t r = 0; r < m.rows; ++r)
            for (uint32_t c = m.cols; c < round_up(m.cols, kRowPadding); ++c)
                ASSERT_EQ(m.values[size_t(r) * m.ld + c], 0.f) << "padding of row " << r;
    }

  private:
    BufferSlice upload(const std::vector<std::byte>& bytes)
    {
        auto buffer = Buffer::create(device_, bytes.size(), MemoryKind::device, "test");
        SR_ASSERT(bool(buffer), "{}", buffer.error().message);
        const Status written = device_.write((*buffer)->slice(), bytes);
        SR_ASSERT(bool(written), "{}", written.error().message);
        buffers_.push_back(std::move(*buffer));
        return buffers_.back()->slice();
    }
    std::vector<std::byte> read_bytes(const Tensor& t)
    {
        std::vector<std::byte> bytes(t.bytes());
        const BufferSlice& memory = graph.desc().resources[t.resource].memory;
        const Status status = device_.read(memory.part(t.offset, bytes.size()), bytes);
        EXPECT_TRUE(status) << status.error().message;
        return bytes;
    }
    void redirect(const Tensor& from, const Tensor& to) { graph.keep(from, to); }

    Device& device_;
    std::mt19937 random_;
    std::vector<std::unique_ptr<Buffer>> buffers_;
    std::unique_ptr<Program> program_;
};

} // namespace semrover
