// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// stage 5: cuts passes into bands of rows where a binding exceeds what the device can bind; then counts workgroups.
// A band has the rows of the bindings that it needs (DispatchOptions::banded).
#include "runtime/graph/plan.h"

#include "runtime/graph/shader_interface.h"

#include <algorithm>
#include <iterator>
#include <numeric>

namespace semrover {

namespace {

// of a row, where one dimension does not hold all workgroups: short, as rows are what a schedule can cut then
constexpr uint32_t kFoldedGroups = 4096;

uint64_t range_limit(const PassBinding& b, const DeviceLimits& limits)
{
    return b.kind == BindingKind::texel ? limits.max_texel_elements * 16 : limits.max_storage_range;
}

const BandedBinding* banded(const Pass& pass, std::string_view binding)
{
    for (const BandedBinding& b : pass.options.banded)
        if (b.name == binding)
            return &b;
    return nullptr;
}

// rows of a binding after which the next one starts aligned
uint64_t aligned_rows(const Tensor& t, const DeviceLimits& limits)
{
    return limits.offset_alignment / std::gcd<uint64_t>(limits.offset_alignment, t.row_bytes());
}

// rows [first, last) of a binding that a band of output rows needs
std::pair<uint64_t, uint64_t> binding_rows(const BandedBinding& band, const Tensor& t, uint64_t first, uint64_t count,
                                           const DeviceLimits& limits)
{
    if (!band.window.out_width)
        return {first / band.divisor, (first + count + band.divisor - 1) / band.divisor};
    auto [begin, end] = band.window.input_rows(first, count);
    begin -= begin % aligned_rows(t, limits);
    return {begin, end};
}

// the most rows per band, of at most `band`, of which a window fits the limit; 0 if not even one step does
uint64_t window_rows(const BandedBinding& b, const Tensor& t, uint64_t rows, uint64_t band, uint64_t step,
                     uint64_t limit, const DeviceLimits& limits)
{
    const auto fits = [&](uint64_t count) {
        for (uint64_t first = 0; first < rows; first += count) {
            const auto [begin, end] = binding_rows(b, t, first, std::min(count, rows - first), limits);
            if ((end - begin) * t.row_bytes() > limit)
                return false;
        }
        return true;
    };
    uint64_t count = std::max(band / step * step, step); // never more than `band`: other bindings decided it
    while (count > step && !fits(count))
        count = std::max(count * 3 / 4 / step * step, step);
    return fits(count) ? count : 0;
}

tl::unexpected<Error> too_large(const Plan& plan, const Pass& pass, size_t b, uint64_t rows, const DeviceLimits& limits)
{
    const PassBinding& binding = pass.bindings[b];
    const std::string& tensor = plan.resources[binding.resource].name;
    const uint64_t limit = range_limit(binding, limits);
    if (!banded(pass, binding.name))
        return fail(ErrorCode::out_of_memory, "{}: binding {} ('{}') has {} bytes; this device binds at most {}",
                    pass.kernel->name, binding.name, tensor, binding.bytes, limit);
    return fail(ErrorCode::out_of_memory, "{}: {} rows of binding {} ('{}') are {} bytes; this device binds at most {}",
                pass.kernel->name, rows, binding.name, tensor, rows * pass.tensors[b].row_bytes(), limit);
}

// the pass for rows [first, first + count) of `total` only
Pass band_of(const Pass& whole, uint32_t first, uint32_t count, uint32_t total, const DeviceLimits& limits)
{
    Pass pass = whole;
    for (size_t b = 0; b < pass.bindings.size(); ++b) {
        const BandedBinding* band = banded(pass, pass.bindings[b].name);
        if (!band)
            continue;
        const auto [begin, end] = binding_rows(*band, pass.tensors[b], first, count, limits);
        pass.tensors[b] = pass.tensors[b].row_range(uint32_t(begin), uint32_t(end - begin));
        pass.bindings[b].offset = pass.tensors[b].offset;
        pass.bindings[b].bytes = pass.tensors[b].bytes();
        if (band->window.out_width)
            pass.set_push(shader_interface::first_member(band->name), uint32_t(begin));
    }
    pass.set_push(shader_interface::kRows, count);
    if (pass.variant->push_member(shader_interface::kFirstRow))
        pass.set_push(shader_interface::kFirstRow, first);
    pass.grid.x = pass.grid.unit == Grid::Unit::tiles ? count : uint32_t(uint64_t(whole.grid.x) * count / total);
    pass.options.flops = whole.options.flops * count / total;
    pass.options.max_flops = whole.options.max_flops * count / total;
    return pass;
}

// rows of the output; 0: it cannot be cut
uint32_t rows_of(const Pass& pass)
{
    for (size_t b = 0; b < pass.bindings.size(); ++b)
        if (const BandedBinding* band = banded(pass, pass.bindings[b].name);
            band && band->divisor == 1 && !band->window.out_width)
            return pass.tensors[b].rows;
    return 0;
}

// rows of the output of which every banded binding starts aligned; windows align themselves
uint64_t aligned_rows(const Pass& pass, const DeviceLimits& limits)
{
    uint64_t step = 1;
    for (size_t b = 0; b < pass.bindings.size(); ++b)
        if (const BandedBinding* band = banded(pass, pass.bindings[b].name); band && !band->window.out_width)
            step = std::lcm(step, band->divisor * aligned_rows(pass.tensors[b], limits));
    return step;
}

// Rows per band that satisfy every limit; rows_of(pass) when nothing has to be cut. out_of_memory: a binding that
// cannot be cut, or of which not even the fewest rows fit.
Result<uint32_t> band_rows(const Plan& plan, const Pass& pass, const DeviceLimits& limits)
{
    const uint32_t rows = rows_of(pass);
    const uint64_t step = aligned_rows(pass, limits);
    uint64_t band = rows;
    for (size_t b = 0; b < pass.bindings.size(); ++b) {
        const uint64_t limit = range_limit(pass.bindings[b], limits);
        if (pass.bindings[b].bytes <= limit)
            continue;
        const BandedBinding* how = banded(pass, pass.bindings[b].name);
        if (how && how->window.out_width)
            band = window_rows(*how, pass.tensors[b], rows, band, step, limit, limits);
        else
            band =
                std::min(band, limit / std::max<uint64_t>(pass.tensors[b].row_bytes(), 1) * (how ? how->divisor : 1));
        if (!how || band < step)
            return too_large(plan, pass, b, step, limits);
    }
    if (band >= rows)
        return rows;
    const uint64_t whole_tiles = std::lcm(step, uint64_t(pass.grid.tile.rows)); // no half-empty ones
    const uint64_t unit = whole_tiles <= band ? whole_tiles : step;
    return uint32_t(std::max(band / unit * unit, unit));
}

// the pass in bands of `rows` rows, the last of which may have fewer
std::vector<Pass> bands_of(const Pass& whole, uint32_t rows, const DeviceLimits& limits)
{
    std::vector<Pass> bands;
    const uint32_t total = rows_of(whole);
    for (uint32_t first = 0; first < total; first += rows)
        bands.push_back(band_of(whole, first, std::min(rows, total - first), total, limits));
    return bands;
}

} // namespace

Status stage::count_groups(Pass& pass, const DeviceLimits& limits)
{
    uint32_t* n = pass.group_count;
    n[0] = pass.grid.x;
    n[1] = pass.grid.y;
    n[2] = pass.grid.z;
    if (pass.grid.unit == Grid::Unit::tiles) {
        n[0] = divide_up(pass.grid.x, pass.grid.tile.rows);
        n[1] = divide_up(pass.grid.y, pass.grid.tile.cols);
    } else if (pass.grid.unit != Grid::Unit::groups) {
        const bool threads = pass.grid.unit == Grid::Unit::threads;
        n[0] = divide_up(pass.grid.x, threads ? pass.variant->local_size[0] : pass.grid.tile.rows);
        if (n[0] > limits.max_groups)
            n[1] = divide_up(n[0], std::min(limits.max_groups, kFoldedGroups)); // the shader's linear_group() undoes it
        n[0] = divide_up(n[0], n[1]);
    }
    for (int i = 0; i < 3; ++i)
        if (n[i] == 0 || n[i] > limits.max_groups)
            return fail(ErrorCode::out_of_memory, "{}: {} workgroups in dimension {}, the device takes 1..{}",
                        pass.kernel->name, n[i], i, limits.max_groups);
    return {};
}

Status stage::bands(Plan& plan, const DeviceLimits& limits)
{
    std::vector<Pass> passes;
    for (const Pass& pass : plan.passes) {
        SR_TRY(const uint32_t band, band_rows(plan, pass, limits));
        if (band == rows_of(pass))
            passes.push_back(pass);
        else
            std::ranges::move(bands_of(pass, band, limits), std::back_inserter(passes));
    }
    for (Pass& pass : passes)
        SR_CHECK(count_groups(pass, limits));
    plan.passes = std::move(passes);
    return {};
}

} // namespace semrover
