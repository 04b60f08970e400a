// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/network/transformer_2d.h"

#include <cmath>

namespace semrover {

namespace {

constexpr float kInputNormEps = 1e-6f; // of the group norm in front; the layer norms have 1e-5
constexpr float kLayerNormEps = 1e-5f;

Transformer2d::Block declare_block(NetworkWeights& w, const std::string& name, const Transformer2dShape& s,
                                   std::vector<NetworkWeights::Part>& context, uint32_t& columns)
{
    const uint32_t c = s.channels;
    const auto heads = [&](const char* part) { return NetworkWeights::Part{name + part, c, s.heads}; };
    Transformer2d::Block b;
    b.norm1 = w.norm(name + ".norm1", c);
    b.norm2 = w.norm(name + ".norm2", c);
    b.norm3 = w.norm(name + ".norm3", c);
    b.qkv = w.linear({heads(".attn1.to_q"), heads(".attn1.to_k"), heads(".attn1.to_v")}, {.cols = c, .bias = false});
    b.out = w.linear({{name + ".attn1.to_out.0", c}}, {.cols = c, .col_heads = s.heads});
    b.query = w.linear({heads(".attn2.to_q")}, {.cols = c, .bias = false});
    b.context_out = w.linear({{name + ".attn2.to_out.0", c}}, {.cols = c, .col_heads = s.heads});
    b.key_col = columns;
    b.value_col = columns + padded_heads(c, s.heads);
    columns += 2 * padded_heads(c, s.heads);
    context.push_back(heads(".attn2.to_k"));
    context.push_back(heads(".attn2.to_v"));
    b.ff_in = w.linear({{name + ".ff.net.0.proj", 8 * c, 0, true}}, {.cols = c});
    b.ff_out = w.linear({{name + ".ff.net.2", c}}, {.cols = 4 * c, .col_heads = 1});
    return b;
}

FlashAttentionOptions attention_options(const Transformer2d& t, const FeatureMap& x)
{
    FlashAttentionOptions o;
    o.heads = t.heads;
    o.head_dim = t.head_dim();
    o.scale = 1 / std::sqrt(float(t.channels) / float(t.heads)); // of the head as it is in the file
    o.batch = x.batch;
    o.queries = o.keys = x.pixels();
    o.query_rows = o.key_rows = x.image_rows();
    return o;
}

Tensor block(Graph& g, const NetworkWeights& w, const Transformer2d& t, const Transformer2d::Block& b,
             const FeatureMap& x, const TextContext& context)
{
    const auto norm = [&](const Layer& layer, Tensor v) {
        return layer_norm(g, v, layer.weight.in(g), layer.bias.in(g), kLayerNormEps);
    };
    const uint32_t d = t.heads * t.head_dim();
    FlashAttentionOptions self = attention_options(t, x);
    self.k_col = d;
    self.v_col = 2 * d;
    const Tensor qkv = project(g, w, b.qkv, norm(b.norm1, x.data));
    const Tensor y = add(g, project(g, w, b.out, flash_attention(g, qkv, qkv, self)), x.data);
    FlashAttentionOptions cross = attention_options(t, x);
    cross.keys = context.tokens;
    cross.key_rows = context.token_rows;
    cross.k_col = b.key_col;
    cross.v_col = b.value_col;
    const Tensor query = project(g, w, b.query, norm(b.norm2, y));
    const Tensor z = add(g, project(g, w, b.context_out, flash_attention(g, query, context.table, cross)), y);
    const Tensor inner = geglu(g, project(g, w, b.ff_in, norm(b.norm3, z)));
    return add(g, project(g, w, b.ff_out, inner), z);
}

} // namespace

Transformer2d declare_transformer_2d(NetworkWeights& w, const std::string& name, const Transformer2dShape& s,
                                     std::vector<NetworkWeights::Part>& context, uint32_t& columns)
{
    Transformer2d t;
    t.channels = s.channels;
    t.heads = s.heads;
    t.groups = s.groups;
    t.norm = w.norm(name + ".norm", s.channels);
    t.proj_in = w.linear({{name + ".proj_in", s.channels, 0, false, !s.linear_projection}}, {.cols = s.channels});
    for (uint32_t i = 0; i < s.blocks; ++i)
        t.blocks.push_back(declare_block(w, fmt::format("{}.transformer_blocks.{}", name, i), s, context, columns));
    t.proj_out = w.linear({{name + ".proj_out", s.channels, 0, false, !s.linear_projection}}, {.cols = s.channels});
    return t;
}

FeatureMap transformer_2d(Graph& g, const NetworkWeights& w, const Transformer2d& t, NormInput x,
                          const TextContext& context)
{
    GroupNormOptions norm;
    norm.groups = t.groups;
    norm.eps = kInputNormEps;
    norm.dtype = w.precision();
    FeatureMap h = normalize(g, t.norm, norm, x);
    h.data = project(g, w, t.proj_in, h.data);
    for (const Transformer2d::Block& b : t.blocks)
        h.data = block(g, w, t, b, h, context);
    return h.with(add(g, project(g, w, t.proj_out, h.data), x.x.data));
}

} // namespace semrover
