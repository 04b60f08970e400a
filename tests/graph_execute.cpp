// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "tests/support/kernel_case.h"
#include "tests/support/random_graph.h"

namespace semrover {
namespace graph_execute_test {

using Bytes = std::vector<std::byte>;

// external memory that starts with the same numbers every time it is filled
class ExternalMemory {
  public:
    Tensor add(Graph& g, uint32_t rows, uint32_t cols, DType dtype = DType::f32)
    {
        if (next_ == buffers_.size())
            allocate(uint64_t(rows) * round_up(cols, kRowPadding) * dtype_bytes(dtype), dtype);
        return g.external(buffers_[next_++]->slice(), rows, cols, dtype, "external");
    }
    void again() { next_ = 0; } // the same memory for another graph that asks for the same
    void allocate(uint64_t bytes, DType dtype)
    {
        auto buffer = Buffer::create(test_device(), bytes, MemoryKind::device, "test");
        SR_ASSERT(bool(buffer), "{}", buffer.error().message);
        buffers_.push_back(std::move(*buffer));
        dtypes_.push_back(dtype);
    }
    void fill()
    {
        std::mt19937 random(4);
        std::normal_distribution<float> normal(0, 0.2f);
        for (size_t i = 0; i < buffers_.size(); ++i) {
            Bytes bytes(buffers_[i]->bytes());
            for (size_t at = 0; at < bytes.size(); at += dtype_bytes(dtypes_[i])) {
                const float v = normal(random);
                const uint16_t half = float_to_half(v);
                if (dtypes_[i] == DType::f16)
                    std::memcpy(&bytes[at], &half, 2);
                else
                    std::memcpy(&bytes[at], &v, 4);
            }
            const Status written = test_device().write(buffers_[i]->slice(), bytes);
            ASSERT_TRUE(written) << written.error().message;
        }
    }
    Bytes contents() // of all of it, what was read only included
    {
        Bytes all;
        for (const auto& buffer : buffers_) {
            Bytes bytes(buffer->bytes());
            const Status read = test_device().read(buffer->slice(), bytes);
            EXPECT_TRUE(read) << read.error().message;
            all.insert(all.end(), bytes.begin(), bytes.end());
        }
        return all;
    }

