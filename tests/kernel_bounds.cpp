// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
// files decide what shaders read: an index beyond a tensor does not leave it
#include "beyond.spv.h"
#include "tests/shaders/beyond.h"
#include "tests/support/kernel_case.h"

#include <algorithm>

namespace semrover {
namespace kernel_bounds_test {

// Vulkan allows more of a driver: anything of the same buffer. Those that we know go by what is bound.
TEST(kernel_bounds, what_lies_behind_a_tensor_in_its_buffer_is_neither_read_nor_written)
{
    const BeyondPush push{.count = 4096};
    const std::vector<uint32_t> sevens(2 * push.count, 7);
    const auto buffer = Buffer::create(test_device(), sevens.size() * 4, MemoryKind::device, "test");
    ASSERT_TRUE(buffer) << buffer.error().message;
    const BufferSlice whole = (*buffer)->slice();
    ASSERT_TRUE(test_device().write(whole, std::as_bytes(std::span(sevens))));

    KernelCase k(test_device());
    const Tensor x = k.graph.external(whole.part(0, push.count * 4), push.count, 1, DType::u32, "x", 1);
    const Tensor y = k.output(push.count, 1, DType::u32, 1);
    k.graph.dispatch(kernel::beyond, {{"X", x}, {"Y", y}}, push, threads(push.count), {});
    const Status status = k.compile_and_run();
    ASSERT_TRUE(status) << status.error().message;

    EXPECT_EQ(std::ranges::count(k.read_array<uint32_t>(y), 0u), push.count);
    std::vector<uint32_t> after(sevens.size());
    ASSERT_TRUE(test_device().read(whole, std::as_writable_bytes(std::span(after))));
    EXPECT_EQ(after, sevens);
}

} // namespace kernel_bounds_test
} // namespace semrover
