// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "attention.spv.h"
#include "runtime/graph/variant.h"
#include "tests/support/attention_sets.h"
#include "tests/support/softmax_sum.h"

namespace semrover {
namespace kernel_attention_test {

constexpr int32_t kRadius2 = 9;

struct AttentionCase {
    std::vector<uint32_t> lengths; // of the sets
    uint32_t heads, head_dim, streams;
};

// one token; one-cell sets among others; a last tile of one query; sets longer than one word of the mask; every
// head_dim
const AttentionCase kCases[] = {
    {{1}, 1, 8, 1},          {{1}, 2, 16, 2},      {{1, 7, 1, 33}, 2, 8, 2}, {{49, 50, 51}, 1, 16, 1},
    {{2, 32, 65}, 3, 32, 2}, {{100, 1}, 2, 64, 2}, {{31, 40}, 2, 128, 2},    {{150}, 2, 64, 1},
};

// softmax over the keys of both streams, in double
SoftmaxSum reference(const HostMatrix& qkv, const PackedSets& p, uint32_t query, uint32_t head, uint32_t heads,
                     uint32_t head_dim)
{
    const uint32_t i = query % p.rows, first = p.sets[2 * i], count = p.sets[2 * i + 1], dim = heads * head_dim;
    std::vector<std::pair<double, uint32_t>> scores; // of the keys in sight
    double largest = -1e300;
    for (uint32_t side = 0; side < 2; ++side)
        for (uint32_t j = first; j < first + count; ++j) {
            if (!p.sees(i, j, kRadius2))
                continue;
            double score = 0;
            for (uint32_t d = head * head_dim; d < (head + 1) * head_dim; ++d)
                score += double(qkv.at(query, d)) * qkv.at(side * p.rows + j, dim + d);
            scores.emplace_back(score / std::sqrt(double(head_dim)), side * p.rows + j);
            largest = std::max(largest, scores.back().first);
        }
    SoftmaxSum sum(head_dim);
    for (const auto& [score, row] : scores)
        sum.add(std::exp(score - largest), [&](uint32_t d) { return qkv.at(row, 2 * dim + head * head_dim + d); });
    sum.finish();
    return sum;
}

HostMatrix attend(KernelCase& k, const PackedSets& p, const HostMatrix& qkv, uint32_t heads, uint32_t streams)
{
    const Tensor mask = neighbor_mask(k.graph, k.input(p.cells, 4), k.input(p.sets, 2), p.longest, {kRadius2});
    return k.run(attention(k.graph, k.input(qkv), k.input(p.tiles, 4), mask, heads, streams));
}

void check(const AttentionCase& c, DType dtype)
{
    SCOPED_TRACE(fmt::format("{} sets, {} heads of {}, {} streams {}", c.lengths.size(), c.heads, c.head_dim, c.streams,
                             dtype_name(dtype)));
    std::mt19937 random(5);
    std::vector<CellSet> sets;
    for (uint32_t length : c.lengths)
        sets.push_back(random_set(random, length, length > 1));
    const PackedSets p(sets);
    KernelCase k(test_device());
    const HostMatrix qkv = k.random(2 * p.rows, 3 * c.heads * c.head_dim, dtype);
    const HostMatrix got = attend(k, p, qkv, c.heads, c.streams);
    ASSERT_EQ(got.rows, c.streams * p.rows);
    const bool rounded = rounds_weights(kernel::attention, c.head_dim, 128, dtype);
    for (uint32_t query = 0; query < got.rows; ++query)
        for (uint32_t head = 0; head < c.heads; ++head) {
            const SoftmaxSum sum = reference(qkv, p, query, head, c.heads, c.head_dim);
            for (uint32_t d = 0; d < c.head_dim; ++d)
                ASSERT_NEAR(got.at(query, head * c.head_dim + d), sum.y[d], 3e-6 + sum.tolerance(d, dtype, rounded))
                    << "query " << query << " head " << head;
        }
}

TEST(kernel_attention, matches_a_softmax_in_double_over_the_cells_in_sight)
{
    for (const AttentionCase& c : kCases)
        for (DType dtype : {DType::f32, DType::f16})
            check(c, dtype);
}

TEST(kernel_attention, returns_the_mean_of_both_streams_values_for_a_token_that_only_sees_itself)
{
    KernelCase k(test_device());
    const PackedSets p({{{0, 0, 0}, {500, 0, 0}}});
    HostMatrix qkv = k.random(4, 3 * 16, DType::f32);
    for (uint32_t row : {1u, 3u})
        for (uint32_t d = 0; d < 16; ++d)
            qkv.set(row, 16 + d, 0); // keys of zero weigh the same
    const HostMatrix got = attend(k, p, qkv, 1, 2);
    for (uint32_t row : {1u, 3u})
        for (uint32_t d = 0; d < 16; ++d)
            EXPECT_EQ(got.at(row, d), (qkv.at(1, 32 + d) + qkv.at(3, 32 + d)) / 2);
}

TEST(kernel_attention, stays_finite_for_scores_that_overflow_an_exponential)
{
    KernelCase k(test_device());
    const PackedSets p({CellSet(20, Cell{0, 0, 0})});
    const HostMatrix qkv = k.random(2 * p.rows, 3 * 32, DType::f32, 300);
    const HostMatrix got = attend(k, p, qkv, 1, 2);
    for (float v : got.values) // scores reach 1e6, where fp32 resolves 0.06: nothing to compare with
        ASSERT_TRUE(std::isfinite(v));
}

// rows of qkv that belong to one set, in both streams, taken out of a packing
HostMatrix rows_of_set(const HostMatrix& qkv, const PackedSets& p, uint32_t set)
{
    const auto [first, count] = p.spans[set];
    HostMatrix out(2 * count, qkv.cols, qkv.dtype);
    for (uint32_t side = 0; side < 2; ++side)
        for (uint32_t r = 0; r < count; ++r)
            for (uint32_t c = 0; c < qkv.cols; ++c)
                out.set(side * count + r, c, qkv.at(side * p.rows + first + r, c));
    return out;
}

TEST(kernel_attention, gives_a_set_the_same_bits_whatever_it_is_packed_with)
{
    for (DType dtype : {DType::f32, DType::f16}) {
        std::mt19937 random(9);
        std::vector<CellSet> sets;
        for (uint32_t length : {5u, 37u, 1u, 90u})
            sets.push_back(random_set(random, length, length > 1));
        const PackedSets packed(sets);
        KernelCase together(test_device());
        const HostMatrix qkv = together.random(2 * packed.rows, 3 * 2 * 32, dtype);
        const HostMatrix all = attend(together, packed, qkv, 2, 2);
        for (uint32_t s = 0; s < sets.size(); ++s) {
            const PackedSets single({sets[s]});
            KernelCase alone(test_device());
            const HostMatrix one = attend(alone, single, rows_of_set(qkv, packed, s), 2, 2);
            for (uint32_t side = 0; side < 2; ++side)
                for (uint32_t r = 0; r < single.rows; ++r)
                    for (uint32_t c = 0; c < one.cols; ++c)
                        ASSERT_EQ(one.at(side * single.rows + r, c),
                                  all.at(side * packed.rows + packed.spans[s][0] + r, c))
                            << "set " << s << " row " << r << " column " << c;
        }
    }
}

// 16 keys of kChunks * 8 + 4 floats, and 32 queries' weights: 18,816 bytes at head_dim 256, 10,624 at 128
TEST(kernel_attention, needs_the_shared_memory_of_its_head_dim)
{
    DeviceLimits limits;
    limits.type = DeviceType::discrete;
    for (const auto& [head_dim, shared, expected] :
         {std::tuple{128u, 10624u, "simt"}, {128u, 10623u, "cpu"}, {256u, 18816u, "simt"}, {256u, 16384u, "cpu"}}) {
        limits.max_shared_bytes = shared;
        const ConstantValue chunks[] = {{"kChunks", head_dim / 8}};
        EXPECT_EQ(choose_variant(kernel::attention, limits, chunks)->name, expected) << head_dim << " " << shared;
    }
}

} // namespace kernel_attention_test
} // namespace semrover
