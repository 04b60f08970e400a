// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/splat/rasterizer.h"

#include "engine/camera/lens.h"
#include "kernels/splat.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

constexpr uint32_t kPairBytes = 4;

SplatLens lens_of(CameraModel model)
{
    switch (model) {
    case CameraModel::opencv:
        return SplatLens::opencv;
    case CameraModel::fisheye:
        return SplatLens::fisheye;
    case CameraModel::equirectangular:
        return SplatLens::equirectangular;
    case CameraModel::pinhole:
        break;
    }
    return SplatLens::pinhole;
}

Status check_camera(const SplatCamera& c, size_t index)
{
    bool finite = std::isfinite(c.fx) && std::isfinite(c.fy) && std::isfinite(c.cx) && std::isfinite(c.cy);
    for (float v : c.world_to_camera)
        finite = finite && std::isfinite(v);
    for (float v : c.distortion)
        finite = finite && std::isfinite(v);
    if (!finite || c.fx == 0 || c.fy == 0)
        return fail(ErrorCode::bad_input, "camera {}: {}", index,
                    finite ? "no focal length" : "a number is not finite");
    return {};
}

// a camera as the kernels take it
void write_row(const SplatCamera& c, std::span<float> row)
{
    const float focal[] = {c.fx, c.fy, c.cx, c.cy};
    std::copy_n(focal, 4, row.begin());
    std::copy_n(c.world_to_camera.data(), 12, row.begin() + 4);
    if (row.size() == 16)
        return;
    std::copy_n(c.distortion.data(), 8, row.begin() + 16);
    row[24] = c.limit;
    row[25] = c.radial_depth;
}

// room for `need` and a quarter more, if the device can bind it
Result<uint32_t> room_for(uint32_t need, uint32_t bytes_each, const DeviceLimits& limits, const char* what)
{
    const uint64_t limit = std::min(limits.max_storage_range, limits.max_allocation) / bytes_each;
    if (need > limit)
        return fail(ErrorCode::out_of_memory, "a frame needs {} {}; this device has room for {}", need, what, limit);
    return uint32_t(std::min<uint64_t>(limit, uint64_t(need) + need / 4 + 1024));
}

} // namespace

SplatCamera splat_camera(const Intrinsics& i, const Pose& pose)
{
    SplatCamera c{float(i.fx), float(i.fy), float(i.cx), float(i.cy)};
    const auto narrowed = [](double v) { return float(v); };
    std::transform(pose.world_to_camera.begin(), pose.world_to_camera.begin() + 12, c.world_to_camera.begin(),
                   narrowed);
    if (i.model != CameraModel::pinhole) {
        const Lens lens(i);
        std::ranges::transform(i.distortion, c.distortion.begin(), narrowed);
        c.limit = float(lens.limit());
        c.radial_depth = lens.radial_depth();
    }
    return c;
}

Result<std::unique_ptr<Rasterizer>> Rasterizer::create(Device& device, const SurfelScene& scene, uint32_t width,
                                                       uint32_t height, uint32_t max_cameras,
                                                       const RasterizerOptions& options)
{
    if (width < 1 || height < 1 || width > 65535 || height > 65535)
        return fail(ErrorCode::usage, "an image of {} x {} pixels; 1 to 65535 are supported", width, height);
    if (max_cameras < 1 || options.tile < 16 || options.tile % 16)
        return fail(ErrorCode::usage, "{} cameras, tiles of {} pixels", max_cameras, options.tile);
    std::unique_ptr<Rasterizer> r(new Rasterizer(device, scene));
    r->options_ = options;
    r->width_ = width;
    r->height_ = height;
    const uint64_t limit = std::min(device.limits().max_storage_range, device.limits().max_allocation);
    const uint64_t per_camera =
        std::max(uint64_t(width) * height * 16, uint64_t(scene.size()) * 4); // bytes of the largest tensor
    if (per_camera > limit)
        return fail(ErrorCode::out_of_memory,
                    "{} x {} pixels of {} splats need {} bytes in one tensor; this device takes {}", width, height,
                    scene.size(), per_camera, limit);
    r->cameras_ = uint32_t(std::min<uint64_t>(max_cameras, limit / per_camera));
    r->max_visible_ =
        uint32_t(std::min<uint64_t>(std::max(scene.size(), 1024u), limit / splat_record_bytes(lens_of(options.model))));
    const uint64_t pairs = options.max_pairs ? options.max_pairs : std::max<uint64_t>(8ull * scene.size(), 65536);
    r->max_pairs_ = uint32_t(std::min(pairs, limit / kPairBytes));
    SR_CHECK(r->build());
    return r;
}

