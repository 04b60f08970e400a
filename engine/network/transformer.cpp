// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/network/transformer.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

constexpr float kNormEps = 1e-6f;
constexpr uint32_t kTimeFrequencies = 128; // 256 sinusoids, cosines first
// columns of a block start at multiples of 64 floats: a view of the table must be aligned to 256 bytes
constexpr uint32_t kColumnAlignment = 64;

} // namespace

void TokenSets::add(std::span<const CellIndex> set_cells, std::span<const uint32_t> set_labels)
{
    SR_ASSERT(!set_cells.empty() && set_cells.size() == set_labels.size(), "a set of {} voxels with {} labels",
              set_cells.size(), set_labels.size());
    const uint32_t first = rows(), count = uint32_t(set_cells.size());
    double mean[3] = {};
    for (const CellIndex& c : set_cells)
        for (int a = 0; a < 3; ++a)
            mean[a] += double(c[a]) / count;
    for (uint32_t i = 0; i < count; ++i) {
        labels.push_back(set_labels[i]);
        sets.insert(sets.end(), {first, count});
        cells.insert(cells.end(), {set_cells[i][0], set_cells[i][1], set_cells[i][2], 0});
        for (int a = 0; a < 3; ++a)
            coords.push_back(float(set_cells[i][a] - mean[a]));
    }
    for (uint32_t at = 0; at < count; at += kAttentionTile)
        tiles.insert(tiles.end(), {first + at, std::min(kAttentionTile, count - at), first, count});
    longest = std::max(longest, count);
}

void TokenSets::pad(uint32_t null_label)
{
    const std::vector<CellIndex> nowhere(round_up(rows(), kRowAlignment) - rows());
    if (nowhere.empty())
        tiles.insert(tiles.end(), 4, 0);
    else
        add(nowhere, std::vector<uint32_t>(nowhere.size(), null_label));
}

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
    position_frequencies_ = constants_.tensor(config.pos_embed_dim / 2, 1, DType::f32, "frequencies", 1);
    time_frequencies_ = constants_.tensor(kTimeFrequencies, 1, DType::f32, "frequencies", 1);
}

Result<std::unique_ptr<Transformer>> Transformer::load(Device& device, const Path& folder, DType precision,
                                                       const Path& named, const LoadProgress& progress)
{
    SR_TRY(const TransformerConfig config, read_transformer_config(folder));
    SR_TRY(const SafetensorsSet file, SafetensorsSet::open_folder(folder));
    std::unique_ptr<Transformer> t(new Transformer(config, precision));
    SR_TRY(const LowRankAdapter adapter, LowRankAdapter::open(named.empty() ? folder / kAdapterFile : named));
    SR_CHECK(t->weights_.load(device, file, adapter, progress));
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
    for (const DeviceTensor& slot : {position_frequencies_, time_frequencies_}) {
        const uint32_t n = slot.rows();
        std::vector<float> w(n);
        for (uint32_t i = 0; i < n; ++i)
            w[i] = float(std::exp(-std::log(10000.0) * i / n));
        SR_CHECK(slot.write(device, w));
    }
    return {};
}

Tensor Transformer::neighbors(Graph& g, const TokenContext& context, uint32_t near_row, double near_radius) const
{
    const double near = std::min<double>(near_radius, config_.attention_radius);
    const NeighborRadius radius{config_.radius2(), near_row, config_.radius2_of(near)};
    return neighbor_mask(g, context.cells, context.sets, context.longest, radius);
}

Tensor Transformer::positions(Graph& g, const TokenContext& context) const
{
    const Tensor waves = sinusoid(g, context.coords, position_frequencies_.in(g), false, precision_); // [M, 3P]
    return gemm(g, waves, weights_.pos_embed.in(g), weights_.pos_embed_bias.in(g), {.dtype = precision_});
}

