// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/eval/point_scores.h"

#include "engine/mesh/nearest.h"
#include "runtime/base/dtype.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace semrover {

namespace {

std::string text_of(const Cell& c)
{
    return fmt::format("({}, {}, {})", c[0], c[1], c[2]);
}

Status check_cells(const VoxelGrid& generated, const VoxelGrid& truth)
{
    for (const auto& [a, b, name] :
         {std::tuple{&generated, &truth, "the truth"}, std::tuple{&truth, &generated, "the generated grid"}})
        for (const Cell& cell : a->cells)
            if (!find_cell(*b, cell))
                return fail(ErrorCode::bad_input,
                            "expected the same voxels on both sides, found {} generated and {} true ones: {} lacks {}",
                            generated.cells.size(), truth.cells.size(), name, text_of(cell));
    size_t different = 0, first = 0;
    for (size_t i = truth.cells.size(); i-- > 0;)
        if (generated.labels[i] != truth.labels[i]) {
            ++different;
            first = i;
        }
    if (different)
        return fail(ErrorCode::bad_input,
                    "expected the same labels on both sides, found {} voxels that differ: {} is {} "
                    "generated, {} in truth",
                    different, text_of(truth.cells[first]), kPalette[generated.labels[first]].name,
                    kPalette[truth.labels[first]].name);
    return {};
}

Status check_comparable(const VoxelGrid& generated, const VoxelGrid& truth, const ContrastOptions& o)
{
    for (const auto& [grid, name] : {std::pair{&generated, "the generated grid"}, {&truth, "the truth"}})
        if (!grid->has_points())
            return fail(ErrorCode::bad_input, "{} is a semantic grid without points", name);
    if (generated.voxel_size != truth.voxel_size)
        return fail(ErrorCode::bad_input, "expected one voxel size, found {} m generated and {} m in truth",
                    generated.voxel_size, truth.voxel_size);
    if (generated.points_per_voxel != truth.points_per_voxel)
        return fail(ErrorCode::bad_input, "expected as many points a voxel, found {} generated and {} in truth",
                    generated.points_per_voxel, truth.points_per_voxel);
    const double farthest = kMostReach * double(truth.voxel_size);
    if (!(o.radius > 0 && o.radius <= farthest))
        return fail(ErrorCode::bad_input, "expected a radius of at most {} voxels, {:.6g} m, found {} m", kMostReach,
                    farthest, o.radius);
    return check_cells(generated, truth);
}

void add_colors(const VoxelGrid& generated, const VoxelGrid& truth, size_t cell, ClassScores& scores)
{
    const auto n = size_t(truth.points_per_voxel);
    ++scores.cells;
    scores.points += n;
    for (size_t c = 0; c < 3; ++c) {
        double a = 0, b = 0;
        for (size_t i = cell * n; i < (cell + 1) * n; ++i) {
            a += generated.colors[3 * i + c] / 255.0;
            b += truth.colors[3 * i + c] / 255.0;
        }
        scores.generated[c] += a;
        scores.truth[c] += b;
        scores.cell_error += std::abs(a - b) / double(3 * n);
    }
}

// points of the used voxels of a class (kNoLabel: of all), metres from the middle of the grid
std::vector<PointRow> rows_of(const VoxelGrid& grid, std::span<const uint8_t> used, uint8_t label,
                              const std::array<double, 3>& middle)
{
    const auto n = size_t(grid.points_per_voxel);
    std::vector<PointRow> rows;
    for (size_t cell = 0; cell < grid.cells.size(); ++cell) {
        if (!used[cell] || (label != kNoLabel && grid.labels[cell] != label))
            continue;
        for (size_t i = cell * n; i < (cell + 1) * n; ++i) {
            PointRow row{};
            for (size_t a = 0; a < 3; ++a)
                row[a] = float((grid.cells[cell][a] + 0.5 - middle[a]) * double(grid.voxel_size) +
                               double(half_to_float(grid.points[3 * i + a])));
            rows.push_back(row);
        }
    }
    return rows;
}

std::array<double, 3> middle_of(const VoxelGrid& grid) // in voxels
{
    std::array<double, 3> middle;
    for (size_t a = 0; a < 3; ++a) {
        const auto [low, high] = std::ranges::minmax(grid.cells, {}, [&](const Cell& c) { return c[a]; });
        middle[a] = std::round((double(low[a]) + double(high[a])) / 2);
    }
    return middle;
}

Status add_distances(Device& device, const VoxelGrid& generated, const VoxelGrid& truth, std::span<const uint8_t> used,
                     uint8_t label, ClassScores& scores)
{
    const std::array<double, 3> middle = middle_of(truth);
    const std::vector<PointRow> a = rows_of(generated, used, label, middle), b = rows_of(truth, used, label, middle);
    // both sides have points in the same voxels, so that none is further away than the diagonal of a voxel
    const NearestPointsOptions search{.cell_size = truth.voxel_size / 2, .first_radius = 1.75f * truth.voxel_size};
    const auto sum = [](const std::vector<double>& d) { return std::accumulate(d.begin(), d.end(), 0.0); };
    SR_TRY(const std::vector<double> there, nearest_distances(device, a, b, search));
    SR_TRY(const std::vector<double> back, nearest_distances(device, b, a, search));
    scores.to_truth = sum(there);
    scores.to_generated = sum(back);
    return {};
}

} // namespace

