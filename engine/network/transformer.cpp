// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/network/transformer.h"

#include <cmath>

namespace semrover {

namespace {

constexpr float kNormEps = 1e-6f;
constexpr uint32_t kTimeFrequencies = 128; // 256 sinusoids, cosines first
// columns of a block start at multiples of 64 floats: a view of the table must be aligned to 256 bytes
constexpr uint32_t kColumnAlignment = 64;

} // namespace

Transformer::Transformer(const TransformerConfig& config, DType precision)
    : config_(config), precision_(precision), weights_(config, precision)
{
    uint32_t column = 0;
    for (uint32_t i = 0; i < config.num_layers; ++i) {
        block_columns_.push_back(column);
        column = round_up(column + (i + 1 < config.num_layers ? 12 : 8) * config.dim(), kColumnAlignment);
    }
    block_columns_.push_back(column);
    modulation_width_ = column + 2 * config.dim();
    position_frequencies_ = constants_.add(config.pos_embed_dim / 2 * 4);
    time_frequencies_ = constants_.add(kTimeFrequencies * 4);
}

Result<std::unique_ptr<Transformer>> Transformer::load(Device& device, const Path& folder, DType precision)
{
    SR_TRY(const TransformerConfig config, read_transformer_config(folder));
    SR_TRY(const SafetensorsSet file, SafetensorsSet::open_folder(folder));
    std::unique_ptr<Transformer> t(new Transformer(config, precision));
    SR_CHECK(t->weights_.load(device, file));
    SR_CHECK(t->upload_frequencies(device));
    return t;
}

Result<std::unique_ptr<Transformer>> Transformer::random(Device& device, const TransformerConfig& config,
                                                         DType precision)
{
    std::unique_ptr<Transformer> t(new Transformer(config, precision));
    SR_CHECK(t->weights_.randomize(device, 1));
    SR_CHECK(t->upload_frequencies(device));
    return t;
}

uint64_t Transformer::device_bytes(const DeviceLimits& limits) const
{
    return weights_.device_bytes(limits) + constants_.planned_bytes(limits);
}

// w_i = 10000^(-i / n), in double, rounded once
Status Transformer::upload_frequencies(Device& device)
{
    SR_CHECK(constants_.allocate(device, "frequencies"));
    for (const auto& [slice, n] : {std::pair{position_frequencies_, config_.pos_embed_dim / 2},
                                   std::pair{time_frequencies_, kTimeFrequencies}}) {
        std::vector<float> w(n);
        for (uint32_t i = 0; i < n; ++i)
            w[i] = float(std::exp(-std::log(10000.0) * i / n));
        SR_CHECK(device.write(constants_.slice(slice), std::as_bytes(std::span(w))));
    }
    return {};
}

Tensor Transformer::frequencies(Graph& g, uint32_t slice, uint32_t count) const
{
    return g.external(constants_.slice(slice), count, 1, DType::f32, "frequencies", 1);
}

void Transformer::prepare(Graph& g, const TokenContext& context) const
{
    neighbor_mask(g, context.cells, context.sets, context.longest, config_.radius2(), context.mask);
    embed_positions(g, context);
}

void Transformer::embed_positions(Graph& g, const TokenContext& context) const
{
    const auto weight = [&](const Weight& w, const char* name) { return weights_.tensor(g, w, name); };
    const Tensor angles = frequencies(g, position_frequencies_, config_.pos_embed_dim / 2);
    const Tensor waves = sinusoid(g, context.coords, angles, false, precision_); // [M, 3P]
    (void)gemm(g, waves, weight(weights_.pos_embed, "pos_embed"), weight(weights_.pos_embed_bias, "pos_embed.bias"),
               {.dtype = context.pos.dtype, .into = context.pos});
}

void Transformer::modulations(Graph& g, Tensor timesteps, Tensor table) const
{
    const auto weight = [&](const Weight& w, const char* name) { return weights_.tensor(g, w, name); };
    const Tensor waves =
        sinusoid(g, timesteps, frequencies(g, time_frequencies_, kTimeFrequencies), true, DType::f32); // [T, 256]
    const Tensor hidden = silu(g, gemm(g, waves, weight(weights_.time_in, "time_in"),
                                       weight(weights_.time_in_bias, "time_in.bias"), {.dtype = DType::f32})); // [T, D]
    const Tensor temb =
        silu(g, gemm(g, hidden, weight(weights_.time_out, "time_out"), weight(weights_.time_out_bias, "time_out.bias"),
                     {.dtype = precision_})); // [T, D], after the SiLU that every adaLN begins with
    const auto project = [&](const Weight& w, const Weight& bias, uint32_t column) {
        (void)gemm(g, temb, weight(w, "modulation"), weight(bias, "modulation.bias"),
                   {.dtype = DType::f32, .into = table.col_range(column, w.rows)});
    };
    for (size_t i = 0; i < weights_.blocks.size(); ++i)
        project(weights_.blocks[i].modulation, weights_.blocks[i].modulation_bias, block_columns_[i]);
    project(weights_.norm_out, weights_.norm_out_bias, block_columns_.back());
}

// x: [2M, D], voxel stream then semantic stream; the last block returns the voxel stream alone, [M, D]
Tensor Transformer::block(Graph& g, uint32_t index, Tensor x, const TokenContext& context, Tensor table,
                          Tensor table_row) const
{
    const BlockWeights& w = weights_.blocks[index];
    const uint32_t d = config_.dim(), streams = weights_.streams(index), rows = x.rows / 2;
    const uint32_t column = block_columns_[index], step = 6 * d; // per stream: shift, scale, gate; shift, scale, gate
    const auto weight = [&](const Weight& v, const char* name) { return weights_.tensor(g, v, name); };
    const auto modulation = [&](uint32_t part, Tensor like) {
        return Modulation{table, table_row.row_range(0, like.rows), column + part * d, step};
    };
    const Tensor h = modulate(g, x, modulation(0, x), column + d, kNormEps, 2);
    Tensor qkv = gemm(g, h, weight(w.qkv, "qkv"), weight(w.qkv_bias, "qkv.bias"),
                      {.groups = 2, .dtype = precision_}); // [2M, 3D]
    if (config_.qk_norm)
        qkv = head_rms_norm(g, qkv, weight(w.head_norms, "head_norms"), config_.num_attention_heads, kNormEps, 2);
    const Tensor seen =
        attention(g, qkv, context.tiles, context.mask, config_.num_attention_heads, streams); // [streams * M, D]
    const Tensor mixed =
        gemm(g, seen, weight(w.out, "out"), weight(w.out_bias, "out.bias"), {.groups = streams, .dtype = precision_});
    const Tensor residual = streams == 2 ? x : x.row_range(0, rows);
    const Tensor y = gated_add(g, mixed, modulation(2, residual), residual, streams);
    const Tensor n = modulate(g, y, modulation(3, y), column + 4 * d, kNormEps, streams);
    const Tensor inner = gelu(g, gemm(g, n, weight(w.ff_in, "ff_in"), weight(w.ff_in_bias, "ff_in.bias"),
                                      {.groups = streams, .dtype = precision_}));
    const Tensor outer = gemm(g, inner, weight(w.ff_out, "ff_out"), weight(w.ff_out_bias, "ff_out.bias"),
                              {.groups = streams, .dtype = precision_});
    return gated_add(g, outer, modulation(5, y), y, streams);
}

Tensor Transformer::forward(Graph& g, Tensor tokens, const TokenContext& context, Tensor table, Tensor table_row) const
{
    const auto weight = [&](const Weight& w, const char* name) { return weights_.tensor(g, w, name); };
    const uint32_t rows = tokens.rows;
    Tensor x = g.matrix(2 * rows, config_.dim(), precision_, "tokens");
    const Tensor embedded = gemm(g, tokens, weight(weights_.proj_in, "proj_in"),
                                 weight(weights_.proj_in_bias, "proj_in.bias"), {.dtype = precision_});
    add(g, embedded, context.pos, x.row_range(0, rows));
    embedding(g, context.labels, weight(weights_.semantic_embed, "semantic_embed"),
              config_.context_pos_embed ? context.pos : Tensor{}, precision_, x.row_range(rows, rows));
    for (uint32_t i = 0; i < config_.num_layers; ++i)
        x = block(g, i, x, context, table, table_row);
    const uint32_t column = block_columns_.back();
    const Tensor n =
        modulate(g, x, {table, table_row.row_range(0, rows), column, 0}, column + config_.dim(), kNormEps, 1);
    return gemm(g, n, weight(weights_.proj_out, "proj_out"), weight(weights_.proj_out_bias, "proj_out.bias"),
                {.dtype = DType::f32});
}

} // namespace semrover