Conditioned Transformer::condition(Graph& g, Tensor pos, Tensor condition) const
{
    const Tensor hidden = silu(g, gemm(g, condition, weights_.condition_in.in(g), {}, {.dtype = precision_}));
    const Tensor out = gemm(g, hidden, weights_.condition_out.in(g), {}, {.dtype = precision_});
    Conditioned made{.semantic = config_.context_pos_embed ? add(g, out, pos) : out, .voxels = {}};
    if (config_.condition_voxels)
        made.voxels = add(g, gemm(g, hidden, weights_.condition_voxels.in(g), {}, {.dtype = precision_}), pos);
    return made;
}

void Transformer::modulations(Graph& g, Tensor timesteps, Tensor table) const
{
    const Tensor waves = sinusoid(g, timesteps, time_frequencies_.in(g), true, DType::f32); // [T, 256]
    const Tensor hidden =
        silu(g, gemm(g, waves, weights_.time_in.in(g), weights_.time_in_bias.in(g), {.dtype = DType::f32})); // [T, D]
    const Tensor temb = silu(g, gemm(g, hidden, weights_.time_out.in(g), weights_.time_out_bias.in(g),
                                     {.dtype = precision_})); // [T, D], after the SiLU that every adaLN begins with
    const auto project = [&](const DeviceTensor& w, const DeviceTensor& bias, uint32_t column) {
        (void)gemm(g, temb, w.in(g), bias.in(g), {.dtype = DType::f32, .part = {.whole = table, .col = column}});
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
    const auto modulation = [&](uint32_t part, Tensor like) {
        return Modulation{table, table_row.row_range(0, like.rows), column + part * d, step};
    };
    const Tensor h = modulate(g, x, modulation(0, x), column + d, kNormEps, 2);
    Tensor qkv = gemm(g, h, w.qkv.in(g), w.qkv_bias.in(g), {.groups = 2, .dtype = precision_}); // [2M, 3D]
    if (config_.qk_norm)
        qkv = head_rms_norm(g, qkv, w.head_norms.in(g), config_.num_attention_heads, kNormEps, 2);
    const Tensor seen =
        attention(g, qkv, context.tiles, context.mask, config_.num_attention_heads, streams); // [streams * M, D]
    const Tensor mixed = gemm(g, seen, w.out.in(g), w.out_bias.in(g), {.groups = streams, .dtype = precision_});
    const Tensor residual = streams == 2 ? x : x.row_range(0, rows);
    const Tensor y = gated_add(g, mixed, modulation(2, residual), residual, streams);
    const Tensor n = modulate(g, y, modulation(3, y), column + 4 * d, kNormEps, streams);
    const Tensor inner =
        gelu(g, gemm(g, n, w.ff_in.in(g), w.ff_in_bias.in(g), {.groups = streams, .dtype = precision_}));
    const Tensor outer = gemm(g, inner, w.ff_out.in(g), w.ff_out_bias.in(g), {.groups = streams, .dtype = precision_});
    return gated_add(g, outer, modulation(5, y), y, streams);
}

Tensor Transformer::forward(Graph& g, Tensor tokens, const TokenContext& context, Tensor table, Tensor table_row) const
{
    const uint32_t rows = tokens.rows;
    Tensor x = g.matrix(2 * rows, config_.dim(), precision_, "tokens");
    const Tensor embedded = gemm(g, tokens, weights_.proj_in.in(g), weights_.proj_in_bias.in(g), {.dtype = precision_});
    add(g, embedded, context.voxel_conditioning.valid() ? context.voxel_conditioning : context.pos, {x});
    const Tensor beside = context.conditioning.valid() ? context.conditioning
                          : config_.context_pos_embed  ? context.pos
                                                       : Tensor{};
    embedding(g, context.labels, weights_.semantic_embed.in(g), beside, precision_, {x, rows});
    for (uint32_t i = 0; i < config_.num_layers; ++i)
        x = block(g, i, x, context, table, table_row);
    const uint32_t column = block_columns_.back();
    const Tensor n =
        modulate(g, x, {table, table_row.row_range(0, rows), column, 0}, column + config_.dim(), kNormEps, 1);
    return gemm(g, n, weights_.proj_out.in(g), weights_.proj_out_bias.in(g), {.dtype = DType::f32});
}

} // namespace semrover
