// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/splat/splat_scene.h"

#include "engine/scene/palette.h"
#include "runtime/device/command.h"
#include "runtime/device/command_ring.h"
#include "runtime/device/executable.h"

#include <cmath>

namespace semrover {

// rows as SplatTensors of kernels/splat.h has them
struct SplatScene::Host {
    using Row = std::array<float, 4>;
    std::vector<Row> positions = {}, normals = {}, colors = {};
    std::vector<uint32_t> labels = {}, cells = {}, owners = {};
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

// of the rms distance to the nearest three points: sigma is about 0.1 m on a road of 20 points per 0.6 m voxel, and
// alpha 0.98 (docs/method.md §5.2); at 0.75 a bright background still shines through
constexpr float kSpacing = 0.95f;
constexpr size_t kMaxSplats = 1u << 26; // 64 bytes of neighbours each in 32 bits

std::array<float, 4> row_of(const std::array<float, 3>& v, float w)
{
    return {v[0], v[1], v[2], w};
}

Status check_count(size_t n, std::initializer_list<size_t> sizes)
{
    for (size_t size : sizes)
        if (size != n)
            return fail(ErrorCode::bad_input, "splats: an array of {} entries for {} points", size, n);
    if (n > kMaxSplats)
        return fail(ErrorCode::bad_input, "splats: {} points, at most {} are supported", n, kMaxSplats);
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

Status check_points(const ScenePoints& points)
{
    const size_t owners = points.owners.empty() ? points.size() : points.owners.size();
    return check_count(points.size(), {points.colors.size(), points.labels.size(), points.cells.size(), owners});
}

Status check_point_splat_options(const PointSplatOptions& options)
{
    if (options.neighbors < 1 || options.neighbors > kMaxNeighbors)
        return fail(ErrorCode::usage, "splats: {} neighbours, 1 to {} are supported", options.neighbors, kMaxNeighbors);
    if (!(options.sigma > 0) || !std::isfinite(options.sigma))
        return fail(ErrorCode::usage, "splats: a splat radius of {} m", options.sigma);
    return {};
}

Result<SplatScene> SplatScene::create(Device& device, const ScenePoints& points, const PointSplatOptions& options)
{
    SR_CHECK(check_points(points));
    SR_CHECK(check_point_splat_options(options));
    const size_t n = points.size();
    Host host{.labels = points.labels, .cells = points.cells, .owners = points.owners};
    host.owners.resize(n);
    for (size_t i = 0; i < n; ++i) {
        host.positions.push_back(row_of(points.positions[i], options.opacity));
        host.normals.push_back({0, 0, 0, options.sigma});
        host.colors.push_back(row_of(points.colors[i], options.sigma));
    }
    SplatScene scene(device);
    SR_CHECK(scene.upload(host));
    if (!n)
        return scene;
    Graph g(device.limits());
    scene.derive(g, options);
    SR_TRY(const auto executable, Executable::create(device, g));
    SR_CHECK(executable->run());
    return scene;
}

Result<SplatScene> SplatScene::create(Device& device, const Splats& s, std::span<const uint32_t> owners)
{
    const size_t n = s.position.size();
    SR_CHECK(check_count(n, {s.normal.size(), s.color.size(), s.sigma_u.size(), s.sigma_v.size(), s.opacity.size(),
                             s.label.size(), owners.empty() ? n : owners.size()}));
    Host host{.labels = {s.label.begin(), s.label.end()}, .owners = {owners.begin(), owners.end()}, .complete = true};
    host.owners.resize(n);
    for (size_t i = 0; i < n; ++i) {
        host.positions.push_back(row_of(s.position[i], s.opacity[i]));
        host.normals.push_back(row_of(s.normal[i], s.sigma_u[i]));
        host.colors.push_back(row_of(s.color[i], s.sigma_v[i]));
        host.cells.push_back(uint32_t(i));
    }
    SplatScene scene(device);
    SR_CHECK(scene.upload(host));
    return scene;
}

Result<SplatScene> SplatScene::reserve(Device& device, uint32_t size, bool by_blocks)
{
    SplatScene scene(device);
    scene.size_ = size;
    SR_CHECK(scene.allocate(by_blocks));
    for (const DeviceTensor& slot : scene.arrays())
        SR_CHECK(slot.clear(device));
    if (by_blocks)
        SR_CHECK(scene.blocks_.clear(device));
    return scene;
}

Result<SplatScene> SplatScene::joined(Device& device, std::span<const SplatScene> parts)
{
    size_t size = 0;
    for (const SplatScene& part : parts)
        size += part.size();
    SR_CHECK(check_count(size, {}));
    SR_TRY(SplatScene scene, reserve(device, uint32_t(size), false));
    SR_TRY(const auto ring, CommandRing::create(device));
    SR_TRY(const VkCommandBuffer commands, ring->begin());
    uint32_t first = 0;
    for (const SplatScene& part : parts) {
        if (part.size())
            scene.record_put(commands, first, part, part.size());
        first += part.size();
        scene.skipped_ += part.skipped();
    }
    SR_TRY(const uint64_t ticket, ring->submit());
    SR_CHECK(device.wait(ticket));
    return scene;
}

void SplatScene::record_put(VkCommandBuffer commands, uint32_t first, const SplatScene& from, uint32_t count)
{
    SR_ASSERT(first + count <= size_ && count <= from.size_, "{} of {} splats from {} on in a scene of {}", count,
              from.size_, first, size_);
    const auto to_arrays = arrays(), from_arrays = from.arrays();
    for (size_t a = 0; a < to_arrays.size(); ++a) {
        const BufferSlice to = to_arrays[a].row_range(first, count).slice(), slice = from_arrays[a].slice();
        record_copy(device_->vk(), commands, slice.buffer->handle(), slice.offset, to.buffer->handle(), to.offset,
                    to.bytes);
    }
}

Status SplatScene::allocate(bool by_blocks)
{
    const uint32_t rows = std::max(size_, 1u);
    positions_ = state_.tensor(rows, 4, DType::f32, "positions", 4);
    normals_ = state_.tensor(rows, 4, DType::f32, "normals", 4);
    colors_ = state_.tensor(rows, 4, DType::f32, "colours", 4);
    labels_ = state_.tensor(rows, 1, DType::u32, "labels", 1);
    cells_ = state_.tensor(rows, 1, DType::u32, "cells", 1);
    owners_ = state_.tensor(rows, 1, DType::u32, "owners", 1);
    if (by_blocks)
        blocks_ = state_.tensor(divide_up(rows, kBlock), 1, DType::u32, "blocks of splats", 1);
    return state_.allocate(*device_, "splats");
}

Status SplatScene::upload(const Host& host)
{
    size_ = uint32_t(host.positions.size());
    skipped_ = uint32_t(host.skipped());
    SR_CHECK(allocate());
    if (!size_) {
        for (const DeviceTensor& slot : arrays())
            SR_CHECK(slot.clear(*device_));
        return {};
    }
    SR_CHECK(positions_.write(*device_, host.positions));
    SR_CHECK(normals_.write(*device_, host.normals));
    SR_CHECK(colors_.write(*device_, host.colors));
    SR_CHECK(labels_.write(*device_, host.labels));
    SR_CHECK(cells_.write(*device_, host.cells));
    return owners_.write(*device_, host.owners);
}

void SplatScene::derive(Graph& g, const PointSplatOptions& options) const
{
    const Tensor points = positions_.in(g), labels = labels_.in(g);
    KnnOptions near{.neighbors = options.neighbors, .radius = options.neighbor_radius};
    if (options.same_label)
        near.labels = labels;
    const Tensor neighbors = knn(g, points, near);
    const uint32_t lines = label_bits({"pole", "traffic light", "traffic sign"});
    const PcaNormals planes =
        pca_normal(g, points, neighbors, {.fallbacks = options.fallbacks, .labels = labels, .line_labels = lines});
    SplatSize size{.sigma = options.sigma};
    if (options.auto_sigma)
        size.spacing = kSpacing;
    size.largest = options.largest_sigma;
    g.keep(splat_shape(g, points, colors_.in(g), neighbors, planes.normals, size), normals_);
}

SplatTensors SplatScene::in(Graph& g, uint32_t rows) const
{
    const auto first = [&](const DeviceTensor& slot) { return slot.row_range(0, std::max(rows, 1u)).in(g); };
    SplatTensors scene{first(positions_), first(normals_), first(colors_),
                       first(labels_),    first(cells_),   first(owners_)};
    if (blocks_.valid())
        scene.blocks = blocks_.row_range(0, divide_up(rows, kBlock)).in(g);
    return scene;
}

uint64_t SplatScene::bytes() const
{
    return state_.planned_bytes(device_->limits());
}

Result<Splats> SplatScene::read() const
{
    Host host;
    SR_TRY(host.positions, positions_.read<Host::Row>(*device_));
    SR_TRY(host.normals, normals_.read<Host::Row>(*device_));
    SR_TRY(host.colors, colors_.read<Host::Row>(*device_));
    SR_TRY(host.labels, labels_.read<uint32_t>(*device_));
    Splats out;
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
