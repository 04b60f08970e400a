// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/support/kernel_case.h"

namespace semrover {

namespace {

// gone before main() ends: validation layers of Debian 13 fail where a device lives as long as the process
class TestDevice : public testing::Environment {
  public:
    Device& get()
    {
        if (!device_) {
            auto made = Device::create({});
            if (!made) {
                ADD_FAILURE() << made.error().message;
                std::abort();
            }
            device_ = std::move(*made);
        }
        return *device_;
    }
    void TearDown() override { device_.reset(); }

  private:
    std::unique_ptr<Device> device_;
};

TestDevice* const kTestDevice = [] {
    auto* device = new TestDevice();
    testing::AddGlobalTestEnvironment(device);
    return device;
}();

} // namespace

Device& test_device()
{
    return kTestDevice->get();
}

// any int8, and scales of either sign
HostMatrix KernelCase::random_blocks(uint32_t rows, uint32_t cols, float scale)
{
    HostMatrix m(rows, cols, DType::q8_0);
    const size_t row_bytes = (cols + cols / 16 + 15) / 16 * 16;
    m.blocks.resize(rows * row_bytes);
    for (uint32_t r = 0; r < rows; ++r)
        for (uint32_t c = 0; c < cols; ++c) {
            std::byte* row = &m.blocks[r * row_bytes];
            if (c % 32 == 0) {
                const uint16_t half = float_to_half((float(random_() % 2001) - 1000) * scale / 64000);
                std::memcpy(row + cols + c / 16, &half, 2);
            }
            uint16_t half = 0;
            std::memcpy(&half, row + cols + c / 32 * 2, 2);
            const int8_t q = int8_t(random_() % 256);
            row[c] = std::byte(q);
            m.values[size_t(r) * m.ld + c] = float(q) * half_to_float(half);
        }
    return m;
}

HostMatrix KernelCase::random(uint32_t rows, uint32_t cols, DType dtype, float scale)
{
    if (dtype == DType::q8_0)
        return random_blocks(rows, cols, scale);
    HostMatrix m(rows, cols, dtype);
    std::normal_distribution<float> normal(0, scale);
    for (uint32_t r = 0; r < rows; ++r)
        for (uint32_t c = 0; c < cols; ++c)
            m.set(r, c, normal(random_));
    return m;
}

std::vector<uint32_t> KernelCase::indices(uint32_t count, uint32_t below)
{
    std::vector<uint32_t> v(count);
    for (uint32_t& i : v)
        i = uint32_t(random_() % below);
    return v;
}

Tensor KernelCase::input(const HostMatrix& m)
{
    if (m.dtype == DType::q8_0)
        return graph.external(upload(m.blocks), m.rows, m.cols, m.dtype, "input", m.ld);
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

Tensor KernelCase::output(uint32_t rows, uint32_t cols, DType dtype, uint32_t ld)
{
    const uint32_t pitch = ld ? ld : round_up(cols, kRowPadding);
    std::vector<std::byte> poison(size_t(rows) * pitch * dtype_bytes(dtype), std::byte(0xff));
    return graph.external(upload(poison), rows, cols, dtype, "output", pitch);
}

Status KernelCase::compile_and_run()
{
    SR_TRY(executable_, Executable::create(device_, graph));
    return executable_->run();
}

HostMatrix KernelCase::run(Tensor y)
{
    const Tensor out = output(y.rows, y.cols, y.dtype, y.ld);
    graph.keep(y, out);
    const Status status = compile_and_run();
    EXPECT_TRUE(status) << status.error().message;
    return read(out);
}

HostMatrix KernelCase::read(const Tensor& t)
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

void KernelCase::expect_zero_padding(const HostMatrix& m)
{
    for (uint32_t r = 0; r < m.rows; ++r)
        for (uint32_t c = m.cols; c < round_up(m.cols, kRowPadding); ++c)
            ASSERT_EQ(m.values[size_t(r) * m.ld + c], 0.f) << "padding of row " << r;
}

BufferSlice KernelCase::upload(const std::vector<std::byte>& bytes)
{
    auto buffer = Buffer::create(device_, bytes.size(), MemoryKind::device, "test");
    SR_ASSERT(bool(buffer), "{}", buffer.error().message);
    const Status written = device_.write((*buffer)->slice(), bytes);
    SR_ASSERT(bool(written), "{}", written.error().message);
    buffers_.push_back(std::move(*buffer));
    return buffers_.back()->slice();
}

std::vector<std::byte> KernelCase::read_bytes(const Tensor& t)
{
    std::vector<std::byte> bytes(t.bytes());
    const BufferSlice& memory = graph.resources()[t.resource].memory;
    const Status status = device_.read(memory.part(t.offset, bytes.size()), bytes);
    EXPECT_TRUE(status) << status.error().message;
    return bytes;
}

} // namespace semrover
