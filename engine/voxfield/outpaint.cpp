// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/voxfield/outpaint.h"

#include "engine/voxfield/tile_regions.h"
#include "engine/voxfield/token_codec.h"

#include <algorithm>

namespace semrover {

// the device does not go on with what nobody waits for
Outpainter::~Outpainter()
{
    if (sampler_ && !flight_.empty())
        (void)sampler_->cancel();
}

Result<std::unique_ptr<Outpainter>> Outpainter::create(VoxelGrid& grid, const TransformerConfig& config,
                                                       const RegionOptions& options)
{
    if (std::abs(grid.voxel_size - config.voxel_size) > 1e-4f * config.voxel_size)
        return fail(ErrorCode::bad_input, "the grid has cells of {} m, the model was trained on {} m", grid.voxel_size,
                    config.voxel_size);
    for (size_t i = 0; i < grid.labels.size(); ++i)
        if (grid.labels[i] >= config.num_classes)
            return fail(ErrorCode::bad_input, "cell {} has label {}, the model knows {} classes", i, grid.labels[i],
                        config.num_classes);
    if (grid.has_points() && grid.points_per_voxel != int(config.points_per_voxel))
        return fail(ErrorCode::bad_input, "the grid has {} points a cell, the model makes {}", grid.points_per_voxel,
                    config.points_per_voxel);
    std::unique_ptr<Outpainter> o(new Outpainter(grid, config));
    const size_t v = grid.cells.size(), n = config.points_per_voxel;
    grid.points_per_voxel = int(n);
    grid.points.resize(v * n * 3);
    grid.colors.resize(v * n * 3);
    grid.generated.resize(v);
    SR_TRY(o->regions_, options.tile_cells ? extract_tile_regions(grid.cells, options, grid.generated)
                                           : extract_regions(grid.cells, options, grid.generated));
    o->graph_ = std::make_unique<RegionGraph>(o->regions_, v, grid.generated);
    o->restored_.resize(o->regions_.size());
    for (uint32_t r = 0; r < o->regions_.size(); ++r) {
        o->cells_to_do_ += o->graph_->targets(r).size();
        if (!o->graph_->targets(r).empty())
            o->cells_to_compute_ += o->regions_.region(r).size();
        o->largest_ = std::max(o->largest_, uint32_t(o->regions_.region(r).size()));
    }
    return o;
}

Status Outpainter::restore(const RegionResult& result)
{
    const size_t per_cell = size_t(config_.points_per_voxel) * 3;
    if (result.region >= regions_.size())
        return fail(ErrorCode::bad_input, "saved region {} of {}", result.region, regions_.size());
    const auto targets = graph_->targets(result.region);
    if (!std::equal(targets.begin(), targets.end(), result.targets.begin(), result.targets.end()) ||
        result.points.size() != targets.size() * per_cell || result.colors.size() != result.points.size())
        return fail(ErrorCode::bad_input, "saved region {} does not belong to this run", result.region);
    restored_[result.region] = result;
    return {};
}

RegionInput Outpainter::input(uint32_t region) const
{
    const size_t n = config_.points_per_voxel, channels = config_.channels();
    const auto members = regions_.region(region);
    RegionInput in;
    in.fixed.resize(members.size() * channels);
    const size_t width = conditions_.empty() ? 0 : conditions_.width();
    in.told.resize(members.size() * width);
    for (size_t i = 0; i < members.size(); ++i) {
        const uint32_t cell = members[i];
        in.cells.push_back(grid_.cells[cell]);
        in.labels.push_back(grid_.labels[cell]);
        in.known.push_back(!graph_->is_target(region, cell));
        if (width)
            conditions_.row(cell, grid_.cells[cell], std::span(in.told).subspan(i * width, width));
        if (in.known.back())
            encode_token(config_, std::span(grid_.points).subspan(cell * n * 3, n * 3),
                         std::span(grid_.colors).subspan(cell * n * 3, n * 3),
                         std::span(in.fixed).subspan(i * channels, channels));
    }
    return in;
}

RegionResult Outpainter::result(uint32_t region, const float* tokens) const
{
    const size_t n = config_.points_per_voxel, channels = config_.channels();
    const auto members = regions_.region(region);
    RegionResult out;
    out.region = region;
    const auto targets = graph_->targets(region);
    out.targets.assign(targets.begin(), targets.end());
    out.points.resize(targets.size() * n * 3);
    out.colors.resize(targets.size() * n * 3);
    size_t to = 0; // targets are in the order of the members
    for (size_t i = 0; i < members.size(); ++i) {
        if (!graph_->is_target(region, members[i]))
            continue;
        decode_token(config_, {tokens + i * channels, channels}, std::span(out.points).subspan(to * n * 3, n * 3),
                     std::span(out.colors).subspan(to * n * 3, n * 3));
        ++to;
    }
    return out;
}

void Outpainter::store(const RegionResult& result)
{
    const size_t per_cell = size_t(config_.points_per_voxel) * 3;
    for (size_t i = 0; i < result.targets.size(); ++i) {
        const size_t cell = result.targets[i];
        std::copy_n(&result.points[i * per_cell], per_cell, &grid_.points[cell * per_cell]);
        std::copy_n(&result.colors[i * per_cell], per_cell, &grid_.colors[cell * per_cell]);
        grid_.generated[cell] = 1;
    }
    cells_done_ += result.targets.size();
    graph_->done(result.region);
}

double Outpainter::part() const
{
    return flight_.empty() || !sampler_ ? 0 : double(sampler_->rows_done()) / double(sampler_->rows());
}

uint32_t Outpainter::widest_batch(uint32_t limit) const
{
    RegionGraph graph = *graph_;
    uint32_t widest = 0;
    while (!graph.finished()) {
        uint32_t fresh = 0;
        const std::vector<uint32_t> taken = graph.take(limit);
        for (uint32_t region : taken) {
            fresh += restored_[region].targets.empty();
            graph.done(region);
        }
        widest = std::max(widest, fresh);
    }
    return widest;
}

void Outpainter::begin(TokenSampler& sampler, uint32_t batch, FinishedRegion finished)
{
    sampler_ = &sampler;
    batch_ = batch;
    finished_ = std::move(finished);
}

std::vector<RegionInput> Outpainter::inputs() const
{
    std::vector<RegionInput> inputs;
    for (const uint32_t region : flight_)
        inputs.push_back(input(region));
    return inputs;
}

Status Outpainter::begin_batch()
{
    while (flight_.empty() && !graph_->finished())
        for (uint32_t region : graph_->take(batch_)) {
            if (restored_[region].targets.empty())
                flight_.push_back(region);
            else
                store(restored_[region]);
        }
    return flight_.empty() ? Status() : sampler_->begin(inputs());
}

Status Outpainter::end_batch()
{
    SR_TRY(const std::vector<float> tokens, sampler_->finish());
    const float* at = tokens.data();
    for (const uint32_t region : std::exchange(flight_, {})) {
        const RegionResult r = result(region, at);
        at += regions_.region(region).size() * config_.channels();
        if (finished_)
            SR_CHECK(finished_(r));
        store(r);
    }
    return {};
}

Result<bool> Outpainter::step(size_t submits)
{
    SR_ASSERT(sampler_, "begin() comes first");
    if (flight_.empty())
        SR_CHECK(begin_batch());
    if (flight_.empty())
        return true;
    SR_TRY(const bool complete, sampler_->step(submits));
    if (complete)
        SR_CHECK(end_batch());
    return graph_->finished();
}

Status Outpainter::cancel()
{
    for (const uint32_t region : std::exchange(flight_, {}))
        graph_->give_back(region);
    return sampler_ ? sampler_->cancel() : Status();
}

} // namespace semrover