ClassScores& ClassScores::operator+=(const ClassScores& other)
{
    cells += other.cells;
    points += other.points;
    for (size_t c = 0; c < 3; ++c) {
        generated[c] += other.generated[c];
        truth[c] += other.truth[c];
    }
    cell_error += other.cell_error;
    to_truth += other.to_truth;
    to_generated += other.to_generated;
    generated_contrast += other.generated_contrast;
    truth_contrast += other.truth_contrast;
    generated_variety += other.generated_variety;
    truth_variety += other.truth_variety;
    return *this;
}

double ClassScores::color_error() const
{
    double sum = 0;
    for (size_t c = 0; c < 3; ++c)
        sum += std::abs(generated[c] - truth[c]);
    return points ? sum / double(3 * points) : 0;
}

double ClassScores::cell_color_error() const
{
    return cells ? cell_error / double(cells) : 0;
}

double ClassScores::chamfer() const
{
    return points ? (to_truth + to_generated) / double(2 * points) : 0;
}

PointScores& PointScores::operator+=(const PointScores& other)
{
    for (size_t i = 0; i < classes.size(); ++i)
        classes[i] += other.classes[i];
    all += other.all;
    left_out += other.left_out;
    return *this;
}

Result<PointScores> score_points(Device& device, const VoxelGrid& generated, const VoxelGrid& truth,
                                 const ContrastOptions& options)
{
    SR_CHECK(check_comparable(generated, truth, options));
    PointScores scores;
    std::vector<uint8_t> used(truth.cells.size());
    for (size_t cell = 0; cell < used.size(); ++cell) {
        used[cell] = generated.generated[cell] && truth.generated[cell];
        if (used[cell])
            add_colors(generated, truth, cell, scores.classes[truth.labels[cell]]);
        else
            ++scores.left_out;
    }
    if (scores.left_out == used.size())
        return fail(ErrorCode::bad_input, "none of {} voxels is generated on both sides", used.size());
    const auto contrast_of_generated = local_contrast(generated, used, options);
    const auto contrast_of_truth = local_contrast(truth, used, options);
    const auto variety_of_generated = color_variety(generated, used), variety_of_truth = color_variety(truth, used);
    for (uint8_t label = 0; label < kClassCount; ++label) {
        ClassScores& c = scores.classes[label];
        c.generated_variety = variety_of_generated[label];
        c.truth_variety = variety_of_truth[label];
        c.generated_contrast = contrast_of_generated[label];
        c.truth_contrast = contrast_of_truth[label];
        scores.all += c;
        if (c.cells)
            SR_CHECK(add_distances(device, generated, truth, used, label, c));
    }
    SR_CHECK(add_distances(device, generated, truth, used, kNoLabel, scores.all));
    return scores;
}

} // namespace semrover
