// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/splat/surfels.h"

#include "engine/scene/palette.h"
#include "runtime/device/copy_ring.h"
#include "runtime/device/program.h"

#include <cmath>

namespace semrover {

// rows as SplatScene of kernels/splat.h has them
struct SurfelScene::Host {
    using Row = std::array<float, 4>;
    std::vector<Row> positions = {}, normals = {}, colors = {};
    std::vector<uint32_t> labels = {}, cells = {};
    bool complete = false; // normals are known

    size_t skipped() const
    {
        size_t n = 0;
        for (size_t i = 0; i < positions.size(); ++i)
            n += !drawable(i);
        return n;
    }
    bool drawable(size_t i) const
    {
        for (const Row* row : {&positions[i], &normals[i], &colors[i]})
            for (float v : *row)
                if (!std::isfinite(v))
                    return false;
        const Row& n = normals[i];
        const bool has_normal = !complete || n[0] * n[0] + n[1] * n[1] + n[2] * n[2] >= 1e-6f;
        return has_normal && positions[i][3] >= 1.f / 255 && n[3] > 0 && colors[i][3] > 0;
    }
};

namespace {

// of the rms distance to the nearest three points: sigma is about 0.1 m on a road of 20 points per 0.6 m cell, and
// alpha 0.98 (docs/method.md §5.2); at 0.75 a bright background still shines through
constexpr float kSpacing = 0.95f;
constexpr size_t kMaxSurfels = 1u << 26; // 64 bytes of neighbours each in 32 bits

std::array<float, 4> row_of(const std::array<float, 3>& v, float w)
{
    return {v[0], v[1], v[2], w};
}

Status check_count(size_t n, std::initializer_list<size_t> sizes)
{
    for (size_t size : sizes)
        if (size != n)
            return fail(ErrorCode::bad_input, "surfels: an array of {} entries for {} points", size, n);
    if (n > kMaxSurfels)
        return fail(ErrorCode::bad_input, "surfels: {} points, at most {} are supported", n, kMaxSurfels);
    return {};
}

uint32_t label_bits(std::initializer_list<std::string_view> names)
{
    uint32_t bits = 0;
    for (std::string_view name : names)
        if (const auto label = class_of_name(name))
            bits |= 1u << *label;
    return bits;
}

} // namespace

Result<SurfelScene> SurfelScene::create(Device& device, const ScenePoints& points, const SurfelOptions& options)
{
    const size_t n = points.size();
    SR_CHECK(check_count(n, {points.colors.size(), points.labels.size(), points.cells.size()}));
    if (options.neighbors < 1 || options.neighbors > kMaxNeighbors)
        return fail(ErrorCode::usage, "surfels: {} neighbours, 1 to {} are supported", options.neighbors,
                    kMaxNeighbors);
    if (!(options.sigma > 0) || !std::isfinite(options.sigma))
        return fail(ErrorCode::usage, "surfels: a splat radius of {} m", options.sigma);
    Host host{.labels = points.labels, .cells = points.cells};
    for (size_t i = 0; i < n; ++i) {
        host.positions.push_back(row_of(points.positions[i], options.opacity));
        host.normals.push_back({0, 0, 0, options.sigma});
        host.colors.push_back(row_of(points.colors[i], options.sigma));
    }
    SurfelScene scene(device);
    SR_CHECK(scene.upload(host));
    if (n)
        SR_CHECK(scene.derive(options));
    return scene;
}

Result<SurfelScene> SurfelScene::create(Device& device, const Surfels& s)
{
    const size_t n = s.position.size();
    SR_CHECK(check_count(
        n, {s.normal.size(), s.color.size(), s.sigma_u.size(), s.sigma_v.size(), s.opacity.size(), s.label.size()}));
    Host host{.labels = {s.label.begin(), s.label.end()}, .complete = true};
    for (size_t i = 0; i < n; ++i) {
        host.positions.push_back(row_of(s.position[i], s.opacity[i]));
        host.normals.push_back(row_of(s.normal[i], s.sigma_u[i]));
        host.colors.push_back(row_of(s.color[i], s.sigma_v[i]));
        host.cells.push_back(uint32_t(i));
    }
    SurfelScene scene(device);
    SR_CHECK(scene.upload(host));
    return scene;
}

Result<SurfelScene> SurfelScene::reserve(Device& device, uint32_t size)
{
    SurfelScene scene(device);
    scene.size_ = size;
    SR_CHECK(scene.allocate());
    for (const Slot& slot : scene.arrays())
        SR_CHECK(slot.clear(device));
    return scene;
}

Status SurfelScene::put(CopyRing& copies, uint32_t first, const SurfelScene& from)
{
    SR_ASSERT(first + from.size_ <= size_, "{} surfels from {} on in a scene of {}", from.size_, first, size_);
    const std::array<Slot, 5> to_arrays = arrays(), from_arrays = from.arrays();
    for (size_t a = 0; a < to_arrays.size() && from.size_; ++a)
        SR_CHECK(copies.copy(from_arrays[a].row_range(0, from.size_), to_arrays[a].row_range(first, from.size_))
                     .map([](uint64_t) {}));
    return {};
}

Status SurfelScene::hide(uint32_t first, uint32_t count)
{
    return positions_.row_range(first, count).clear(*device_);
}

Status SurfelScene::allocate()
{
    const uint32_t rows = std::max(size_, 1u);
    positions_ = state_.slot(rows, 4, DType::f32, "positions", 4);
    normals_ = state_.slot(rows, 4, DType::f32, "normals", 4);
    colors_ = state_.slot(rows, 4, DType::f32, "colours", 4);
    labels_ = state_.slot(rows, 1, DType::u32, "labels", 1);
    cells_ = state_.slot(rows, 1, DType::u32, "cells", 1);
    return state_.allocate(*device_, "surfels");
}

Status SurfelScene::upload(const Host& host)
{
    size_ = uint32_t(host.positions.size());
    skipped_ = uint32_t(host.skipped());
    SR_CHECK(allocate());
    if (!size_) {
        for (const Slot& slot : arrays())
            SR_CHECK(slot.clear(*device_));
        return {};
    }
    SR_CHECK(positions_.write(*device_, host.positions));
    SR_CHECK(normals_.write(*device_, host.normals));
    SR_CHECK(colors_.write(*device_, host.colors));
    SR_CHECK(labels_.write(*device_, host.labels));
    return cells_.write(*device_, host.cells);
}

// normals from the nearest points, and sigmas if they follow the spacing
Status SurfelScene::derive(const SurfelOptions& options)
{
    Graph g;
    const Tensor points = positions_.in(g), labels = labels_.in(g);
    KnnOptions near{.neighbors = options.neighbors, .radius = options.neighbor_radius};
    if (options.same_label)
        near.labels = labels;
    const Tensor neighbors = knn(g, points, near);
    const uint32_t lines = label_bits({"pole", "traffic light", "traffic sign"});
    const PcaNormals planes =
        pca_normal(g, points, neighbors, {.fallbacks = options.fallbacks, .labels = labels, .line_labels = lines});
    SurfelSize size{.sigma = options.sigma};
    if (options.auto_sigma)
        size.spacing = kSpacing;
    size.largest = options.largest_sigma;
    g.keep(surfel(g, points, colors_.in(g), neighbors, planes.normals, size), normals_);
    SR_TRY(const auto program, Program::create(*device_, g));
    return program->run();
}

SplatScene SurfelScene::in(Graph& g) const
{
    return {positions_.in(g), normals_.in(g), colors_.in(g), labels_.in(g), cells_.in(g)};
}

uint64_t SurfelScene::bytes() const
{
    return state_.planned_bytes(device_->limits());
}

Result<Surfels> SurfelScene::read() const
{
    Host host;
    SR_TRY(host.positions, positions_.read<Host::Row>(*device_));
    SR_TRY(host.normals, normals_.read<Host::Row>(*device_));
    SR_TRY(host.colors, colors_.read<Host::Row>(*device_));
    SR_TRY(host.labels, labels_.read<uint32_t>(*device_));
    Surfels out;
    for (size_t i = 0; i < size_; ++i) {
        const auto &p = host.positions[i], &n = host.normals[i], &c = host.colors[i];
        out.position.push_back({p[0], p[1], p[2]});
        out.opacity.push_back(p[3]);
        out.normal.push_back({n[0], n[1], n[2]});
        out.sigma_u.push_back(n[3]);
        out.color.push_back({c[0], c[1], c[2]});
        out.sigma_v.push_back(c[3]);
        out.label.push_back(uint8_t(host.labels[i]));
    }
    return out;
}

} // namespace semrover
