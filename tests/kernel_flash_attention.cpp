// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "flash_attention.spv.h"
#include "runtime/graph/cost_model.h"
#include "tests/support/softmax_sum.h"

namespace semrover {
namespace kernel_flash_attention_test {

struct FlashCase {
    uint32_t queries, keys, heads, head_dim;
    uint32_t batch = 1;
    bool shared_keys = false; // by all images
    bool joint = false;       // q, k and v are columns of one matrix
    float spread = 1;         // of q
};

// note: no matrix here has a power of two of bytes, for which lavapipe compiles the kernel once more, in seconds.
// one of everything; odd counts; several images; tiles of 128 and 32 queries and one more; every head_dim of the models
const FlashCase kCases[] = {
    {1, 1, 1, 8},
    {70, 77, 2, 40, 2, true},
    {35, 35, 3, 8, 2, false, true},
    {129, 33, 1, 16, 1, false, false},
    {33, 64, 2, 80},
    {20, 20, 2, 160, 2, false, true},
    {50, 90, 1, 512},
    {16, 300, 1, 264},
    {150, 200, 1, 40}, // blocks of 64 keys, the last one short
    {70, 100, 1, 64, 2},
    {40, 90, 2, 160},
    {300, 200, 2, 40}, // many queries a lane of a CPU
};

constexpr uint32_t padded(uint32_t rows)
{
    return round_up(rows, kImageRowPadding);
}

FlashAttentionOptions options_of(const FlashCase& c)
{
    const uint32_t width = c.heads * c.head_dim;
    FlashAttentionOptions o;
    o.heads = c.heads;
    o.head_dim = c.head_dim;
    o.batch = c.batch;
    o.queries = c.queries;
    o.query_rows = padded(c.queries);
    o.keys = c.keys;
    o.key_rows = c.shared_keys ? 0 : padded(c.keys);
    o.q_col = c.joint ? 0 : 8;
    o.k_col = c.joint ? width : 0;
    o.v_col = o.k_col + width;
    return o;
}

// one head of one query, in double
SoftmaxSum reference(const HostMatrix& q, const HostMatrix& kv, const FlashAttentionOptions& o, uint32_t image,
                     uint32_t query, uint32_t head)
{
    const uint32_t q_row = image * o.query_rows + query, first = image * o.key_rows, at = head * o.head_dim;
    const double scale = o.scale > 0 ? o.scale : 1 / std::sqrt(double(o.head_dim));
    std::vector<double> scores(o.keys);
    double largest = -1e300;
    for (uint32_t j = 0; j < o.keys; ++j) {
        for (uint32_t d = at; d < at + o.head_dim; ++d)
            scores[j] += double(q.at(q_row, o.q_col + d)) * kv.at(first + j, o.k_col + d);
        scores[j] *= scale;
        largest = std::max(largest, scores[j]);
    }
    SoftmaxSum sum(o.head_dim);
    for (uint32_t j = 0; j < o.keys; ++j)
        sum.add(std::exp(scores[j] - largest), [&](uint32_t d) { return kv.at(first + j, o.v_col + at + d); });
    sum.finish();
    return sum;
}

// rows that belong to no image: what reads them shows
void poison_padding(HostMatrix& m, uint32_t batch, uint32_t rows, uint32_t image_rows)
{
    for (uint32_t image = 0; image < batch; ++image)
        for (uint32_t r = rows; r < image_rows; ++r)
            for (uint32_t c = 0; c < m.cols; ++c)
                m.set(image * image_rows + r, c, 3e4f);
}

struct Attended {
    HostMatrix q, kv, y;
};

Attended attend(const FlashCase& c, const FlashAttentionOptions& o, DType dtype)
{
    KernelCase k(test_device());
    const uint32_t width = c.heads * c.head_dim;
    Attended a;
    a.q = k.random(c.batch * o.query_rows, c.joint ? 3 * width : width + 16, dtype, c.spread);
    poison_padding(a.q, c.batch, c.queries, o.query_rows);
    const Tensor q = k.input(a.q);
    Tensor kv = q;
    if (c.joint) {
        a.kv = a.q;
    } else {
        a.kv = k.random(c.shared_keys ? c.keys : c.batch * o.key_rows, 2 * width + 24, dtype);
        if (!c.shared_keys)
            poison_padding(a.kv, c.batch, c.keys, o.key_rows);
        kv = k.input(a.kv);
    }
    a.y = k.run(flash_attention(k.graph, q, kv, o));
    return a;
}

void check(const FlashCase& c, const FlashAttentionOptions& o, DType dtype, double tolerance)
{
    SCOPED_TRACE(fmt::format("{} queries, {} keys, {} heads of {}, batch {} {}", c.queries, c.keys, c.heads, c.head_dim,
                             c.batch, dtype_name(dtype)));
    const Attended a = attend(c, o, dtype);
    ASSERT_EQ(a.y.rows, c.batch * o.query_rows);
    ASSERT_EQ(a.y.cols, c.heads * c.head_dim);
    const bool rounded = rounds_weights(kernel::flash_attention, c.head_dim, 160, dtype);
    for (float v : a.y.values) // padding rows too
        ASSERT_TRUE(std::isfinite(v));
    for (uint32_t image = 0; image < c.batch; ++image)
        for (uint32_t query = 0; query < c.queries; ++query)
            for (uint32_t head = 0; head < c.heads; ++head) {
                const SoftmaxSum sum = reference(a.q, a.kv, o, image, query, head);
                for (uint32_t d = 0; d < c.head_dim; ++d)
                    ASSERT_NEAR(a.y.at(image * o.query_rows + query, head * c.head_dim + d), sum.y[d],
                                tolerance + sum.tolerance(d, dtype, rounded))
                        << "image " << image << " query " << query << " head " << head << " channel " << d;
            }
}

TEST(kernel_flash_attention, matches_a_softmax_in_double)
{
    for (const FlashCase& c : kCases)
        for (DType dtype : {DType::f32, DType::f16})
            check(c, options_of(c), dtype, 3e-6);
}

TEST(kernel_flash_attention, takes_the_scale_it_is_given)
{
    const FlashCase c{40, 50, 2, 24};
    FlashAttentionOptions o = options_of(c);
    o.scale = 0.5f;
    check(c, o, DType::f32, 1e-5);
}

// scores reach 1e4, where fp32 resolves 1e-3: weights are off by as much
TEST(kernel_flash_attention, keeps_to_the_largest_scores_where_exponentials_overflow)
{
    for (uint32_t head_dim : {64, 40})
        for (DType dtype : {DType::f32, DType::f16})
            for (float spread : {30, 3000}) {
                FlashCase c{70, 200, 2, head_dim};
                c.spread = spread;
                check(c, options_of(c), dtype, 1e-2);
            }
}

TEST(kernel_flash_attention, averages_the_values_of_equal_keys)
{
    const FlashCase c{1, 64, 1, 8};
    const FlashAttentionOptions o = options_of(c);
    KernelCase k(test_device());
    const HostMatrix q = k.random(o.query_rows, 24, DType::f32);
    HostMatrix kv(64, 24, DType::f32);
    for (uint32_t r = 0; r < 64; ++r)
        for (uint32_t d = 8; d < 16; ++d)
            kv.set(r, d, float(r));
    const HostMatrix got = k.run(flash_attention(k.graph, k.input(q), k.input(kv), o));
    for (uint32_t d = 0; d < 8; ++d)
        EXPECT_EQ(got.at(0, d), 31.5f);
}

// ranges of workgroups, cut where one submit would take too long
TEST(kernel_flash_attention, gives_the_same_bits_in_parts)
{
    const FlashCase c{300, 64, 2, 16};
    const FlashAttentionOptions o = options_of(c);
    KernelCase k(test_device());
    const HostMatrix q = k.random(o.query_rows, 40, DType::f16), kv = k.random(64, 72, DType::f16);
    const Tensor y = flash_attention(k.graph, k.input(q), k.input(kv), o);
    const Tensor out = k.output(y.rows, y.cols, y.dtype);
    k.graph.keep(y, out);
    DeviceLimits limits = test_device().limits();
    limits.submit_seconds = 2 * 4.0 * 64 * 32 * 150 / 5e11;
    auto plan = make_plan(k.graph);
    ASSERT_TRUE(plan) << plan.error().message;
    stage::submits(*plan, limits, CostModel().seconds(*plan));
    EXPECT_GT(plan->submits, 1u);
    auto executable = Executable::create(test_device(), std::move(*plan));
    ASSERT_TRUE(executable) << executable.error().message;
    ASSERT_TRUE((*executable)->run());
    const HostMatrix parted = k.read(out);
    ASSERT_TRUE(k.compile_and_run());
    EXPECT_EQ(parted.values, k.read(out).values);
}

} // namespace kernel_flash_attention_test
} // namespace semrover
