// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/network/transformer_2d.h"

#include <cmath>
#include <functional>

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

Transformer2d::FrameBlock declare_frame_block(NetworkWeights& w, const std::string& name, const Transformer2dShape& s,
                                              std::vector<NetworkWeights::Part>& context, uint32_t& columns)
{
    const uint32_t c = s.channels;
    Transformer2d::FrameBlock b;
    b.norm_in = w.norm(name + ".norm_in", c);
    b.entry_in = w.linear({{name + ".ff_in.net.0.proj", 8 * c, 0, true}}, {.cols = c});
    b.entry_out = w.linear({{name + ".ff_in.net.2", c}}, {.cols = 4 * c, .col_heads = 1});
    b.block = declare_block(w, name, s, context, columns);
    return b;
}

Tensor normalize_rows(Graph& g, const Layer& layer, Tensor x)
{
    return layer_norm(g, x, layer.weight.in(g), layer.bias.in(g), kLayerNormEps);
}

// of the head as it is in the file
float attention_scale(const Transformer2d& t)
{
    return 1 / std::sqrt(float(t.channels) / float(t.heads));
}

FlashAttentionOptions attention_options(const Transformer2d& t, const FeatureMap& x)
{
    FlashAttentionOptions o;
    o.heads = t.heads;
    o.head_dim = t.head_dim();
    o.scale = attention_scale(t);
    o.batch = x.batch;
    o.queries = o.keys = x.pixels();
    o.query_rows = o.key_rows = x.image_rows();
    return o;
}

// among the pixels of each image
Tensor pixel_attention(Graph& g, const Transformer2d& t, const FeatureMap& x, Tensor qkv)
{
    FlashAttentionOptions o = attention_options(t, x);
    o.k_col = t.heads * t.head_dim();
    o.v_col = 2 * o.k_col;
    return flash_attention(g, qkv, qkv, o);
}

// among the frames of each pixel
Tensor pixel_frames_attention(Graph& g, const Transformer2d& t, const FeatureMap& x, uint32_t frames, Tensor qkv)
{
    FrameAttentionOptions o;
    o.heads = t.heads;
    o.head_dim = t.head_dim();
    o.scale = attention_scale(t);
    o.videos = x.batch / frames;
    o.frames = frames;
    o.image_rows = x.image_rows();
    return frame_attention(g, qkv, o);
}

// y = x + linear(geglu(linear(norm(x))))
Tensor feed_forward(Graph& g, const NetworkWeights& w, const Layer& norm, const Layer& in, const Layer& out, Tensor x)
{
    const Tensor inner = geglu(g, project(g, w, in, normalize_rows(g, norm, x)));
    return add(g, project(g, w, out, inner), x);
}

using SelfAttention = std::function<Tensor(Tensor qkv)>;

// readers: the images or videos that read a text of their own, as images
Tensor block(Graph& g, const NetworkWeights& w, const Transformer2d& t, const Transformer2d::Block& b, Tensor x,
             const FeatureMap& readers, const TextContext& context, const SelfAttention& self)
{
    const Tensor qkv = project(g, w, b.qkv, normalize_rows(g, b.norm1, x));
    const Tensor y = add(g, project(g, w, b.out, self(qkv)), x);
    FlashAttentionOptions cross = attention_options(t, readers);
    cross.keys = context.tokens;
    cross.key_rows = context.token_rows;
    cross.k_col = b.key_col;
    cross.v_col = b.value_col;
    const Tensor query = project(g, w, b.query, normalize_rows(g, b.norm2, y));
    const Tensor z = add(g, project(g, w, b.context_out, flash_attention(g, query, context.table, cross)), y);
    return feed_forward(g, w, b.norm3, b.ff_in, b.ff_out, z);
}

FeatureMap enter(Graph& g, const NetworkWeights& w, const Transformer2d& t, NormInput x)
{
    GroupNormOptions norm;
    norm.groups = t.groups;
    norm.eps = kInputNormEps;
    norm.dtype = w.precision();
    const FeatureMap h = normalize(g, t.norm, norm, x);
    return h.with(project(g, w, t.proj_in, h.data));
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
    for (uint32_t i = 0; i < s.blocks; ++i) {
        t.blocks.push_back(declare_block(w, fmt::format("{}.transformer_blocks.{}", name, i), s, context, columns));
        if (s.video)
            t.frame_blocks.push_back(
                declare_frame_block(w, fmt::format("{}.temporal_transformer_blocks.{}", name, i), s, context, columns));
    }
    if (s.video) {
        const std::string embedding = name + ".time_pos_embed";
        const NetworkWeights::LinearShape in{.cols = s.channels, .dtype = DType::f32};
        const NetworkWeights::LinearShape out{.cols = 4 * s.channels, .dtype = DType::f32};
        t.frame_in = w.linear({{embedding + ".linear_1", 4 * s.channels}}, in);
        t.frame_out = w.linear({{embedding + ".linear_2", s.channels}}, out);
        t.share = w.share({name + ".time_mixer.mix_factor"});
    }
    t.proj_out = w.linear({{name + ".proj_out", s.channels, 0, false, !s.linear_projection}}, {.cols = s.channels});
    return t;
}

FeatureMap transformer_2d(Graph& g, const NetworkWeights& w, const Transformer2d& t, NormInput x,
                          const TextContext& context)
{
    FeatureMap h = enter(g, w, t, x);
    const SelfAttention self = [&](Tensor qkv) { return pixel_attention(g, t, h, qkv); };
    for (const Transformer2d::Block& b : t.blocks)
        h.data = block(g, w, t, b, h.data, h, context, self);
    return h.with(add(g, project(g, w, t.proj_out, h.data), x.x.data));
}

FeatureMap video_transformer(Graph& g, const NetworkWeights& w, const Transformer2d& t, NormInput x,
                             const TextContext& context, const FrameEmbedding& frames)
{
    const FeatureMap h = enter(g, w, t, x), videos = frames_as_rows(h, frames.frames);
    const SelfAttention pixels = [&](Tensor qkv) { return pixel_attention(g, t, h, qkv); };
    const SelfAttention times = [&](Tensor qkv) { return pixel_frames_attention(g, t, h, frames.frames, qkv); };
    Tensor y = h.data;
    for (size_t i = 0; i < t.blocks.size(); ++i) {
        const Transformer2d::FrameBlock& f = t.frame_blocks[i];
        y = block(g, w, t, t.blocks[i], y, videos, context, pixels);
        const Tensor placed = channel_shift(g, h.with(y), {frames.table, frames.table_row, t.frame_col}).data;
        const Tensor entered = feed_forward(g, w, f.norm_in, f.entry_in, f.entry_out, placed);
        const Tensor z = block(g, w, t, f.block, entered, videos, context, times);
        y = blend(g, y, z, t.share.in(g));
    }
    return h.with(add(g, project(g, w, t.proj_out, y), x.x.data));
}

void embed_frames(Graph& g, const Transformer2d& t, Tensor numbers, Tensor frequencies, Tensor table)
{
    const auto linear = [&](const Layer& layer, Tensor x, const PartOf& part = {}) {
        return gemm(g, x, layer.weight.in(g), layer.bias.in(g), {.dtype = DType::f32, .part = part});
    };
    const Tensor waves = sinusoid(g, numbers, frequencies, true, DType::f32);
    const Tensor inner = silu(g, linear(t.frame_in, waves));
    (void)linear(t.frame_out, inner, {table, 0, t.frame_col});
}

} // namespace semrover