  private:
    std::vector<std::unique_ptr<Buffer>> buffers_;
    std::vector<DType> dtypes_;
    size_t next_ = 0;
};

Plan plan_of(const Graph& g)
{
    auto plan = make_plan(g);
    SR_ASSERT(bool(plan), "{}", plan.error().message);
    return *plan;
}

Plan random_plan(ExternalMemory& memory, uint32_t seed, const DeviceLimits& limits)
{
    memory.again();
    Graph g(limits);
    const RandomGraph made(g, seed, [&](uint32_t rows, uint32_t cols) { return memory.add(g, rows, cols); });
    return plan_of(g);
}

Bytes run(ExternalMemory& memory, Plan plan, int times = 1)
{
    memory.fill();
    auto executable = Executable::create(test_device(), std::move(plan));
    EXPECT_TRUE(executable) << executable.error().message;
    for (int i = 0; executable && i < times; ++i) {
        const Status status = (*executable)->run();
        EXPECT_TRUE(status) << status.error().message;
    }
    return memory.contents();
}

// no memory shared, no pass beside another: what the graph means
Plan one_after_the_other(Plan plan)
{
    plan.blocks.clear();
    for (size_t r = 0; r < plan.resources.size(); ++r) {
        plan.placements[r].block = uint32_t(plan.blocks.size());
        plan.placements[r].offset = 0;
        plan.blocks.push_back(std::max<uint64_t>(plan.resources[r].bytes, 256));
    }
    for (uint32_t i = 0; i < plan.passes.size(); ++i)
        plan.dispatches[i].submit = plan.passes[i].level = i;
    plan.submits = plan.levels = uint32_t(plan.passes.size());
    return plan;
}

TEST(graph_execute, gives_the_same_bytes_as_one_pass_per_submit_without_aliasing)
{
    for (uint32_t seed = 0; seed < 30; ++seed) {
        SCOPED_TRACE(seed);
        ExternalMemory memory;
        DeviceLimits limits = test_device().limits();
        for (bool side_by_side : {false, true}) {
            limits.side_by_side = side_by_side;
            const Plan plan = random_plan(memory, seed, limits);
            EXPECT_LT(plan.levels, plan.passes.size() + 1);
            ASSERT_TRUE(run(memory, plan) == run(memory, one_after_the_other(plan)));
        }
    }
}

TEST(graph_execute, gives_the_same_bytes_in_bands_in_parts_and_in_folded_groups)
{
    DeviceLimits limits = test_device().limits();
    limits.max_storage_range = 16384;
    limits.max_texel_elements = 1024;
    limits.submit_seconds = 1e-7;
    limits.max_groups = 5;
    uint32_t submits = 0, bands = 0, parts = 0;
    for (uint32_t seed = 100; seed < 115; ++seed) {
        SCOPED_TRACE(seed);
        ExternalMemory memory;
        const Plan cut = random_plan(memory, seed, limits), whole = random_plan(memory, seed, test_device().limits());
        submits += cut.submits - 1;
        bands += uint32_t(cut.passes.size() - whole.passes.size());
        parts += uint32_t(cut.dispatches.size() - cut.passes.size());
        ASSERT_TRUE(run(memory, whole) == run(memory, cut));
    }
    EXPECT_GT(submits, 100u);
    EXPECT_GT(bands, 5u);
    EXPECT_GT(parts, 100u);
}

Plan fused_product(ExternalMemory& memory, DType dtype, const DeviceLimits& limits)
{
    memory.again();
    Graph g(limits);
    const uint32_t rows = 333;
    const Tensor x = memory.add(g, rows, 72, dtype), w = memory.add(g, 65, 72, dtype), bias = memory.add(g, 1, 65);
    const Tensor residual = memory.add(g, rows, 65, dtype), out = memory.add(g, rows, 65, dtype);
    const Tensor y = gelu(g, gemm(g, x, w, bias, {.dtype = dtype}));
    g.keep(add(g, y, residual), out);
    return plan_of(g);
}

TEST(graph_execute, slices_a_gemm_without_changing_a_bit)
{
    DeviceLimits limits = test_device().limits();
    limits.max_storage_range = 32768;
    limits.max_texel_elements = 32768 / 16;
    for (DType dtype : {DType::f32, DType::f16}) {
        ExternalMemory memory;
        const Plan whole = fused_product(memory, dtype, test_device().limits()),
                   cut = fused_product(memory, dtype, limits);
        ASSERT_EQ(whole.passes.size(), 1u);
        ASSERT_GT(cut.passes.size(), 1u);
        ASSERT_TRUE(run(memory, whole) == run(memory, cut));
    }
}

TEST(graph_execute, replays_a_program_with_the_same_bytes)
{
    ExternalMemory memory;
    Graph g(test_device().limits());
    Tensor t = memory.add(g, 64, 64);
    const Tensor w = memory.add(g, 64, 64), out = memory.add(g, 64, 64);
    for (int i = 0; i < 4; ++i)
        t = add(g, gelu(g, gemm(g, t, w, {}, {.dtype = DType::f32})), t);
    add(g, t, t, {out});
    memory.fill();
    auto executable = Executable::create(test_device(), g);
    ASSERT_TRUE(executable) << executable.error().message;
    Bytes first;
    for (int i = 0; i < 20; ++i) {
        ASSERT_TRUE((*executable)->run());
        const Bytes now = memory.contents();
        if (first.empty())
            first = now;
        ASSERT_TRUE(first == now) << "run " << i;
    }
}

// the first run is timed, and the others have submits of what it took
TEST(graph_execute, cuts_submits_anew_after_the_first_run)
{
    auto device = Device::create({.limits = "submit=0.0005"});
    ASSERT_TRUE(device) << device.error().message;
    std::vector<float> numbers(256 * 256);
    for (size_t i = 0; i < numbers.size(); ++i)
        numbers[i] = float(i % 17) / 64 - 0.1f;
    const uint64_t bytes = numbers.size() * sizeof(float);
    auto x = Buffer::create(**device, bytes, MemoryKind::device, "x");
    auto y = Buffer::create(**device, bytes, MemoryKind::device, "y");
    ASSERT_TRUE(x && y);
    ASSERT_TRUE((*device)->write((*x)->slice(), std::as_bytes(std::span(numbers))));
    Graph g((*device)->limits());
    const Tensor w = g.external((*x)->slice(), 256, 256, DType::f32, "x");
    Tensor t = w;
    for (int i = 0; i < 4; ++i)
        t = gemm(g, t, w, {}, {.dtype = DType::f32}); // 0.07 ms each, as estimated
    g.keep(t, g.external((*y)->slice(), 256, 256, DType::f32, "y"));
    auto executable = Executable::create(**device, g);
    ASSERT_TRUE(executable) << executable.error().message;
    EXPECT_EQ((*executable)->plan().submits, 1u);
    std::vector<float> first(numbers.size()), now(numbers.size());
    ASSERT_TRUE((*executable)->run());
    ASSERT_TRUE((*device)->read((*y)->slice(), std::as_writable_bytes(std::span(first))));
    for (int i = 0; i < 3; ++i) {
        ASSERT_TRUE((*executable)->run());
        ASSERT_TRUE((*device)->read((*y)->slice(), std::as_writable_bytes(std::span(now))));
        EXPECT_TRUE(first == now) << i;
    }
    if ((*device)->limits().type == DeviceType::cpu) { // far slower than that
        EXPECT_GT((*executable)->plan().submits, 1u);
        auto next = Executable::create(**device, g);
        ASSERT_TRUE(next) << next.error().message;
        EXPECT_GT((*next)->plan().submits, 1u); // it has learned
    }
}

TEST(graph_execute, keeps_runs_in_order_that_nobody_waits_for)
{
    ExternalMemory memory;
    Graph g(test_device().limits());
    const Tensor x = memory.add(g, 8, 64), sum = memory.add(g, 8, 64);
    add(g, sum, x, {sum}); // each run reads what the last one wrote
    memory.fill();
    const Plan plan = plan_of(g);
    auto executable = Executable::create(test_device(), plan);
    ASSERT_TRUE(executable) << executable.error().message;
    for (int i = 0; i < 50; ++i)
        ASSERT_TRUE((*executable)->submit());
    ASSERT_TRUE(test_device().wait(test_device().last_ticket()));
    const Bytes queued = memory.contents();
    EXPECT_TRUE(queued == run(memory, plan, 50));
}

TEST(graph_execute, uses_exactly_the_memory_that_the_plan_predicts)
{
    for (uint32_t seed = 300; seed < 310; ++seed) {
        ExternalMemory memory;
        const Plan plan = random_plan(memory, seed, test_device().limits());
        const uint64_t before = test_device().allocated_bytes();
        test_device().reset_peak();
        auto executable = Executable::create(test_device(), plan);
        ASSERT_TRUE(executable) << executable.error().message;
        EXPECT_EQ(test_device().peak_bytes() - before, plan.arena_bytes());
        executable->reset();
        EXPECT_EQ(test_device().allocated_bytes(), before);
    }
}

} // namespace graph_execute_test
} // namespace semrover
