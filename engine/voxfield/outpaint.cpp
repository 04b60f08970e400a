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

// as it is in the grid
RegionResult Outpainter::stored(uint32_t region) const
{
    const size_t per_cell = size_t(config_.points_per_voxel) * 3;
    RegionResult out;
    out.region = region;
    const auto targets = graph_->targets(region);
    out.targets.assign(targets.begin(), targets.end());
    for (const size_t cell : targets) {
        const auto at = ptrdiff_t(cell * per_cell), end = ptrdiff_t((cell + 1) * per_cell);
        out.points.insert(out.points.end(), grid_.points.begin() + at, grid_.points.begin() + end);
        out.colors.insert(out.colors.end(), grid_.colors.begin() + at, grid_.colors.begin() + end);
    }
    return out;
}

double Outpainter::part() const
{
    return flight_.empty() || !sampler_ ? 0 : double(sampler_->rows_done()) / double(sampler_->rows());
}

uint32_t Outpainter::widest_batch(uint32_t limit) const
{
    RegionGraph graph = *graph_;
    uint32_t widest = flight_.size() <= limit ? uint32_t(flight_.size()) : 0;
    for (const uint32_t region : flight_) // a batch that is too large is not taken up
        widest ? graph.done(region) : graph.give_back(region);
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

Status Outpainter::resume(OutpaintState state)
{
    SR_ASSERT(flight_.empty() && !sampler_, "work has begun");
    for (const RegionResult& region : state.finished)
        SR_CHECK(restore(region));
    // all into the grid now: the batch knows it, and later batches are those of a run that was not cut off
    std::vector<uint32_t> others;
    for (std::vector<uint32_t> taken; !(taken = graph_->take(regions_.size())).empty();)
        for (const uint32_t region : taken) {
            if (!restored_[region].targets.empty())
                store(restored_[region]);
            else if (std::ranges::count(state.in_flight, region))
                flight_.push_back(region);
            else
                others.push_back(region);
        }
    for (const uint32_t region : others)
        graph_->give_back(region);
    if (!std::ranges::is_permutation(flight_, state.in_flight))
        return fail(ErrorCode::bad_input, "the saved batch does not belong to this run");
    flight_ = std::move(state.in_flight); // in the order that the sampler has them
    resumed_ = std::move(state.sampler);
    return {};
}

Status Outpainter::begin(TokenSampler& sampler, uint32_t batch, FinishedRegion finished)
{
    sampler_ = &sampler;
    batch_ = batch;
    finished_ = std::move(finished);
    if (flight_.size() > batch)
        return cancel(); // it does not fit any more
    return flight_.empty() ? Status() : sampler_->resume(inputs(), std::exchange(resumed_, {}));
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
    resumed_.clear();
    return sampler_ ? sampler_->cancel() : Status();
}

Result<OutpaintState> Outpainter::save()
{
    OutpaintState state;
    for (uint32_t region = 0; region < regions_.size(); ++region) {
        if (graph_->is_done(region))
            state.finished.push_back(stored(region));
        else if (!restored_[region].targets.empty())
            state.finished.push_back(restored_[region]);
    }
    if (flight_.empty())
        return state;
    state.in_flight = flight_;
    state.sampler = resumed_; // not begun yet
    if (sampler_) {
        SR_TRY(state.sampler, sampler_->save());
    }
    return state;
}

} // namespace semrover