Status Rasterizer::build()
{
    program_.reset();
    memory_ = std::make_unique<Arena>();
    const uint64_t pixels = uint64_t(width_) * height_ * cameras_;
    const SplatLens lens = lens_of(options_.model);
    const uint32_t camera_floats = splat_camera_floats(lens);
    for (uint64_t bytes : {uint64_t(cameras_) * camera_floats * 4, uint64_t(4), uint64_t(4), pixels * 16, pixels * 16,
                           pixels * 8, pixels * 8})
        memory_->add(bytes); // in the order of Slot
    SR_CHECK(memory_->allocate(device_, "splat images"));
    Graph g;
    SplatOptions o{.width = width_,
                   .height = height_,
                   .lens = lens,
                   .max_visible = max_visible_,
                   .max_pairs = max_pairs_,
                   .tile = options_.tile};
    o.near = options_.near;
    o.alpha_min = options_.alpha_min;
    o.alpha_max = options_.alpha_max;
    o.transmittance_min = options_.transmittance_min;
    o.screen_variance = options_.screen_variance;
    o.cutoff = options_.cutoff;
    o.visible = g.external(memory_->slice(kVisible), 1, 1, DType::u32, "visible splats", 1);
    o.pairs = g.external(memory_->slice(kPairs), 1, 1, DType::u32, "splat pairs", 1);
    const Tensor cameras =
        g.external(memory_->slice(kCameras), cameras_, camera_floats, DType::f32, "cameras", camera_floats);
    const SplatImages y = splat(g, scene_.in(g), cameras, o);
    for (const auto& [slot, made] :
         {std::pair{kColor, y.color}, {kSurface, y.surface}, {kDepth, y.depth}, {kIds, y.ids}}) {
        const Tensor kept = g.external(memory_->slice(slot), made.rows, made.cols, made.dtype, "splat image", made.ld);
        g.replace(made.resource, kept.resource);
    }
    SR_TRY(program_, Program::create(device_, g));
    return {};
}

Status Rasterizer::make_room(uint32_t visible, uint32_t pairs)
{
    if (visible > max_visible_) {
        SR_TRY(max_visible_,
               room_for(visible, splat_record_bytes(lens_of(options_.model)), device_.limits(), "visible splats"));
    }
    if (pairs > max_pairs_) {
        SR_TRY(max_pairs_, room_for(pairs, kPairBytes, device_.limits(), "pairs of splat and tile"));
    }
    ++rebuilds_;
    return build();
}

// the frames of at most cameras_ cameras, into memory_
Status Rasterizer::draw(std::span<const SplatCamera> cameras)
{
    const uint32_t floats = splat_camera_floats(lens_of(options_.model));
    std::vector<float> table(size_t(cameras_) * floats);
    for (size_t i = 0; i < cameras.size(); ++i)
        write_row(cameras[i], std::span(table).subspan(i * floats, floats));
    for (;;) {
        SR_CHECK(device_.write(memory_->slice(kCameras), std::as_bytes(std::span(table))));
        SR_CHECK(program_->run());
        uint32_t visible, pairs;
        SR_CHECK(device_.read(memory_->slice(kVisible), std::as_writable_bytes(std::span(&visible, 1))));
        SR_CHECK(device_.read(memory_->slice(kPairs), std::as_writable_bytes(std::span(&pairs, 1))));
        if (visible <= max_visible_ && pairs <= max_pairs_)
            return {};
        SR_CHECK(make_room(visible, pairs)); // pairs of what was visible; with more room there may be more
    }
}

Status Rasterizer::read_images(uint32_t count, std::vector<SplatImage>& out)
{
    const size_t pixels = size_t(width_) * height_;
    std::vector<float> color(pixels * 4), surface(pixels * 4), depth(pixels * 2);
    std::vector<uint32_t> ids(pixels * 2);
    for (uint32_t camera = 0; camera < count; ++camera) {
        const auto fetch = [&](Slot slot, auto& values) {
            const auto bytes = std::as_writable_bytes(std::span(values));
            return device_.read(memory_->slice(slot).part(camera * bytes.size(), bytes.size()), bytes);
        };
        SR_CHECK(fetch(kColor, color));
        SR_CHECK(fetch(kSurface, surface));
        SR_CHECK(fetch(kDepth, depth));
        SR_CHECK(fetch(kIds, ids));
        SplatImage image{.width = width_, .height = height_};
        image.color.resize(pixels * 3);
        image.normal.resize(pixels * 3);
        for (auto* plane : {&image.alpha, &image.depth_sum, &image.depth_expected, &image.depth_median})
            plane->resize(pixels);
        image.label.resize(pixels);
        image.cell.resize(pixels);
        image.visible.resize(pixels);
        for (size_t i = 0; i < pixels; ++i) {
            std::copy_n(&color[i * 4], 3, &image.color[i * 3]);
            std::copy_n(&surface[i * 4], 3, &image.normal[i * 3]);
            image.alpha[i] = color[i * 4 + 3];
            image.depth_sum[i] = surface[i * 4 + 3];
            image.depth_expected[i] = depth[i * 2];
            image.depth_median[i] = depth[i * 2 + 1];
            image.label[i] = ids[i * 2];
            image.cell[i] = ids[i * 2 + 1];
            image.visible[i] = image.alpha[i] >= options_.visible_alpha;
        }
        out.push_back(std::move(image));
    }
    return {};
}

Result<std::vector<SplatImage>> Rasterizer::render(std::span<const SplatCamera> cameras)
{
    for (size_t i = 0; i < cameras.size(); ++i)
        SR_CHECK(check_camera(cameras[i], i));
    std::vector<SplatImage> out;
    while (out.size() < cameras.size()) {
        const auto some = cameras.subspan(out.size(), std::min<size_t>(cameras_, cameras.size() - out.size()));
        const Status status = draw(some);
        if (!status && status.error().code == ErrorCode::out_of_memory && some.size() > 1) {
            cameras_ = uint32_t(some.size() + 1) / 2; // together they are too many for this device
            ++rebuilds_;
            SR_CHECK(build());
            continue;
        }
        SR_CHECK(status);
        SR_CHECK(read_images(uint32_t(some.size()), out));
    }
    return out;
}

} // namespace semrover
